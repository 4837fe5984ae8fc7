"""Runs cases: statics in one go, motions down ladders of time steps, timed in rounds."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hose_mj.errors import StepError
from hose_mj.hoses.health import Health
from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.validation.case import STIFFENING, Case, Motion, Reference
from hose_mj.validation.settings import MOST_UNSTABLE, STAGNATION, Grid, Setting, list_static

LOST = 0.5
"""A chain's error above this fraction counts as unstable even where no number overflowed, but in
cases where models are expected to differ."""
EQUAL_ERRORS = (0.01, 0.001)  # errors at which costs are compared
N_CONTENDERS = 2  # runs of each model that are timed again at each of these errors
REFERENCE_POINTS = 48  # control points of the references of the cases
BUDGET_SPENT = "the budget was spent"  # the reason of a run that did not start any more
N_DRAWN, N_DRAWN_IN_SPACE = 41, 601
"""Points along the hose that are kept for pictures; a coil needs more."""


@dataclass
class RunResult:
    """The result of one setting in one case."""

    case: str  # its id
    setting: Setting  # how it was run
    error: float  # largest error as a fraction (of the reference value or of the hose's length)
    reference: str  # "closed form" or "converged"
    # Least wall time of the whole run, moving of holds included, reading excluded (s).
    wall_s: float
    sim_s: float | None  # simulated time (s); None in statics
    fallbacks: int  # of the solver
    times: Array = field(repr=False)  # sampled instants (k,)
    # Centre lines at those instants, (k, N_DRAWN or N_DRAWN_IN_SPACE, 3).
    points: Array = field(repr=False)
    values: Array = field(repr=False)  # the probe at those instants, (k, q)
    health: Health | None = None  # of a geds hose in a motion

    @property
    def wall_s_per_sim_s(self) -> float | None:
        """Wall time per simulated second; None in statics."""
        return None if self.sim_s is None else self.wall_s / self.sim_s

    def to_record(self) -> dict[str, object]:
        """The record of docs/documents.md."""
        return {
            "case": self.case,
            "model": self.setting.model,
            "scheme": self.setting.scheme,
            "resolution": self.setting.resolution,
            "timestep": self.setting.timestep,
            "error": self.error,
            "reference": self.reference,
            "clamp_corrected": self.setting.clamp_corrected,
            "wall_s_per_sim_s": self.wall_s_per_sim_s,
            "wall_s": self.wall_s,
            "fallbacks": self.fallbacks,
        }


@dataclass(frozen=True)
class Skipped:
    """A setting that was not scored, and why: unstable, or too long for the grid's budget."""

    case: str
    setting: Setting
    why: str

    def to_record(self) -> dict[str, object]:
        """The record of docs/documents.md."""
        return {"case": self.case, "setting": self.setting.label, "why": self.why}


def run_static(
    case: Case, models: tuple[str, ...], grid: Grid
) -> tuple[list[RunResult], list[Skipped]]:
    """Runs a static case with every setting of the grid; skips where no equilibrium was found."""
    outcomes: list[RunResult] = []
    skipped: list[Skipped] = []
    for setting in list_static(case, models, grid):
        try:
            outcomes.append(score_static(case, setting))
        except StepError as failure:
            skipped.append(Skipped(case.id, setting, str(failure)))
    return outcomes, skipped


def score_static(case: Case, setting: Setting, reference: Reference | None = None) -> RunResult:
    """One equilibrium, against its closed form or, where that is given, a converged reference.

    Raises:
        StepError: no equilibrium was found.
    """
    hose = setting.make(case)
    case.lay(hose)
    start = time.perf_counter()
    values = case.probe(hose)
    wall = time.perf_counter() - start
    if reference is None:
        assert case.truth is not None
        truth = case.truth()
        error = float(np.max(np.abs(values - truth) / (case.scale or np.abs(truth))))
    else:
        assert case.scale is not None
        error = compute_distance(values[None], reference.values) / case.scale
    kind = "closed form" if reference is None else "converged"
    seen = (np.zeros(1), hose.position(_drawn(case))[None], values[None])
    return RunResult(case.id, setting, error, kind, wall, None, _count_fallbacks(hose), *seen)


