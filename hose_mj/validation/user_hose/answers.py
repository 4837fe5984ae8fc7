"""What a user's hose asked for: how fine each model must be, and how far its best run stays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hose_mj.validation.compare import find_cheapest
from hose_mj.validation.run import RunResult


@dataclass(frozen=True)
class Answer:
    """The cheapest setting of a model within a wanted error; Nones where no setting reached it."""

    at_error: float  # wanted, as a fraction of the length
    model: str  # its id
    planar: bool  # whether GEDS ran in a plane
    setting: str | None = None  # its label
    resolution: int | None = None  # control points or segments
    timestep: float | None = None  # s; None for a rest shape
    error: float | None = None  # reached, as a fraction of the length
    wall_s_per_sim_s: float | None = None  # wall time per simulated second; None for a rest shape


@dataclass(frozen=True)
class Disagreement:
    """The distance at which the best run of a model stays from the converged hose."""

    model: str  # its id
    clamp_corrected: bool | None  # as in `Setting`
    error: float  # largest distance as a fraction of the length
    distance: float  # the same in metres
    setting: str  # label of the run


def list_answers(
    outcomes: list[RunResult], models: Sequence[str], errors: Sequence[float]
) -> list[Answer]:
    """The cheapest setting of each model within each error; GEDS in a plane where it ran there."""
    kinds = [(model, False) for model in models]
    if any(outcome.setting.planar for outcome in outcomes):
        kinds.insert(1, ("geds", True))
    answers = []
    found: tuple[Any, ...]
    for at_error in errors:
        for model, planar in kinds:
            best, found = _choose_best(outcomes, model, at_error, planar), ()
            if best is not None:
                at = best.setting
                found = (at.label, at.resolution, at.timestep, best.error, best.wall_s_per_sim_s)
            answers.append(Answer(at_error, model, planar, *found))
    return answers


def _choose_best(
    outcomes: list[RunResult], model: str, at_error: float, planar: bool
) -> RunResult | None:
    """The cheapest run within an error; of rest shapes, whose cost says little, the coarsest."""
    if any(outcome.sim_s is not None for outcome in outcomes):
        return find_cheapest(outcomes, model, at_error, planar=planar)
    by_size = sorted(outcomes, key=lambda outcome: outcome.setting.resolution)
    found = (find_cheapest([outcome], model, at_error, planar=planar) for outcome in by_size)
    return next(filter(None, found), None)


def list_disagreements(outcomes: list[RunResult], length: float) -> list[Disagreement]:
    """The run of each model, and of each clamp, that came closest."""
    best: dict[tuple[str, bool | None], RunResult] = {}
    for outcome in outcomes:
        kind = (outcome.setting.model, outcome.setting.clamp_corrected)
        if kind not in best or outcome.error < best[kind].error:
            best[kind] = outcome
    return [
        Disagreement(model, clamp, run.error, run.error * length, run.setting.label)
        for (model, clamp), run in best.items()
    ]
