"""What the comparison measures of GEDS's own numerics: the cheap part; its random hoses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hose_mj.errors import StepError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.validation import numerics, random_states
from hose_mj.validation.random_states import make_random_hose, run_random_states

N_HOSES = 300
WEIGHT = 0.1 * 9.81


@given(st.floats(-4.0, 4.0), st.floats(1e-6, 1e6))
def test_the_order_of_a_power_law_is_its_exponent(order, factor):
    sizes = [0.4, 0.1, 0.2, 0.05]
    errors = [factor * size**order for size in sizes]
    assert numerics.measure_order(sizes, errors) == pytest.approx(order, abs=1e-9)


def test_the_order_is_that_of_the_whole_range():
    """A floor under the error lowers the order: one lucky pair cannot raise it."""
    sizes = [0.4, 0.2, 0.1, 0.05]
    floor = [size**2 + 1e-2 for size in sizes]
    assert 0.5 < numerics.measure_order(sizes, floor) < 1.5


def list_failed(checks):
    return [f"{check.name}: {check.value:.3g}" for check in checks if not check.ok]


def test_orders_in_the_time_step():
    checks, curves = numerics.check_time_order()
    assert not list_failed(checks)
    assert list(curves) == ["bdf2", "sdirk2", "midpoint", "backward-euler"]
    for steps, errors in curves.values():
        assert steps == sorted(steps, reverse=True)
        assert errors == sorted(errors, reverse=True)
    # First order is no better than it should be, or the errors are not those of the time step.
    assert numerics.measure_order(*curves["backward-euler"]) < 1.1


def test_order_of_the_frequencies():
    checks, curves = numerics.check_frequency_order()
    assert not list_failed(checks)
    assert len(curves) == 9


def test_momenta_in_free_flight():
    checks = numerics.check_momenta()
    assert not list_failed(checks)
    assert sum("linear momentum" in check.name for check in checks) == 5
    assert sum("angular momentum" in check.name for check in checks) == 5


def test_energy_never_grows_over_ten_seconds():
    checks, (times, energies) = numerics.check_energy()
    assert not list_failed(checks)
    assert times[-1] == pytest.approx(10.0)
    assert len(times) == len(energies)
    assert min(energies) >= 0.0


def test_suture_thread():
    assert not list_failed(numerics.check_suture())


def test_random_states():
    told = []
    checks = numerics.check_random_states(400, np.random.default_rng(5), told.append)
    assert not list_failed(checks)
    assert len(checks) == 3
    assert sum(told) == 400


@pytest.mark.parametrize(
    ("tally", "failing"),
    [
        (random_states.Tally(not_finite=1), "NaN"),
        (random_states.Tally(verdicts=1), "verdict"),
        (random_states.Tally(verdicts=1, touched=1), "changed the state"),
    ],
)
def test_every_check_of_the_random_states_can_fail(monkeypatch, tally, failing):
    monkeypatch.setattr(random_states, "run_random_states", lambda *_: tally)
    failed = list_failed(numerics.check_random_states(100, np.random.default_rng(0), print))
    assert any(failing in line for line in failed)


class Unreliable:
    """Fails at its second step, after which its state is the same, another or not a number."""

    fallbacks = 0

    def __init__(self, value):
        self.value = value
        self.control_points = self.control_velocities = np.zeros((5, 3))
        self.n_steps = 0

    def step(self):
        self.n_steps += 1
        if self.n_steps == 2:
            self.control_points = np.full((5, 3), self.value)
            raise StepError("as told")


@pytest.mark.parametrize(
    ("value", "tally"),
    [
        (0.0, random_states.Tally(verdicts=3)),
        (1.0, random_states.Tally(verdicts=3, touched=3)),
        (np.nan, random_states.Tally(verdicts=3, touched=3, not_finite=3)),
    ],
)
def test_random_states_are_counted_by_how_they_end(monkeypatch, value, tally):
    monkeypatch.setattr(random_states, "make_random_hose", lambda rng: Unreliable(value))
    assert run_random_states(3, np.random.default_rng(0), print) == tally


@pytest.fixture(scope="module")
def hoses():
    """Random hoses, laid and loaded, none of which has made a step."""
    rng = np.random.default_rng(20261122)
    return [make_random_hose(rng) for _ in range(N_HOSES)]


def get_straight(hose):
    return GedsHose(
        hose.spec, timestep=hose.timestep, control_points=len(hose.control_points), plane="xz"
    ).control_points


def classify(hose):
    """Which kind of shape a polygon is; None for one that its description does not cover."""
    points, straight = hose.control_points, get_straight(hose)
    gap = np.abs(points - straight)
    rows = np.linalg.norm(np.diff(points, axis=0), axis=1)
    still = rows == 0.0
    if np.any(still[:-2] & still[1:-1] & still[2:]) and np.all(gap[:, 1:] == 0.0):
        return "coincident"
    if np.all(gap[:, 1:] == 0.0) and np.any(np.diff(points[:, 0]) < 0.0):
        np.testing.assert_allclose(rows, np.diff(straight[:, 0]), rtol=1e-9)
        return "folded"
    if np.max(gap) <= 0.02:
        return "disturbed"
    return "displaced" if np.max(gap) <= 2.0 else None


def test_random_hoses_have_every_kind_of_shape(hoses):
    kinds = [classify(hose) for hose in hoses]
    assert None not in kinds
    for kind in ("coincident", "folded", "disturbed", "displaced"):
        assert kinds.count(kind) > 0.15 * N_HOSES, kind


def test_random_hoses_keep_to_their_ranges(hoses):
    ratios = [hose.spec.axial_stiffness / hose.spec.bending_stiffness for hose in hoses]
    assert 1e2 <= min(ratios) < 1e3
    assert 1e7 < max(ratios) <= 1e8
    steps = [hose.timestep for hose in hoses]
    assert 1e-4 <= min(steps) < 2e-4
    assert 1e-2 < max(steps) <= 2e-2
    assert {len(hose.control_points) for hose in hoses} == {6, 8, 12, 16, 24}
    assert {hose.scheme for hose in hoses} == {"bdf2", "backward-euler"}
    assert {hose.spec.damping_time for hose in hoses} == {0.0, 0.01}


def test_random_hoses_are_held_and_loaded(hoses):
    loads = [hose.snapshot()["loads"]["forces"] for hose in hoses]
    assert {len(forces) for forces in loads} == {2}
    sizes = [np.linalg.norm(force) / WEIGHT for forces in loads for _, force in forces]
    assert 90.0 < max(sizes) <= 100.0
    n_holds = [len(hose.snapshot()["holds"]["held"]) for hose in hoses]
    assert {0, 1, 2} <= set(n_holds) <= {0, 1, 2, 3}


def test_half_of_the_random_hoses_move_in_a_plane(hoses):
    flat = [len(hose.snapshot()["state"]["x"]) == 2 * len(hose.control_points) for hose in hoses]
    across = [np.any(hose.control_points[:, 1] != 0.0) for hose in hoses]
    assert 0.4 < np.mean(flat) < 0.6
    assert any(across)
    assert not np.any(np.logical_and(flat, across))


def test_the_same_seed_draws_the_same_hoses():
    one, other = (np.random.default_rng(3) for _ in range(2))
    for _ in range(5):
        first, second = make_random_hose(one), make_random_hose(other)
        assert first.spec == second.spec
        assert first.timestep == second.timestep
        np.testing.assert_array_equal(first.control_points, second.control_points)
        for hose in (first, second):
            hose.step()
        np.testing.assert_array_equal(first.control_points, second.control_points)


def test_another_seed_draws_other_hoses():
    first, second = (make_random_hose(np.random.default_rng(seed)) for seed in (1, 2))
    assert first.spec != second.spec
