"""The grid of settings on which `hose-mj compare` looks for each model's cheapest."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from hose_mj.hoses.protocol import HoseModel
from hose_mj.hoses.registry import MODELS, find_model, make_hose
from hose_mj.validation.case import Case

STEP_UNIT = 0.02
"""Time steps are this over a whole number, so that they divide the pauses between samples (s)."""
LARGEST_STEP = STEP_UNIT / 2
SMALLEST_STEP = 1e-6
RAW_CLAMPS = (10, 20, 40, 80)  # segments with which MuJoCo's clamp is also run as documented
MOST_UNSTABLE = 10  # a chain that is unstable at the first so many time steps is given up
STAGNATION = 0.15
"""A chain's time step is halved, from the largest stable one on, until a halving takes less than
this fraction off its error."""


def has_cable() -> bool:
    """Says whether this MuJoCo has the composite cable: versions from 4 on have none."""
    return int(version("mujoco").partition(".")[0]) < 4


@dataclass(frozen=True)
class Setting:
    """The numbers and the scheme with which a model is run."""

    model: str  # id in `hoses.registry.MODELS`
    scheme: str  # integrator, and ", planar" behind it for a GEDS hose that moves in a plane
    resolution: int  # control points or segments
    clamp_corrected: bool | None = None  # None where there is nothing to correct
    timestep: float | None = None  # s; None in statics

    @property
    def planar(self) -> bool:
        """Says whether GEDS moves in a plane; the hinge chain always does, other peers never."""
        return self.scheme.endswith(", planar")

    @property
    def label(self) -> str:
        """One line that tells this setting from all others of a case."""
        size = find_model(self.model).resolution.replace("_", " ")
        step = "" if self.timestep is None else f", {1e3 * self.timestep:g} ms"
        clamp = {None: "", True: ", clamp-corrected", False: ""}[self.clamp_corrected]
        return f"{self.model}, {self.resolution} {size}{step}, {self.scheme}{clamp}"

    def make(self, case: Case, **options: Any) -> HoseModel:
        """Makes the hose of a case, laid into its initial state by the caller."""
        entry = find_model(self.model)
        options.update(gravity=case.gravity, timestep=self.timestep or 0.005)
        options[entry.resolution] = self.resolution
        if entry.plane:
            options[entry.plane] = "xz" if self.planar else None
        if entry.has_clamp_correction:
            options.update(clamp_correction=bool(self.clamp_corrected))
        if entry.scheme and self.timestep is not None:
            options.setdefault(entry.scheme, self.scheme.removesuffix(", planar"))
        if self.model == "cable" and self.timestep is not None and case.planar:
            # In a plane nothing twists: less torsional stiffness allows the cable larger steps.
            options.update(torsional_stiffness=CABLE_TWIST * case.spec.bending_stiffness)
        if case.obstacles:
            options.update(obstacles=case.obstacles)
            if entry.contact_law:
                options.update(contact_law=case.contact_law)
        if self.model == "geds":
            options.update(case.options)
        return make_hose(self.model, case.spec, **options)


CABLE_TWIST = 0.1
"""Torsional over bending stiffness of the cable in planar motions, lowered in its favour.

