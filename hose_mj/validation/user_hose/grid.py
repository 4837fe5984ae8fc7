"""The settings on which a user's hose is run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from hose_mj.scenes.hose_file.hose_file import OwnHose
from hose_mj.validation.case import Case
from hose_mj.validation.settings import (
    LARGEST_STEP,
    SMALLEST_STEP,
    Grid,
    Setting,
    find_largest_step,
)
from hose_mj.validation.user_hose.case import find_fineness

GRID = Grid(
    static={"geds": (8, 12, 16, 24, 32), "cable": (10, 20, 40), "flex": (10, 20, 40)},
    dynamic={"geds": (8, 12, 16, 24, 32), "cable": (10, 20, 40, 80), "flex": (10, 20, 40, 80)},
    schemes={
        "geds": ("bdf2", "bdf2, planar"),
        "cable": ("euler", "rk4"),
        "flex": ("discrete",),
    },
    smallest_geds_step=5e-4,
    longest_ladder=4,
    longest_flex_ladder=4,
    longest_run=math.inf,
    longest_timed_run=0.5,
    rounds=2,
    reference_steps=(0, 0),
)
"""Of a user's hose; the longest run and the reference's steps depend on budget and motion.

GEDS's control points are these times `find_fineness`.
"""


def make_grid(own: OwnHose) -> Grid:
    """The settings for a hose: GEDS's control points grow with the turns of a coil."""

    def refine(resolutions: Mapping[str, tuple[int, ...]]) -> dict[str, tuple[int, ...]]:
        geds = tuple(find_fineness(own) * points for points in resolutions["geds"])
        return {**resolutions, "geds": geds}

    return replace(GRID, static=refine(GRID.static), dynamic=refine(GRID.dynamic))


def can_spin(setting: Setting, rate: float) -> bool:
    """Whether a clamp may turn so fast (rad/s) in this setting: see `HoseModel.move`."""
    assert setting.timestep is not None
    return setting.model == "geds" or rate * setting.timestep < math.pi


def list_own_steps(model: str, scheme: str, resolution: int, case: Case, grid: Grid) -> list[float]:
    """Time steps (s) that divide the pause between samples, each half of the one before."""
    assert case.motion is not None
    pause = case.motion.pause
    first = pause / count_parts(pause, LARGEST_STEP)
    least, most = grid.smallest_geds_step, math.inf
    if model != "geds":
        least, most = SMALLEST_STEP, find_largest_step(scheme, resolution, case)
    count = max(1, math.floor(math.log2(first / least)) + 1)
    steps = [first / 2**k for k in range(count)]
    return [step for step in steps if step < most] or steps[-1:]


def count_parts(pause: float, longest: float) -> int:
    """The power of two, 2 at least, that cuts a pause into steps no longer than `longest` (s)."""
    return int(2 ** max(1, math.ceil(math.log2(pause / longest) - 1e-9)))
