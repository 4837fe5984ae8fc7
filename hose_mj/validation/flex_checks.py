"""What softness is left in the edges of MuJoCo's flex rod, measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hose_mj.checks import Check
from hose_mj.hoses.mujoco.flex import FlexHose
from hose_mj.validation.case import Case
from hose_mj.validation.cases import find_cases
from hose_mj.validation.run import simulate
from hose_mj.validation.settings import Setting

CASE = "released-rod"
SEGMENTS = 20
STEPS = (0.004, 0.002, 0.001)
"""Time steps (s); the default edges have a time constant of two steps."""


def measure_stretch(case: Case, timestep: float) -> float:
    """Largest strain of any edge at the sampled instants of a motion, either sign."""
    corrected = True if case.clamped else None
    hose = Setting("flex", "discrete", SEGMENTS, corrected, timestep).make(case)
    assert isinstance(hose, FlexHose)
    strains: list[float] = []

    def probe(moving: object) -> np.ndarray:
        strains.append(float(np.abs(hose.stretch()).max()))
        return np.zeros(3)

    simulate(replace(case, probe=probe), hose)
    return max(strains)


def check_flex_stretch() -> list[Check]:
    """Stretch of the released rod's edges, and how it falls with the time step."""
    case = find_cases((CASE,))[0]
    stretches = [measure_stretch(case, step) for step in STEPS]
    order = float(np.polyfit(np.log(STEPS), np.log(stretches), 1)[0])
    name = f"flex, {SEGMENTS} segments: residual stretch of the released rod"
    return [
        Check(f"{name} at {1e3 * STEPS[-1]:g} ms", stretches[-1], 1e-3),
        Check(f"{name}, order in the time step", order, 1.8, ">="),
    ]