Less does not allow it larger steps: from 20 segments on, bending limits them.
"""


@dataclass(frozen=True)
class Grid:
    """What is run."""

    static: dict[str, tuple[int, ...]]  # resolutions of statics and frequencies, by model
    dynamic: dict[str, tuple[int, ...]]  # resolutions of motions, by model
    schemes: dict[str, tuple[str, ...]]  # integrators of motions, by model
    smallest_geds_step: float  # GEDS's time steps end here (s)
    longest_ladder: int  # at most so many time steps of a chain's resolution are scored
    longest_flex_ladder: int  # the same for the flex, which is stable from the largest step on
    longest_run: float  # a run that would take longer is left out (s)
    longest_timed_run: float  # a run that took longer is not timed again (s)
    rounds: int  # how often a short run is timed, all models in turn; the least counts
    # Between two samples of a reference, free and damped, the finer of two.
    reference_steps: tuple[int, int]


_SCHEMES = {
    model: (*entry.schemes, *(f"{scheme}, planar" for scheme in entry.schemes if entry.plane))
    for model, entry in MODELS.items()
}
_CHAINS = ("cable", "flex", "hinge-chain")
FULL = Grid(
    static={"geds": (8, 12, 16, 20), **dict.fromkeys(_CHAINS, (10, 20, 40))},
    dynamic={
        "geds": (8, 9, 10, 11, 12, 13, 14, 16, 20, 24, 32),
        **dict.fromkeys(_CHAINS, (10, 15, 20, 30, 40, 60, 80, 120, 160)),
    },
    schemes=_SCHEMES,
    smallest_geds_step=0.0,
    longest_ladder=20,
    longest_flex_ladder=20,
    longest_run=15.0,
    longest_timed_run=2.0,
    rounds=5,
    reference_steps=(512, 128),
)
QUICK = Grid(
    static={"geds": (8, 12, 20), "cable": (20, 40), "flex": (20, 40), "hinge-chain": (20,)},
    dynamic={"geds": (8, 12, 13, 16), **dict.fromkeys(_CHAINS, (20, 40)), "flex": (20, 60)},
    schemes=_SCHEMES | {"hinge-chain": ("euler", "rk4")},
    smallest_geds_step=0.9e-3,
    longest_ladder=3,
    longest_flex_ladder=5,
    longest_run=1.3,
    longest_timed_run=0.6,
    rounds=2,
    reference_steps=(256, 64),
)


ListSteps = Callable[[str, str, int, Case, Grid], list[float]]
"""Time steps to try, from a model, a scheme, a resolution, a case and a grid."""


def list_static(case: Case, models: tuple[str, ...], grid: Grid) -> Iterator[Setting]:
    """Yields the settings of a static case."""
    for model in models:
        scheme = find_model(model).statics
        for resolution in case.resolutions.get(model, grid.static[model]):
            for corrected in _clamps(model, case):
                yield Setting(model, scheme, resolution, corrected)


def list_ladders(
    case: Case, models: tuple[str, ...], grid: Grid, list_steps: ListSteps | None = None
) -> Iterator[list[Setting]]:
    """Yields, for each model, scheme and resolution, the time steps to try, coarse to fine.

    Raw clamps are there to be seen, not to win: they run with a model's first scheme alone. Driven
    holds and contacts leave rk4 out: with MuJoCo's soft holds it was stable at .04 ms only, with 20
    segments, and on an obstacle not at 1 ms. Where costs are not compared, a chain's two coarsest
    resolutions show its gap.
    """
    list_steps = list_steps or _steps
    stiff = case.obstacles or (case.motion is not None and case.motion.drive is not None)
    for model in models:
        for scheme in grid.schemes[model]:
            if (scheme == "rk4" and stiff) or (scheme.endswith("planar") and not case.planar):
                continue
            resolutions = grid.dynamic[model]
            if model != "geds" and not case.has_ratios:
                resolutions = resolutions[:2]
            for resolution in resolutions:
                for corrected in _clamps(model, case):
                    raw = corrected is False
                    if raw and (scheme != grid.schemes[model][0] or resolution not in RAW_CLAMPS):
                        continue
                    steps = list_steps(model, scheme, resolution, case, grid)
                    yield [Setting(model, scheme, resolution, corrected, step) for step in steps]


def _clamps(model: str, case: Case) -> tuple[bool | None, ...]:
    corrects = find_model(model).has_clamp_correction and case.clamped
    return (True, False) if corrects else (None,)


def _steps(model: str, scheme: str, resolution: int, case: Case, grid: Grid) -> list[float]:
    """Lists steps from LARGEST_STEP down, each 1.2 to 1.5 times smaller; all halves among them.

    An undamped chain with explicit forces need not be tried above twice its limit, known from the
    highest frequency of a chain of rigid links (docs/mujoco_cable.md): `compute_largest_step`.
    """
    if model == "geds":
        return [step for step in case.steps if step >= grid.smallest_geds_step]
    parts = [2, 3, 4, 5, 6]
    while STEP_UNIT / parts[-1] > SMALLEST_STEP:
        parts.append(2 * parts[-3])
    steps = [STEP_UNIT / part for part in parts]
    return [step for step in steps if step < compute_largest_step(scheme, resolution, case)]


def compute_largest_step(scheme: str, resolution: int, case: Case) -> float:
    """Returns the step (s) above which an undamped chain with explicit forces is unstable."""
    spec = case.spec
    if scheme == "discrete" or spec.damping_time > 0.0:
        return math.inf
    segment = spec.length / resolution
    return 2.2 * segment**2 * math.sqrt(spec.linear_density / spec.bending_stiffness / 12.0)
