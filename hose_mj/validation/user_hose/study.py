"""Runs a user's hose within a budget: how far the models disagree, how fine each must be."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from hose_mj.checks import Check
from hose_mj.errors import InputError, StepError
from hose_mj.hoses.registry import MODELS, find_model, make_hose
from hose_mj.scenes.hose_file.hose_file import UserHose
from hose_mj.validation.case import Case, Reference
from hose_mj.validation.compare import CaseResult
from hose_mj.validation.run import (
    BUDGET_SPENT,
    REFERENCE_POINTS,
    RunResult,
    Skipped,
    compute_distance,
    compute_reference,
    run_ladder,
    score_static,
    stiffen,
    time_rounds,
)
from hose_mj.validation.settings import (
    LARGEST_STEP,
    SMALLEST_STEP,
    Grid,
    Setting,
    compute_largest_step,
    has_cable,
    list_ladders,
    list_static,
)
from hose_mj.validation.user_hose.answers import (
    Answer,
    Disagreement,
    list_answers,
    list_disagreements,
)
from hose_mj.validation.user_hose.case import (
    CASE_ID,
    compute_fineness,
    make_case,
    make_obstacles,
    starts_at_rest,
)

KNOWN_MODELS = ("geds", "cable", "flex")
"""Models that a user's hose is compared with, those of them that there are."""
REFERENCE_STEP = 2e-3  # the first reference takes steps of about this length (s)
MOST_REFERENCE_POINTS = 192  # times `compute_fineness`
_TIGHTER = 5.0
"""A reference is to be this many times closer to its limit than the smallest wanted error."""
_SHARE_OF_REFERENCE, _SHARE_OF_RUN = 0.3, 0.08
"""Of the budget: for the references, and for a single run."""
_GROWTH = 8.0  # a rest shape takes a chain of twice as many segments about so many times as long
_EXTRA = 0.1  # of the budget: what timing may take beyond it
_ENOUGH = 2  # resolutions within the smallest wanted error, after which finer ones are left out
FEWEST_SEGMENTS = 10  # the coarsest chain that is run
_SOME_SPIN = 1e-3  # a spin that tells whether a model's clamps turn (rad)
GRID = Grid(
    static={"geds": (8, 12, 16, 24, 32), "cable": (10, 20, 40), "flex": (10, 20, 40)},
    dynamic={"geds": (8, 12, 16, 24, 32), "cable": (10, 20, 40, 80), "flex": (10, 20, 40, 80)},
    schemes={"geds": ("bdf2", "bdf2, planar"), "cable": ("euler", "rk4"), "flex": ("discrete",)},
    smallest_geds_step=5e-4,
    longest_ladder=4,
    longest_flex_ladder=4,
    longest_run=math.inf,
    longest_timed_run=0.5,
    rounds=2,
    reference_steps=(0, 0),
)
"""Of a user's hose; the longest run and the reference's steps depend on budget and motion.

GEDS's control points are these times `compute_fineness`.
"""


@dataclass
class UserHoseStudy:
    """The findings about a user's hose."""

    hose: UserHose  # what the file says
    result: CaseResult  # all runs, against the hose as it is (`stretchable`)
    # Largest distance between the hose as it is and one that does not stretch, as a fraction of the
    # length: what no inextensible model can get below; None without one.
    stretch: float | None = None
    refused: dict[str, str] = field(default_factory=dict)  # why a model did not run, by model
    answers: list[Answer] = field(default_factory=list)  # by wanted error and model
    # By model, and by clamp for the chains.
    disagreements: list[Disagreement] = field(default_factory=list)

    @property
    def cut_short(self) -> set[str]:
        """Models with settings that the budget left out."""
        return {s.setting.model for s in self.result.skipped if s.why == BUDGET_SPENT}

    @property
    def checks(self) -> list[Check]:
        """That the reference is good enough to judge the smallest wanted error."""
        assert self.result.stretchable is not None
        text = f"{CASE_ID}: two resolutions of the reference differ by (of L)"
        return [Check(text, self.result.stretchable.uncertainty, min(self.hose.errors) / 2.0)]

    def to_results(self) -> dict[str, list[dict[str, object]]]:
        """The entries of the document (docs/documents.md) beside those of every comparison."""
        return {
            "answers": [asdict(answer) for answer in self.answers],
            "disagreements": [asdict(gap) for gap in self.disagreements],
        }


def list_models() -> tuple[str, ...]:
    """Returns the models that can be asked for: without the cable where MuJoCo has none."""
    return tuple(m for m in KNOWN_MODELS if m in MODELS and (m != "cable" or has_cable()))


def check_models(models: Sequence[str]) -> tuple[str, ...]:
    """Returns the models to run, each once.

    Raises:
        InputError: a model that a user's hose is not compared with, or none.
    """
    known = list_models()
    for model in models:
        if model not in known:
            raise InputError("model", model, f"for a hose of your own {', '.join(known)}")
    if not models:
        raise InputError("models", models, f"one or more of {', '.join(known)}")
    return tuple(dict.fromkeys(models))


