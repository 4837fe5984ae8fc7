"""Gathers what `hose-mj compare` runs: the cases, and GEDS's own numerics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hose_mj.checks import Check
from hose_mj.validation import flex_checks, numerics, twist_checks
from hose_mj.validation.case import Case
from hose_mj.validation.compare import (
    CaseResult,
    Ratio,
    check_motions,
    check_statics,
    compute_ratios,
    run_case,
)
from hose_mj.validation.run import Outcome, Skipped
from hose_mj.validation.settings import FULL, QUICK
from hose_mj.validation.user_hose.case import CASE_ID
from hose_mj.validation.user_hose.study import OwnStudy

SHOWN_WITHIN = 0.01
"""Pictures of a case show the cheapest run of each model within this error."""
N_RANDOM_STATES = 100_000
N_RANDOM_STATES_QUICK = 500


@dataclass
class Study:
    """Everything that was measured.

    Attributes:
        results: one per case.
        checks: of the cases, then of the numerics.
        ratios: at equal error.
        curves: convergence plots by title.
        energy: times (s) and energy over its start of the ten-second swing; None if not run.
        quick: whether the small grid was used.
        own: what was found about a user's own hose, whose runs are the one result; None without.
    """

    results: list[CaseResult] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    ratios: list[Ratio] = field(default_factory=list)
    curves: dict[str, numerics.Curves] = field(default_factory=dict)
    energy: tuple[list[float], list[float]] | None = None
    quick: bool = False
    own: OwnStudy | None = None

    @property
    def shown_within(self) -> float:
        """The error within which pictures show the cheapest runs; 0 for the closest ones."""
        return SHOWN_WITHIN if self.own is None else 0.0

    @property
    def outcomes(self) -> list[Outcome]:
        """All scored runs."""
        return [outcome for result in self.results for outcome in result.outcomes]

    @property
    def skipped(self) -> list[Skipped]:
        """All settings that were not scored."""
        return [item for result in self.results for item in result.skipped]

    def list_skipped(self) -> list[dict[str, object]]:
        """Records of all that was not scored, models that refused a user's hose first."""
        refused = {} if self.own is None else self.own.refused
        models: list[dict[str, object]] = [
            {"case": CASE_ID, "setting": model, "why": why} for model, why in refused.items()
        ]
        return [*models, *(item.to_record() for item in self.skipped)]


def run_study(
    cases: tuple[Case, ...],
    models: tuple[str, ...],
    *,
    quick: bool,
    seed: int,
    with_numerics: bool,
    advance: Callable[[str], None],
) -> Study:
    """Runs the cases and, if wanted, the numerics; `advance` is told what comes next."""
    study = Study(quick=quick)
    grid = QUICK if quick else FULL
    for place, case in enumerate(cases):
        head = f"{place + 1}/{len(cases)} {case.id}"
        study.results.append(
            run_case(case, models, grid, lambda text, head=head: advance(f"{head}: {text}"))  # type: ignore[misc]
        )
    study.checks += check_statics(study.results)
    for result in study.results:
        if result.case.motion is not None:
            study.checks += check_motions(result)
            study.ratios += compute_ratios(result)
    if "flex" in models and any(case.id == flex_checks.CASE for case in cases):
        advance("stretch of the flex rod")
        study.checks += flex_checks.check_flex_stretch()
    if with_numerics:
        _run_numerics(study, np.random.default_rng(seed), advance)
    return study


def _run_numerics(study: Study, rng: np.random.Generator, advance: Callable[[str], None]) -> None:
    for title, measure in (
        ("Error of the frequencies over the span length", numerics.check_frequency_order),
        ("Error of the swing over the span length", numerics.check_swing_order),
        ("Error over the time step", numerics.check_time_order),
        ("Wall time of a step over the control points", numerics.check_cost),
        ("Wall time of a step with twist", twist_checks.check_twist_cost),
    ):
        advance(title)
        checks, study.curves[title] = measure()
        study.checks += checks
    advance("momenta")
    study.checks += numerics.check_momenta()
    advance("energy")
    checks, study.energy = numerics.check_energy()
    study.checks += checks
    advance("twist")
    study.checks += twist_checks.check_turns()
    study.checks += twist_checks.check_precession()
    study.checks += twist_checks.check_agreement()
    advance("suture thread")
    study.checks += numerics.check_suture()
    wanted = N_RANDOM_STATES_QUICK if study.quick else N_RANDOM_STATES
    done = 0

    def count(more: int) -> None:
        nonlocal done
        done += more
        advance(f"random states {done}/{wanted}")

    study.checks += numerics.check_random_states(wanted, rng, count)
