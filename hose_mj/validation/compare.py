"""The comparison: cases by models by settings, then equal-error ratios and checks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hose_mj.checks import Check
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.registry import MODELS
from hose_mj.validation.case import Case, Reference
from hose_mj.validation.run import (
    EQUAL_ERRORS,
    RunResult,
    Skipped,
    compute_reference,
    run_ladder,
    run_static,
    time_rounds,
)
from hose_mj.validation.settings import Grid, Setting, list_ladders

INEXTENSIBLE = tuple(model for model, entry in MODELS.items() if not entry.stretches)


@dataclass(frozen=True)
class Ratio:
    """What one model costs over another at equal error, each at its cheapest setting."""

    case: str  # its id
    at_error: float  # both errors are at most this
    # model, against: the two models.
    model: str
    against: str
    planar: bool  # whether `model` ran in a plane (GEDS has a path of its own for it) or in space
    wall_ratio: float  # wall time of `against` over that of `model`
    # model_setting, against_setting: labels of the settings.
    model_setting: str
    against_setting: str


@dataclass
class CaseResult:
    """All that was run in one case."""

    case: Case  # the case
    outcomes: list[RunResult] = field(default_factory=list)  # scored runs
    skipped: list[Skipped] = field(default_factory=list)  # settings left out, with reasons
    # stretchable, inextensible: converged references; None in statics.
    stretchable: Reference | None = None
    inextensible: Reference | None = None
    # Distance of MuJoCo's own Richardson limit from the inextensible reference, as a fraction of L;
    # None where the grid does not reach far enough to extrapolate.
    limit_gap: float | None = None


def run_case(
    case: Case, models: tuple[str, ...], grid: Grid, advance: Callable[[str], None]
) -> CaseResult:
    """Runs one case on a grid; `advance` is told what comes next."""
    models = tuple(model for model in models if model in case.models)
    if case.motion is None:
        advance("statics")
        return CaseResult(case, *run_static(case, models, grid))
    advance("reference")
    result = CaseResult(case)
    if "geds" in models:
        result.stretchable = compute_reference(case, grid, stretchable=True)
    if set(models) & set(INEXTENSIBLE):
        result.inextensible = compute_reference(case, grid, stretchable=False)
    for ladder in list_ladders(case, models, grid):
        advance(f"{ladder[0].model}, {ladder[0].resolution}")
        inextensible = ladder[0].model in INEXTENSIBLE
        reference = result.inextensible if inextensible else result.stretchable
        assert reference is not None
        outcomes, skipped = run_ladder(case, ladder, reference, grid)
        result.outcomes += outcomes
        result.skipped += skipped
    advance("timing")
    if case.has_ratios:
        time_rounds(case, result.outcomes, grid)
    result.limit_gap = compute_limit_gap(result)
    return result


def compute_limit_gap(result: CaseResult) -> float | None:
    """Returns the distance of MuJoCo's own limit, extrapolated in segments, from the reference.

    The hinge chain at its finest time step of the two finest resolutions that differ by a factor of
    two, with rk4; its error is of second order in the segment length.
    """
    finest: dict[int, RunResult] = {}
    for outcome in result.outcomes:
        setting = outcome.setting
        kind = (setting.model, setting.scheme)
        if kind != ("hinge-chain", "rk4") or setting.clamp_corrected is False:
            continue
        best = finest.get(setting.resolution)
        assert setting.timestep is not None
        if best is None or setting.timestep < (best.setting.timestep or 0.0):
            finest[setting.resolution] = outcome
    pairs = [(n, 2 * n) for n in finest if 2 * n in finest]
    if not pairs or result.inextensible is None or result.case.scale is None:
        return None
    coarse, fine = max(pairs)
    # With the clamp corrected h = L / (N - 1/2), else L / N.
    shift = 0.5 if finest[fine].setting.clamp_corrected else 0.0
    square = ((fine - shift) / (coarse - shift)) ** 2
    limit: Array = (square * finest[fine].values - finest[coarse].values) / (square - 1.0)
    gap = (limit - result.inextensible.values).reshape(len(limit), -1, 3)
    return float(np.max(np.linalg.norm(gap, axis=2))) / result.case.scale


def find_cheapest(
    outcomes: list[RunResult], model: str, at_error: float, *, planar: bool = False
) -> RunResult | None:
    """The cheapest run of a model with at most this error; raw clamps never count."""
    fits = [
        outcome
        for outcome in outcomes
        if outcome.setting.model == model
        and outcome.error <= at_error
        and outcome.setting.clamp_corrected is not False
        and (model != "geds" or outcome.setting.planar == planar)
    ]
    return min(fits, key=lambda outcome: outcome.wall_s, default=None)


def compute_ratios(result: CaseResult, levels: Sequence[float] = EQUAL_ERRORS) -> list[Ratio]:
    """Wall-time ratios at equal error, GEDS in space and in its plane against the others."""
    ratios: list[Ratio] = []
    if not result.case.has_ratios:
        return ratios
    others = dict.fromkeys(outcome.setting.model for outcome in result.outcomes)
    others.pop("geds", None)
    for at_error in levels:
        for planar in (False, True):
            ours = find_cheapest(result.outcomes, "geds", at_error, planar=planar)
            for against in others:
                theirs = find_cheapest(result.outcomes, against, at_error)
                if ours is None or theirs is None:
                    continue
                what = (result.case.id, at_error, "geds", against, planar)
                labels = (ours.setting.label, theirs.setting.label)
                ratios.append(Ratio(*what, theirs.wall_s / ours.wall_s, *labels))
    return ratios


def check_statics(results: list[CaseResult]) -> list[Check]:
    """The static error of GEDS: at the resolutions that a case promises, else at the finest run."""
    checks = []
    for result in results:
        ours = [o for o in result.outcomes if o.setting.model == "geds"]
        if result.case.motion is not None or not ours:
            continue
        finest = max(outcome.setting.resolution for outcome in ours)
        case_id = result.case.id
        tight = case_id in ("heavy-cantilever-gamma-1", "heavy-cantilever-gamma-10")
        promised = result.case.promised or {finest: 5e-4 if tight else 1e-3}
        for outcome in ours:
            n = outcome.setting.resolution
            if n in promised:
                name = f"{case_id}: error of GEDS with {n} control points"
                checks.append(Check(name, outcome.error, promised[n]))
    return checks


def check_motions(result: CaseResult) -> list[Check]:
    """Checks of one dynamic case: its references, and for the released rod errors and ratios."""
    checks = []
    case_id = result.case.id
    references = {"stretchable": result.stretchable, "inextensible": result.inextensible}
    if result.case.reference is not None:
        references = {"quasi-static": result.stretchable or result.inextensible}
    for name, reference in references.items():
        if reference is not None:
            text = f"{case_id}: two resolutions of the {name} reference differ by (of L)"
            checks.append(Check(text, reference.uncertainty, result.case.uncertainty))
    if result.limit_gap is not None:
        text = f"{case_id}: MuJoCo's Richardson limit differs from the reference by (of L)"
        checks.append(Check(text, result.limit_gap, 1e-3))
    ours = [o for o in result.outcomes if o.setting.model == "geds"]
    if result.case.promise is not None and ours:
        finest = max(outcome.setting.resolution for outcome in ours)
        error = min(outcome.error for outcome in ours if outcome.setting.resolution == finest)
        text = f"{case_id}: error of GEDS with {finest} control points (of L)"
        checks.append(Check(text, error, result.case.promise))
    if case_id == "released-rod":
        checks += _check_released_rod(result)
    return checks


_PROMISED = {
    ("cable", 0.01): 15.0,
    ("cable", 0.001): 150.0,
    ("hinge-chain", 0.01): 4.0,
    ("hinge-chain", 0.001): 15.0,
}
"""How many times cheaper GEDS is to be at equal error on the released rod; of flex, no promise."""


def _check_released_rod(result: CaseResult) -> list[Check]:
    checks = []
    for points, step, limit in ((8, 0.005, 0.01), (12, 0.0025, 0.0015)):
        wanted = Setting("geds", "bdf2", points, None, step)
        text = f"released-rod: tip error, {points} control points at {1e3 * step:g} ms (of L)"
        checks += [Check(text, o.error, limit) for o in result.outcomes if o.setting == wanted]
    for ratio in compute_ratios(result):
        # Like against like: the cable moves in space, the hinge chain in a plane.
        promised = _PROMISED.get((ratio.against, ratio.at_error))
        if promised is not None and ratio.planar == (ratio.against == "hinge-chain"):
            level = f"{100 * ratio.at_error:g} % error"
            text = f"released-rod: {ratio.against} over GEDS, wall time at {level}"
            checks.append(Check(text, ratio.wall_ratio, promised, ">="))
    return checks
