"""Gathers what `hose-mj compare` runs: the cases, and GEDS's own numerics; or a user's hose."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from hose_mj.assets import find_asset
from hose_mj.checks import Check
from hose_mj.scenes.hose_file.hose_file import UserHose
from hose_mj.validation import numerics
from hose_mj.validation.case import Case
from hose_mj.validation.compare import (
    CaseResult,
    Ratio,
    check_motions,
    check_statics,
    compute_ratios,
    run_case,
)
from hose_mj.validation.run import RunResult, Skipped
from hose_mj.validation.settings import FULL, QUICK
from hose_mj.validation.trial import Findings, Trial
from hose_mj.validation.user_hose.case import CASE_ID
from hose_mj.validation.user_hose.study import UserHoseStudy, run_user_hose_study

SHOWN_WITHIN = 0.01  # pictures of a case show the cheapest run of each model within this error
N_RANDOM_STATES = 100_000
N_RANDOM_STATES_QUICK = 500


@dataclass(frozen=True)
class CommittedRuns:
    """Runs of MuJoCo's cable from a version that had it, for those that have none."""

    mujoco: str  # the version that they ran with
    cpu: str  # of the machine that took the wall times
    here: str  # the version of MuJoCo that is installed
    # As in the document of `compare` (docs/documents.md), marked by a key `committed`.
    records: list[dict[str, Any]]

    def summarize(self) -> list[tuple[str, str, str]]:
        """Returns a row for each case: its id, how many runs, their smallest error."""
        errors: dict[str, list[float]] = {}
        for record in self.records:
            errors.setdefault(record["case"], []).append(record["error"])
        return [(c, str(len(found)), f"{100 * min(found):.2g} %") for c, found in errors.items()]


@dataclass
class Study:
    """Everything that was measured."""

    results: list[CaseResult] = field(default_factory=list)  # one per case
    checks: list[Check] = field(default_factory=list)  # of the cases, then of the numerics
    ratios: list[Ratio] = field(default_factory=list)  # at equal error
    curves: dict[str, numerics.Curves] = field(default_factory=dict)  # convergence plots by title
    findings: dict[str, Findings] = field(default_factory=dict)  # of the trials by id
    # Times (s) and energy over its start of the ten-second swing; None if not run.
    energy: tuple[list[float], list[float]] | None = None
    quick: bool = False  # whether the small grid was used
    # What was found about a user's hose, whose runs are the one result; None without.
    user: UserHoseStudy | None = None
    # What stands in for MuJoCo's cable; None where it runs, or was not asked for.
    committed: CommittedRuns | None = None

    @property
    def shown_within(self) -> float:
        """The error within which pictures show the cheapest runs; 0 for the closest ones."""
        return SHOWN_WITHIN if self.user is None else 0.0

    @property
    def outcomes(self) -> list[RunResult]:
        """All scored runs."""
        return [outcome for result in self.results for outcome in result.outcomes]

    @property
    def skipped(self) -> list[Skipped]:
        """All settings that were not scored."""
        return [item for result in self.results for item in result.skipped]

    def list_records(self) -> list[dict[str, Any]]:
        """Records of all scored runs, then of committed ones; these are told by `committed`."""
        records = [outcome.to_record() for outcome in self.outcomes]
        if self.committed is None:
            return records
        return [*({**record, "committed": None} for record in records), *self.committed.records]

    def list_health(self) -> list[dict[str, object]]:
        """For each motion the health of the GEDS hose that came closest."""
        closest: dict[str, RunResult] = {}
        for outcome in sorted(self.outcomes, key=lambda outcome: outcome.error):
            if outcome.health is not None:
                closest.setdefault(outcome.case, outcome)
        return [
            {"case": case, "setting": one.setting.label, **one.health.summarize()}
            for case, one in closest.items()
            if one.health is not None
        ]

    def list_skipped(self) -> list[dict[str, object]]:
        """Records of all that was not scored, models that refused a user's hose first."""
        refused = {} if self.user is None else self.user.refused
        models: list[dict[str, object]] = [
            {"case": CASE_ID, "setting": model, "why": why} for model, why in refused.items()
        ]
        return [*models, *(item.to_record() for item in self.skipped)]


def read_committed_cable(cases: tuple[Case, ...]) -> CommittedRuns:
    """Reads the committed runs of MuJoCo's cable in these cases."""
    data = json.loads(find_asset("compare/cable.json").read_text(encoding="utf-8"))
    ids = {case.id for case in cases}
    mark = f"MuJoCo {data['mujoco']}"
    rows = (dict(zip(data["columns"], row, strict=True)) for row in data["rows"])
    records = [row | {"committed": mark} for row in rows if row["case"] in ids]
    return CommittedRuns(data["mujoco"], data["cpu"], version("mujoco"), records)


def study_user_hose(
    hose: UserHose, models: tuple[str, ...], advance: Callable[[str], None]
) -> Study:
    """Runs the comparison of a user's hose, as a study of one case."""
    found = run_user_hose_study(hose, models, advance)
    ratios = compute_ratios(found.result, hose.errors) if hose.duration is not None else []
    return Study(results=[found.result], checks=found.checks, ratios=ratios, user=found)


def run_study(
    cases: tuple[Case, ...],
    models: tuple[str, ...],
    trials: tuple[Trial, ...] = (),
    *,
    quick: bool,
    seed: int,
    with_numerics: bool,
    advance: Callable[[str], None],
) -> Study:
    """Runs cases, trials and, if wanted, the numerics; `advance` is told what comes next."""
    study = Study(quick=quick)
    grid = QUICK if quick else FULL
    for place, case in enumerate(cases):
        head = f"{place + 1}/{len(cases)} {case.id}"
        tell = partial(lambda head, text: advance(f"{head}: {text}"), head)
        study.results.append(run_case(case, models, grid, tell))
    study.checks += check_statics(study.results)
    for result in study.results:
        if result.case.motion is not None:
            study.checks += check_motions(result)
            study.ratios += compute_ratios(result)
    if "flex" in models and any(case.id == numerics.FLEX_CASE for case in cases):
        advance("stretch of the flex rod")
        study.checks += numerics.check_flex_stretch()
    for trial in trials:
        advance(trial.id)
        found = trial.measure(quick, np.random.default_rng(seed))
        study.findings[trial.id] = found
        study.checks += [replace(one, name=f"{trial.id}: {one.name}") for one in found.checks]
    if with_numerics:
        _run_numerics(study, np.random.default_rng(seed), advance)
    return study


def _run_numerics(study: Study, rng: np.random.Generator, advance: Callable[[str], None]) -> None:
    for title, measure in numerics.CURVES.items():
        advance(title)
        checks, study.curves[title] = measure()
        study.checks += checks
    advance("momenta")
    study.checks += numerics.check_momenta()
    advance("energy")
    checks, study.energy = numerics.check_energy()
    study.checks += checks
    for title, measure_all in numerics.CHECKS.items():
        advance(title)
        for measure_some in measure_all:
            study.checks += measure_some()
    wanted = N_RANDOM_STATES_QUICK if study.quick else N_RANDOM_STATES
    done = 0

    def count(more: int) -> None:
        nonlocal done
        done += more
        advance(f"random states {done}/{wanted}")

    study.checks += numerics.check_random_states(wanted, rng, count)
