"""Draws the picture of docs/frenet.md: `python -m tools.frenet_picture docs/images`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from hose_mj import HoseSpec
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.recording.files import write_atomically
from hose_mj.recording.plots.curves import plot_twist

CONTROL_POINTS = 16
SPEC = HoseSpec(
    length=1.0,
    axial_stiffness=2e4,
    bending_stiffness=0.05,
    torsional_stiffness=0.04,
    linear_density=0.1,
)


def draw_twist() -> bytes:
    """Returns the PNG: twist along an S that bulges out of its plane by 2 % of its length.

    Both hoses are as `reset` lays them: theta at its rest, whatever each form measures it from.
    """
    phase = np.linspace(0.0, 1.0, 2001)
    points = np.stack(
        [phase, 0.15 * np.sin(2.0 * np.pi * phase), 0.02 * np.sin(np.pi * phase)], axis=1
    )
    points /= np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    s = np.linspace(0.0, 1.0, 2001)
    twists, shape = {}, points
    for label, form in (("theta' + Frenet\ntorsion", "frenet"), ("GEDS, theta", "theta")):
        hose = GedsHose(SPEC, control_points=CONTROL_POINTS, twist=form)
        hose.reset(points)
        twists[label], shape = hose.twist(s), hose.position(s)
    knots = np.arange(1, CONTROL_POINTS - 3) / (CONTROL_POINTS - 3)
    return plot_twist("Twist of an S-shaped hose that nobody turned", s, shape, twists, knots)


if __name__ == "__main__":
    write_atomically(Path(sys.argv[1]) / "frenet.png", draw_twist())