def run_user_hose_study(
    user: UserHose, models: Sequence[str], advance: Callable[[str], None]
) -> UserHoseStudy:
    """Compares the models on a user's hose within about its budget.

    Raises:
        InputError: GEDS, the reference, cannot run this hose.
        StepError: GEDS found no rest shape, or could not finish the motion.
    """
    check_supported(user, "geds")
    case = make_case(user)
    study = UserHoseStudy(user, CaseResult(case))
    for model in models:
        try:
            check_supported(user, model)
        except InputError as error:
            study.refused[model] = str(error)
    running = tuple(model for model in models if model not in study.refused)
    advance("compiling")
    _compile(case, make_grid(user))
    deadline = time.perf_counter() + user.budget
    _find_references(study, running, advance)
    if case.motion is None:
        _run_statics(study, running, deadline, advance)
    else:
        _run_motion(study, running, deadline, advance)
    study.answers = list_answers(study.result.outcomes, running, user.errors)
    study.disagreements = list_disagreements(study.result.outcomes, user.spec.length)
    return study


def _compile(case: Case, grid: Grid) -> None:
    """Lays and moves small hoses once, so that compilation is no part of budget and timings."""
    for scheme in ("bdf2", "bdf2, planar")[: 1 + case.planar]:
        hose = Setting("geds", scheme, grid.dynamic["geds"][-1], None, SMALLEST_STEP).make(case)
        holds = case.lay(hose)
        if case.motion is None:
            case.probe(hose)
            return
        if case.motion.drive is not None:
            case.motion.drive(hose, holds, SMALLEST_STEP)
        hose.step(1)


def _find_references(
    study: UserHoseStudy, models: tuple[str, ...], advance: Callable[[str], None]
) -> None:
    """The hose as it is, finer until it is good enough; then one that does not stretch."""
    user, case = study.hose, study.result.case
    goal = min(user.errors) / _TIGHTER
    until = time.perf_counter() + user.budget * _SHARE_OF_REFERENCE
    fineness = compute_fineness(user)
    points, level = fineness * REFERENCE_POINTS * (2 if case.motion is None else 1), 0
    n_references = 2 if set(models) - {"geds"} else 1
    while True:
        advance(f"reference, {points} control points")
        begun = time.perf_counter()
        reference = _compute_limit(case, points, level, stretchable=True)
        now = time.perf_counter()
        study.result.stretchable = reference
        # The next one has twice the points and half the steps.
        if reference.uncertainty <= goal or 2 * points > fineness * MOST_REFERENCE_POINTS:
            break
        if now + 4.0 * n_references * (now - begun) > until:
            break
        points, level = 2 * points, level + 1
    if n_references == 2:
        advance("reference that does not stretch")
        study.result.inextensible = _compute_limit(case, points, level, stretchable=False)
        gap = compute_distance(reference.values, study.result.inextensible.values)
        study.stretch = gap / user.spec.length


