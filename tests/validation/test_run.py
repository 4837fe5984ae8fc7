"""The logic around the runs: ladders of time steps, cheapest settings, ratios, limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hose_mj.validation.case import Reference
from hose_mj.validation.compare import (
    EQUAL_ERRORS,
    check_motions,
    check_statics,
    compute_limit_gap,
    compute_ratios,
    find_cheapest,
    run_case,
)
from hose_mj.validation.run import (
    LOST,
    compute_reference,
    run_ladder,
    run_static,
    simulate,
    time_rounds,
)
from hose_mj.validation.settings import MOST_UNSTABLE, QUICK, STAGNATION, Setting

PARTS = sorted(k * 2**power for power in range(12) for k in (2, 3, 5))
"""Time steps are 20 ms over these; all halves are among them."""
GRID = replace(QUICK, longest_ladder=20, longest_run=60.0, rounds=2)


def run(case, model, grid=GRID):
    """A ladder of a model against a reference in which nothing moves."""
    still = np.tile([1.0, 0.0, 0.0], (case.motion.n_samples + 1, 1))
    scheme, clamp = ("bdf2", None) if model == "geds" else ("euler", True)
    ladder = [Setting(model, scheme, 10, clamp, 0.02 / part) for part in PARTS]
    return ladder, *run_ladder(case, ladder, Reference(still, 0.0), grid)


def list_steps(items):
    return [pytest.approx(item.setting.timestep) for item in items]


def test_a_chain_is_halved_from_its_largest_stable_step_until_that_gains_little(case, fake):
    fake.stable = 0.0045
    errors = {0.004: 0.1, 0.002: 0.05, 0.001: 0.05 * (1.0 - 0.9 * STAGNATION)}
    fake.error = staticmethod(lambda step, n: errors[round(step, 9)])
    ladder, outcomes, skipped = run(case, "cable")
    assert list_steps(outcomes) == [0.004, 0.002, 0.001]
    assert [outcome.error for outcome in outcomes] == pytest.approx(list(errors.values()))
    assert list_steps(skipped) == [setting.timestep for setting in ladder[: len(skipped)]]
    assert all(item.setting.timestep > fake.stable for item in skipped)
    assert {item.why for item in skipped} == {"unstable"}


def test_a_chain_goes_on_while_halving_helps(case, fake):
    fake.error = staticmethod(lambda step, n: 10.0 * step**2 + 1e-4)
    ladder, outcomes, skipped = run(case, "cable")
    assert not skipped
    steps = [outcome.setting.timestep for outcome in outcomes]
    assert steps[0] == ladder[0].timestep
    np.testing.assert_allclose(steps[:-1], 2.0 * np.array(steps[1:]))
    errors = np.array([outcome.error for outcome in outcomes])
    gains = 1.0 - errors[1:] / errors[:-1]
    assert np.all(gains[:-1] >= STAGNATION)
    assert gains[-1] < STAGNATION


def test_a_ladder_is_no_longer_than_its_grid_allows(case, fake):
    fake.error = staticmethod(lambda step, n: 10.0 * step**2)
    _, outcomes, _ = run(case, "cable", replace(GRID, longest_ladder=3))
    assert len(outcomes) == 3


def test_a_chain_that_is_far_off_counts_as_unstable(case, fake):
    fake.error = staticmethod(lambda step, n: 2.0 * LOST if step > 0.006 else 0.01)
    _, outcomes, skipped = run(case, "hinge-chain")
    assert all(item.setting.timestep > 0.006 for item in skipped)
    assert {item.why for item in skipped} == {"unstable"}
    assert max(outcome.error for outcome in outcomes) == pytest.approx(0.01)


def test_a_chain_that_stays_unstable_is_given_up(case, fake):
    fake.stable = 0.0
    ladder, outcomes, skipped = run(case, "cable")
    assert not outcomes
    assert [item.setting for item in skipped] == ladder[:MOST_UNSTABLE]


def test_a_position_that_is_not_a_number_is_no_outcome(case, fake):
    fake.error = staticmethod(lambda step, n: np.nan)
    _, outcomes, skipped = run(case, "cable")
    assert not outcomes
    assert {item.why for item in skipped} == {"unstable"}


def test_a_chain_that_takes_too_long_ends_its_ladder(case, fake):
    ladder, outcomes, skipped = run(case, "cable", replace(GRID, longest_run=-1.0))
    assert not outcomes
    assert [item.setting for item in skipped] == [ladder[0]]
    assert skipped[0].why.startswith("would take ")
    assert skipped[0].to_record() == {
        "case": "fake",
        "setting": ladder[0].label,
        "why": skipped[0].why,
    }


def test_geds_runs_every_time_step_and_keeps_large_errors(case, fake):
    fake.stable = 0.006
    fake.error = staticmethod(lambda step, n: 2.0 * LOST if step > 0.004 else 0.01)
    ladder, outcomes, skipped = run(case, "geds")
    assert [item.setting.timestep > fake.stable for item in skipped] == [True] * len(skipped)
    assert len(outcomes) + len(skipped) == len(ladder)
    assert max(outcome.error for outcome in outcomes) == pytest.approx(2.0 * LOST)


def test_an_outcome_is_a_record_of_the_contract(case, fake):
    _, outcomes, _ = run(case, "geds")
    record = outcomes[0].to_record()
    assert record["case"] == "fake"
    assert record["model"] == "geds"
    assert record["reference"] == "converged"
    assert record["clamp_corrected"] is None
    assert record["fallbacks"] == 3
    assert record["wall_s_per_sim_s"] == pytest.approx(record["wall_s"] / case.motion.duration)


def test_simulate_samples_evenly_and_drives_to_the_end_of_every_step(case, fake):
    told = []
    driven = replace(
        case, motion=replace(case.motion, drive=lambda hose, holds, time: told.append(time))
    )
    hose = fake("geds", case.spec, timestep=0.01, control_points=8)
    times, values, points, wall = simulate(driven, hose)
    np.testing.assert_allclose(times, np.linspace(0.0, 0.1, 6))
    np.testing.assert_allclose(told, np.linspace(0.01, 0.1, 10))
    assert values.shape == (6, 3)
    assert points.shape[0] == 6
    assert points.shape[2] == 3
    assert hose.n_steps == 10
    assert wall > 0.0


def test_the_reference_is_extrapolated_in_the_time_step(case, fake):
    fake.error = staticmethod(lambda step, n: 0.25 + 3.0 * step**2)
    reference = compute_reference(case, QUICK, stretchable=True)
    np.testing.assert_allclose(reference.values[1:, 2], 0.25, rtol=1e-12)
    assert reference.uncertainty < 1e-12


def test_the_uncertainty_of_a_reference_is_what_its_two_resolutions_differ_by(case, fake):
    fake.error = staticmethod(lambda step, n: 0.01 * (n == 36))
    reference = compute_reference(case, QUICK, stretchable=False)
    assert reference.uncertainty == pytest.approx(0.01)
    assert {hose.resolution for hose in fake.made} == {36, 48}
    assert {hose.spec.axial_stiffness for hose in fake.made} == {1e3 * case.spec.axial_stiffness}


def test_timing_again_keeps_the_least_wall_time(case, fake, make_outcome):
    short, long = make_outcome(wall=0.02), make_outcome(wall=1e9)
    time_rounds(case, [short, long], GRID)
    assert 0.0 < short.wall_s < 0.02
    assert long.wall_s == 1e9
    assert len(fake.made) in (GRID.rounds - 1, GRID.rounds)


@pytest.mark.parametrize("models", [("geds",), ("cable",), ("geds", "hinge-chain")])
def test_a_motion_runs_with_any_choice_of_models(case, fake, models):
    fake.error = staticmethod(lambda step, n: step / n)
    grid = replace(GRID, dynamic=dict.fromkeys(GRID.dynamic, (8,)))
    result = run_case(case, models, grid, lambda text: None)
    assert {outcome.setting.model for outcome in result.outcomes} == set(models)
    assert (result.stretchable is not None) == ("geds" in models)
    assert (result.inextensible is not None) == (models != ("geds",))
    assert bool(compute_ratios(result)) == (len(models) == 2)
    assert all(check.ok for check in check_motions(result))


def test_a_static_case_is_scored_by_its_worst_number(case, fake):
    static = replace(
        case,
        motion=None,
        probe=lambda hose: np.array([1.1, 2.0, -3.9]),
        truth=lambda: np.array([1.0, 2.0, -4.0]),
        scale=None,
    )
    outcomes, _ = run_static(static, ("geds", "cable"), GRID)
    assert [outcome.error for outcome in outcomes] == pytest.approx([0.1] * len(outcomes))
    assert {outcome.reference for outcome in outcomes} == {"closed form"}
    assert {outcome.wall_s_per_sim_s for outcome in outcomes} == {None}
    clamps = {(outcome.setting.model, outcome.setting.clamp_corrected) for outcome in outcomes}
    assert clamps == {("geds", None), ("cable", True), ("cable", False)}
    by_length = replace(static, scale=0.5)
    assert run_static(by_length, ("geds",), GRID)[0][0].error == pytest.approx(0.2)


def test_a_static_check_fails_by_the_best_error(case, make_outcome, make_result):
    static = replace(case, motion=None)
    result = make_result(make_outcome(error=0.02), make_outcome("cable", error=0.0))
    result.case = static
    (check,) = check_statics([result])
    assert check.value == 0.02
    assert not check.ok
    result.outcomes = [make_outcome("cable")]
    assert check_statics([result]) == []


def test_the_cheapest_is_the_fastest_within_the_error(make_outcome):
    outcomes = [
        make_outcome(error=0.001, wall=3.0, n=30),
        make_outcome(error=0.009, wall=2.0, n=20),
        make_outcome(error=0.01, wall=2.5, n=25),
        make_outcome(error=0.02, wall=0.1, n=8),
        make_outcome("cable", error=0.0, wall=0.01),
    ]
    assert find_cheapest(outcomes, "geds", 0.01).setting.resolution == 20
    assert find_cheapest(outcomes, "geds", 0.001).setting.resolution == 30
    assert find_cheapest(outcomes, "geds", 0.0001) is None
    assert find_cheapest(outcomes, "hinge-chain", 0.01) is None


def test_a_plane_and_space_are_kept_apart(make_outcome):
    space = make_outcome(wall=2.0)
    plane = make_outcome(wall=1.0, scheme="bdf2, planar")
    assert find_cheapest([space, plane], "geds", 0.01) is space
    assert find_cheapest([space, plane], "geds", 0.01, planar=True) is plane
    assert find_cheapest([space], "geds", 0.01, planar=True) is None
    # Chains have no such choice.
    chain = make_outcome("hinge-chain", scheme="rk4", clamp=True)
    assert find_cheapest([chain], "hinge-chain", 0.01, planar=True) is chain


def test_raw_clamps_never_count(make_outcome):
    raw = make_outcome("cable", wall=0.1, clamp=False)
    corrected = make_outcome("cable", wall=5.0, clamp=True)
    assert find_cheapest([raw], "cable", 0.01) is None
    assert find_cheapest([raw, corrected], "cable", 0.01) is corrected
    nothing_to_correct = make_outcome("cable", wall=1.0, clamp=None)
    assert find_cheapest([raw, nothing_to_correct], "cable", 0.01) is nothing_to_correct


def test_ratios_compare_each_at_its_cheapest(make_outcome, make_result):
    result = make_result(
        make_outcome(error=0.009, wall=1.0, n=8),
        make_outcome(error=0.0009, wall=2.0, n=12),
        make_outcome(error=0.009, wall=0.5, n=8, scheme="bdf2, planar"),
        make_outcome("cable", error=0.008, wall=20.0, clamp=True, scheme="euler"),
        make_outcome("cable", error=0.008, wall=0.1, clamp=False, scheme="euler"),
        make_outcome("hinge-chain", error=0.0005, wall=5.0, clamp=True, scheme="rk4"),
    )
    ratios = {(r.at_error, r.against, r.planar): r for r in compute_ratios(result)}
    walls = {key: ratio.wall_ratio for key, ratio in ratios.items()}
    assert walls == {
        (0.01, "cable", False): 20.0,
        (0.01, "cable", True): 40.0,
        (0.01, "hinge-chain", False): 5.0,
        (0.01, "hinge-chain", True): 10.0,
        (0.001, "hinge-chain", False): 2.5,
    }
    assert {ratio.at_error for ratio in ratios.values()} <= set(EQUAL_ERRORS)
    for ratio in ratios.values():
        assert (ratio.case, ratio.model) == ("fake", "geds")
        assert ratio.model_setting.endswith("planar") == ratio.planar
    one = ratios[0.01, "cable", False]
    assert one.model_setting == Setting("geds", "bdf2", 8, None, 0.001).label
    assert one.against_setting == Setting("cable", "euler", 10, True, 0.001).label


def test_no_ratio_without_both_models(make_outcome, make_result):
    assert compute_ratios(make_result()) == []
    assert compute_ratios(make_result(make_outcome())) == []
    assert compute_ratios(make_result(make_outcome("cable", clamp=True))) == []


def make_sequence(make_outcome, segments, clamp, *, steps=(0.001,), scheme="rk4"):
    """Outcomes of a chain whose error is exactly of second order in its segment length."""
    shift = 0.5 if clamp else 0.0
    return [
        make_outcome(
            "hinge-chain",
            n=n,
            clamp=clamp,
            scheme=scheme,
            timestep=step,
            # Only the finest time step follows the law.
            values=LIMIT + 0.3 / (n - shift) ** 2 + 7.0 * (step > min(steps)),
        )
        for step in steps
        for n in segments
    ]


LIMIT = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])


@pytest.mark.parametrize("clamp", [True, None])
@pytest.mark.parametrize("steps", [(0.001,), (0.004, 0.001), (0.001, 0.004)])
def test_the_limit_of_a_second_order_sequence_is_found(make_outcome, make_result, clamp, steps):
    outcomes = make_sequence(make_outcome, (10, 20, 40), clamp, steps=steps)
    assert compute_limit_gap(make_result(*outcomes, reference=LIMIT)) < 1e-12
    off = LIMIT + np.array([0.0, 0.003, 0.004])
    assert compute_limit_gap(make_result(*outcomes, reference=off)) == pytest.approx(0.005)


def test_raw_clamps_and_other_schemes_do_not_disturb_the_limit(make_outcome, make_result):
    outcomes = [
        *make_sequence(make_outcome, (20, 40), True),
        *make_sequence(make_outcome, (20, 40, 80), False, steps=(0.0001,)),
        *make_sequence(make_outcome, (20, 40, 80), True, scheme="euler"),
        make_outcome(n=80),
    ]
    assert compute_limit_gap(make_result(*outcomes, reference=LIMIT)) < 1e-12


def test_no_limit_without_two_resolutions_a_factor_of_two_apart(make_outcome, make_result):
    outcomes = make_sequence(make_outcome, (10, 15, 40), True)
    assert compute_limit_gap(make_result(*outcomes, reference=LIMIT)) is None
    assert compute_limit_gap(make_result(reference=LIMIT)) is None
    assert compute_limit_gap(make_result(make_outcome())) is None


def test_where_costs_are_not_compared_a_chain_may_be_far_off(case, fake):
    fake.error = staticmethod(lambda step, n: 2.0 * LOST)
    assert not run(case, "cable")[1]
    assert run(replace(case, has_ratios=False), "cable")[1]


def test_where_costs_are_not_compared_there_is_no_ratio(case, make_outcome, make_result):
    result = make_result(make_outcome("geds"), make_outcome("cable", clamp=True))
    assert compute_ratios(result)
    result.case = replace(case, has_ratios=False)
    assert compute_ratios(result) == []


def test_a_motion_that_promises_an_error_is_checked(case, make_outcome, make_result):
    outcomes = [make_outcome(n=n, error=error) for n, error in ((8, 0.2), (16, 0.03), (16, 0.02))]
    result = make_result(*outcomes)
    result.case = replace(case, promise=0.01)
    (check,) = check_motions(result)
    assert (check.value, check.limit, check.ok) == (0.02, 0.01, False)
