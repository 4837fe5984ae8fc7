"""Draws the picture of docs/frenet.md: `python -m tools.frenet_picture docs/images`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from hose_mj import HoseSpec
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.recording.files import write_atomically
from hose_mj.recording.plots.labels import label_line_ends
from hose_mj.recording.plots.style import SOFT, choose_looks, encode_png, make_figure

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
    looks, heights, rates = choose_looks(list(twists)), [], []
    with make_figure((7.6, 5.0), "Twist of an S-shaped hose that nobody turned") as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2))
        for name, dim, dashes in (("y", 1, "-"), ("z", 2, (0, (5, 2)))):
            above.plot(s, shape[:, dim], color="#444444", ls=dashes)
            heights.append((float(shape[-1, dim]), name, "#444444"))
        above.set_ylabel("shape (m)")
        figure.draw_without_rendering()
        label_line_ends(above, heights)
        for label, twist in twists.items():
            below.plot(s, twist, color=looks[label].color, ls=looks[label].dashes)
            rates.append((float(twist[-1]), label, looks[label].ink))
        for knot in np.arange(1, CONTROL_POINTS - 3) / (CONTROL_POINTS - 3):
            below.axvline(knot, color=SOFT, lw=0.5, ls=(0, (1, 3)), zorder=0)
        below.set_xlim(0.0, 1.0)
        below.set_xlabel("arc length (m)")
        below.set_ylabel("twist (rad/m)")
        figure.draw_without_rendering()
        label_line_ends(below, rates)
        return encode_png(figure)


if __name__ == "__main__":
    write_atomically(Path(sys.argv[1]) / "frenet.png", draw_twist())
