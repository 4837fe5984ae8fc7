"""The grid of settings on which `hose-mj compare` looks for each model's cheapest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hose_mj.hoses.model import HoseModel
from hose_mj.hoses.registry import make_hose
from hose_mj.validation.cases import Case

STEP_UNIT = 0.02
"""Time steps are this over a whole number, so that they divide the pauses between samples (s)."""
LARGEST_STEP = STEP_UNIT / 2
SMALLEST_STEP = 1e-6
STAGNATION = 0.15
"""A chain's time step is halved, from the largest stable one on, until a halving takes less than
this fraction off its error."""


@dataclass(frozen=True)
class Setting:
    """How a model is run.

    Attributes:
        model: id in `hoses.registry.MODELS`.
        scheme: integrator, and ", planar" behind it for a GEDS hose that moves in a plane.
        resolution: control points or segments.
        clamp_corrected: None where there is nothing to correct.
        timestep: s; None in statics.
    """

    model: str
    scheme: str
    resolution: int
    clamp_corrected: bool | None = None
    timestep: float | None = None

    @property
    def label(self) -> str:
        """One line that tells this setting from all others of a case."""
        size = "control points" if self.model == "geds" else "segments"
        step = "" if self.timestep is None else f", {1e3 * self.timestep:g} ms"
        clamp = {None: "", True: ", clamp-corrected", False: ""}[self.clamp_corrected]
        return f"{self.model}, {self.resolution} {size}{step}, {self.scheme}{clamp}"

    def make(self, case: Case, **options: Any) -> HoseModel:
        """Makes the hose of a case, laid into its initial state by the caller."""
        scheme, _, planar = self.scheme.partition(", ")
        options.update(gravity=case.gravity, timestep=self.timestep or 0.005)
        if self.model == "geds":
            options.update(control_points=self.resolution, plane="xz" if planar else None)
            options.setdefault("scheme", "bdf2" if self.timestep is None else scheme)
        else:
            options.update(segments=self.resolution, clamp_correction=bool(self.clamp_corrected))
            if self.timestep is not None:
                options.update(integrator=scheme)
        if self.model == "cable" and self.timestep is not None:
            # In a plane nothing twists: less torsional stiffness allows the cable larger steps.
            options.update(torsional_stiffness=CABLE_TWIST * case.spec.bending_stiffness)
        return make_hose(self.model, case.spec, **options)


CABLE_TWIST = 0.1
"""Torsional over bending stiffness of the cable in planar motions, lowered in its favour.

Less does not allow it larger steps: from 20 segments on, bending limits them.
"""


@dataclass(frozen=True)
class Grid:
    """What is run.

    Attributes:
        static: resolutions of statics and frequencies, by model.
        dynamic: resolutions of motions, by model.
        schemes: integrators of motions, by model.
        longest_run: a run that would take longer is left out (s).
        rounds: how often a short run is timed, all models in turn; the least counts.
    """

    static: dict[str, tuple[int, ...]]
    dynamic: dict[str, tuple[int, ...]]
    schemes: dict[str, tuple[str, ...]]
    longest_run: float
    rounds: int


_SCHEMES = {
    "geds": ("bdf2", "bdf2, planar"),
    "cable": ("euler", "rk4"),
    "hinge-chain": ("euler", "rk4", "discrete"),
}
FULL = Grid(
    static={
        "geds": (8, 12, 16, 20),
        "cable": (10, 20, 40, 80),
        "hinge-chain": (10, 20, 40, 80),
    },
    dynamic={
        "geds": (8, 9, 10, 11, 12, 13, 14, 16, 20, 24, 32),
        "cable": (10, 15, 20, 30, 40, 60, 80, 120, 160),
        "hinge-chain": (10, 15, 20, 30, 40, 60, 80, 120, 160),
    },
    schemes=_SCHEMES,
    longest_run=120.0,
    rounds=5,
)
QUICK = Grid(
    static={"geds": (8, 12, 20), "cable": (20, 40), "hinge-chain": (20, 40)},
    dynamic={"geds": (8, 10, 12, 13, 16, 24), "cable": (20, 40), "hinge-chain": (20, 40)},
    schemes=_SCHEMES,
    longest_run=4.0,
    rounds=3,
)


def list_static(case: Case, models: tuple[str, ...], grid: Grid) -> Iterator[Setting]:
    """Yields the settings of a static case."""
    for model in models:
        scheme = "statics" if model == "geds" else "newton on joint angles"
        for resolution in grid.static[model]:
            for corrected in _clamps(model, case):
                yield Setting(model, scheme, resolution, corrected)


def list_ladders(case: Case, models: tuple[str, ...], grid: Grid) -> Iterator[list[Setting]]:
    """Yields, for each model, scheme and resolution, the time steps to try, coarse to fine."""
    for model in models:
        for scheme in grid.schemes[model]:
            for resolution in grid.dynamic[model]:
                for corrected in _clamps(model, case):
                    yield [
                        Setting(model, scheme, resolution, corrected, step)
                        for step in _steps(model, case)
                    ]


def _clamps(model: str, case: Case) -> tuple[bool | None, ...]:
    return (None,) if model == "geds" or not case.clamped else (True, False)


def _steps(model: str, case: Case) -> list[float]:
    """From LARGEST_STEP down, each 1.2 to 1.5 times smaller; all halves of each are among them."""
    if model == "geds":
        return list(case.steps)
    parts = [2, 3, 4, 5, 6]
    while STEP_UNIT / parts[-1] > SMALLEST_STEP:
        parts.append(2 * parts[-3])
    return [STEP_UNIT / part for part in parts]