def _compute_limit(case: Case, points: int, level: int, *, stretchable: bool) -> Reference:
    if case.motion is not None:
        parts = count_parts(case.motion.pause, REFERENCE_STEP)
        steps = 4 * parts * 2**level
        grid = replace(GRID, reference_steps=(steps, steps))
        return compute_reference(case, grid, stretchable=stretchable, points=points)
    if not stretchable:
        case = stiffen(case)
    shapes = []
    for n in (points, 3 * points // 4):
        hose = Setting("geds", "statics", n).make(case)
        case.lay(hose)
        shapes.append(case.probe(hose)[None])
    assert case.scale is not None
    return Reference(shapes[0], compute_distance(*shapes) / case.scale)


def _run_statics(
    study: UserHoseStudy, models: tuple[str, ...], deadline: float, advance: Callable[[str], None]
) -> None:
    """Coarse resolutions first; one that would take longer than is left goes by its coarser one."""
    case, result, grid = study.result.case, study.result, make_grid(study.hose)
    took: dict[tuple[str, bool | None], float] = {}
    for setting in sorted(list_static(case, models, grid), key=lambda s: _rank(s, grid.static)):
        kind = (setting.model, setting.clamp_corrected)
        begun = time.perf_counter()
        if begun + _GROWTH * took.get(kind, 0.0) > deadline:
            result.skipped.append(Skipped(CASE_ID, setting, BUDGET_SPENT))
            continue
        advance(setting.label)
        try:
            result.outcomes.append(score_static(case, setting, result.stretchable))
        except (InputError, StepError) as error:
            result.skipped.append(Skipped(CASE_ID, setting, str(error)))
        took[kind] = time.perf_counter() - begun


def _run_motion(
    study: UserHoseStudy, models: tuple[str, ...], deadline: float, advance: Callable[[str], None]
) -> None:
    """Coarse resolutions of all models first, so that a spent budget leaves out the finest."""
    user, result = study.hose, study.result
    assert result.stretchable is not None
    grid = replace(make_grid(user), longest_run=user.budget * _SHARE_OF_RUN)
    ladders = list(list_ladders(result.case, models, grid, list_halving_steps))
    ladders.sort(key=lambda ladder: _rank(ladder[0], grid.dynamic))
    fastest = max((spin.fastest for hold in user.holds for spin in hold.spins), default=0.0)
    for whole in ladders:
        # A chain's clamp turns by less than half in a step: see `HoseModel.move`.
        ladder = [s for s in whole if s.model == "geds" or fastest * (s.timestep or 0.0) < math.pi]
        if not ladder:
            why = "a clamp turns by half and more in a step"
            result.skipped.append(Skipped(CASE_ID, whole[-1], why))
            continue
        setting = ladder[0]
        advance(f"{setting.model}, {setting.resolution}")
        if _count_enough(result.outcomes, setting, min(user.errors)) >= _ENOUGH:
            why = "coarser ones are within the smallest wanted error"
            result.skipped.append(Skipped(CASE_ID, setting, why))
            continue
        try:
            setting.make(result.case)
        except InputError as error:  # segments too light for MuJoCo
            result.skipped.append(Skipped(CASE_ID, setting, str(error)))
            continue
        outcomes, skipped = run_ladder(result.case, ladder, result.stretchable, grid, deadline)
        result.outcomes += outcomes
        result.skipped += skipped
    advance("timing")
    time_rounds(result.case, result.outcomes, grid, user.errors, deadline + _EXTRA * user.budget)


def _rank(setting: Setting, resolutions: Mapping[str, tuple[int, ...]]) -> tuple[bool, int]:
    """Raw clamps last; else by resolution, with GEDS, which all are held against, one ahead."""
    place = resolutions[setting.model].index(setting.resolution)
    return setting.clamp_corrected is False, place - (setting.model == "geds")


def _count_enough(outcomes: list[RunResult], like: Setting, error: float) -> int:
    """Resolutions of one model, scheme and clamp that are within an error."""
    within = [outcome.setting for outcome in outcomes if outcome.error <= error]
    kind = (like.model, like.scheme, like.clamp_corrected)
    found = {s.resolution for s in within if (s.model, s.scheme, s.clamp_corrected) == kind}
    return len(found)


def make_grid(user: UserHose) -> Grid:
    """The settings for a hose: GEDS's control points grow with the turns of a coil."""

    def refine(resolutions: Mapping[str, tuple[int, ...]]) -> dict[str, tuple[int, ...]]:
        geds = tuple(compute_fineness(user) * points for points in resolutions["geds"])
        return {**resolutions, "geds": geds}

    return replace(GRID, static=refine(GRID.static), dynamic=refine(GRID.dynamic))


def list_halving_steps(
    model: str, scheme: str, resolution: int, case: Case, grid: Grid
) -> list[float]:
    """Time steps (s) that divide the pause between samples, each half of the one before."""
    assert case.motion is not None
    pause = case.motion.pause
    first = pause / count_parts(pause, LARGEST_STEP)
    least, most = grid.smallest_geds_step, math.inf
    if model != "geds":
        least, most = SMALLEST_STEP, compute_largest_step(scheme, resolution, case)
    count = max(1, math.floor(math.log2(first / least)) + 1)
    steps = [first / 2**k for k in range(count)]
    return [step for step in steps if step < most] or steps[-1:]


def count_parts(pause: float, longest: float) -> int:
    """The power of two, 2 at least, that cuts a pause into steps no longer than `longest` (s)."""
    return int(2 ** max(1, math.ceil(math.log2(pause / longest) - 1e-9)))


def check_supported(user: UserHose, model: str) -> None:
    """Checks that a model can run this hose.

    Raises:
        InputError: it cannot; the message says what of the file it cannot have.
    """
    options: dict[str, Any] = {} if model == "geds" else {"segments": FEWEST_SEGMENTS}
    if user.floor is not None:
        if not find_model(model).contact:
            raise InputError("floor", user.floor.height, f"left out: {model} touches nothing")
        if model != "geds" and starts_at_rest(user):
            valid = "left out: only geds finds a rest shape on it; "
            valid += f"{model} runs with study.start = 'as-laid'"
            raise InputError("floor", user.floor.height, valid)
        options["obstacles"] = make_obstacles(user)
    try:
        hose = make_hose(model, user.spec, gravity=user.gravity, timestep=1e-3, **options)
    except InputError as error:
        valid = f"for {model} {error.valid}"
        raise InputError(f"hose.{error.thing}", error.value, valid) from error
    if user.spins:
        try:
            hose.move(hose.clamp(0.0), spin=_SOME_SPIN)
        except InputError as error:
            valid = f"left out: {model} takes {error.valid}"
            raise InputError("spin", "given", valid) from error