def simulate(case: Case, hose: HoseModel) -> tuple[Array, Array, Array, float]:
    """Lays a hose, lets it move; returns times (k,), probe (k, q), points (k, m, 3), wall (s).

    Raises:
        StepError: a step that fails.
    """
    assert case.motion is not None
    motion = case.motion
    holds = case.lay(hose)
    drawn = _drawn(case)
    pause = motion.pause
    n_steps = round(pause / hose.timestep)
    times, values, points = [0.0], [case.probe(hose)], [hose.position(drawn)]
    wall = 0.0
    for sample in range(1, motion.n_samples + 1):
        wall += _advance(motion, hose, holds, (sample - 1) * n_steps, n_steps)
        times.append(sample * pause)
        values.append(case.probe(hose))
        points.append(hose.position(drawn))
    return np.array(times), np.array(values), np.array(points), wall


def compute_reference(
    case: Case, grid: Grid, *, stretchable: bool, points: int = REFERENCE_POINTS
) -> Reference:
    """A motion's own reference, or its converged limit: GEDS, fine in n, extrapolated in the step.

    Args:
        case: a dynamic case.
        grid: says how fine in time.
        stretchable: False for the limit of inextensible models (EA times STIFFENING).
        points: control points; the uncertainty is the distance from three quarters of them.
    """
    motion = case.motion
    assert motion is not None
    if case.reference is not None:
        return case.reference()
    if not stretchable:
        case = stiffen(case)
    scheme = "bdf2, planar" if case.planar else "bdf2"

    def extrapolate(n: int, parts: int) -> Array:
        runs = []
        for k in (parts, 2 * parts):
            setting = Setting("geds", scheme, n, None, motion.pause / k)
            runs.append(simulate(case, setting.make(case, tolerance=1e-7))[1])
        return np.asarray((4.0 * runs[1] - runs[0]) / 3.0)

    # Damped motions are smooth in time; the free ones ring.
    parts = grid.reference_steps[case.spec.damping_time > 0.0] // 2
    fine = extrapolate(points, parts)
    coarse = extrapolate(3 * points // 4, parts // 2)
    assert case.scale is not None
    return Reference(fine, compute_distance(fine, coarse) / case.scale)


def stiffen(case: Case) -> Case:
    """The case of a hose that hardly stretches, for the limit of inextensible models."""
    stiff = STIFFENING * case.spec.axial_stiffness
    return replace(case, spec=replace(case.spec, axial_stiffness=stiff))


def run_ladder(
    case: Case, ladder: list[Setting], reference: Reference, grid: Grid, until: float = math.inf
) -> tuple[list[RunResult], list[Skipped]]:
    """Runs one model and resolution down its time steps, from the largest stable one on.

    No run starts after `until`, a reading of `time.perf_counter`.
    """
    outcomes: list[RunResult] = []
    skipped: list[Skipped] = []
    for setting in ladder:
        if setting.model != "geds" and outcomes:
            flex = setting.model == "flex"
            most = grid.longest_flex_ladder if flex else grid.longest_ladder
            last_two = [outcome.error for outcome in outcomes[-2:]]
            stagnates = len(last_two) == 2 and last_two[1] > (1.0 - STAGNATION) * last_two[0]
            if stagnates or len(outcomes) == most:
                break
            last = outcomes[-1].setting.timestep
            assert setting.timestep is not None
            assert last is not None
            if setting.timestep > 0.51 * last:
                continue
        if time.perf_counter() > until:
            skipped.append(Skipped(case.id, setting, BUDGET_SPENT))
            break
        why = _foresee(case, setting, grid)
        outcome = None
        if why is None:
            outcome = _score(case, setting, reference)
            why = "unstable" if outcome is None else None
        if why is not None:
            skipped.append(Skipped(case.id, setting, why))
            if why != "unstable" or (not outcomes and len(skipped) == MOST_UNSTABLE):
                break
        if outcome is not None:
            outcomes.append(outcome)
    return outcomes, skipped


def _score(case: Case, setting: Setting, reference: Reference) -> RunResult | None:
    """One run against the reference; None where it was unstable."""
    assert case.motion is not None
    assert case.scale is not None
    hose = setting.make(case)
    try:
        times, values, points, wall = simulate(case, hose)
    except StepError:
        return None
    error = compute_distance(values, reference.values) / case.scale
    may_be_far = setting.model == "geds" or not case.has_ratios
    if not (error < LOST or (may_be_far and np.isfinite(error))):
        return None
    took = (wall, case.motion.duration, _count_fallbacks(hose))
    result = RunResult(case.id, setting, error, "converged", *took, times, points, values)
    result.health = getattr(hose, "health", None)
    return result


def _foresee(case: Case, setting: Setting, grid: Grid) -> str | None:
    """A reason to leave a run out, from the pace of its first hundredth; None to run it."""
    assert case.motion is not None
    hose = setting.make(case)
    case.lay(hose)
    n_steps = max(1, round(0.01 * case.motion.duration / hose.timestep))
    start = time.perf_counter()
    try:
        hose.step(n_steps)
    except StepError:
        return "unstable"
    whole = (time.perf_counter() - start) * case.motion.duration / (n_steps * hose.timestep)
    return f"would take {whole:.0f} s" if whole > grid.longest_run else None


def time_rounds(
    case: Case,
    outcomes: list[RunResult],
    grid: Grid,
    levels: Sequence[float] = EQUAL_ERRORS,
    until: float = math.inf,
) -> None:
    """Times the runs that could be cheapest again, unread, all models in turn; the least counts.

    No run starts after `until`, a reading of `time.perf_counter`.
    """
    contenders: dict[int, RunResult] = {}
    for kind in dict.fromkeys(map(_kind, outcomes)):
        for at_error in levels:
            fits = [o for o in outcomes if _kind(o) == kind and o.error <= at_error]
            fits.sort(key=lambda outcome: outcome.wall_s)
            contenders |= {id(outcome): outcome for outcome in fits[:N_CONTENDERS]}
    for _ in range(grid.rounds):
        for outcome in contenders.values():
            if outcome.wall_s < grid.longest_timed_run and time.perf_counter() < until:
                outcome.wall_s = min(outcome.wall_s, time_run(case, outcome.setting.make(case)))


def _kind(outcome: RunResult) -> tuple[str, bool, bool]:
    setting = outcome.setting
    return setting.model, setting.planar, setting.clamp_corrected is False


def time_run(case: Case, hose: HoseModel) -> float:
    """Returns the wall time of a case's motion when nobody reads off anything (s)."""
    assert case.motion is not None
    holds = case.lay(hose)
    n_steps = round(case.motion.duration / hose.timestep)
    return _advance(case.motion, hose, holds, 0, n_steps)


def _advance(motion: Motion, hose: HoseModel, holds: list[Hold], begun: int, n_steps: int) -> float:
    """Takes n_steps steps after the `begun` first, holds moved; returns the wall time (s)."""
    start = time.perf_counter()
    if motion.drive is None:
        hose.step(n_steps)
    else:
        for step in range(begun + 1, begun + n_steps + 1):
            motion.drive(hose, holds, step * hose.timestep)
            hose.step(1)
    return time.perf_counter() - start


def _drawn(case: Case) -> Array:
    n_drawn = N_DRAWN if case.planar else N_DRAWN_IN_SPACE
    return np.linspace(0.0, case.spec.length, n_drawn)


def _count_fallbacks(hose: HoseModel) -> int:
    return int(getattr(hose, "fallbacks", 0))


def compute_distance(values: Array, reference: Array) -> float:
    """Largest distance between two motions' points, (k, 3 p) each (m)."""
    gap = (values - reference).reshape(len(values), -1, 3)
    return float(np.max(np.linalg.norm(gap, axis=2)))
