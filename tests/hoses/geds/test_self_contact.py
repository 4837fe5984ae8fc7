"""A hose against itself and against another hose."""

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.hoses.geds import self_contact
from hose_mj.hoses.geds.hose_pair import HosePair
from hose_mj.hoses.obstacles import ContactLaw

RADIUS = 0.01
STILL = (0.0, 0.0, 0.0)


def fold(s):
    """A flat S: three strands, the outer two 6 cm above and below the middle one's plane."""
    bend = 0.05
    u = s / bend
    x = np.where(u < 8, u, np.where(u < 8 + np.pi, 8 + np.sin(u - 8), 16 + np.pi - u))
    y = np.where(u < 8, 0.0, np.where(u < 8 + np.pi, 1 - np.cos(u - 8), 2.0))
    return bend * np.stack([x, 0.0 * s, y], axis=1)


def close(s):
    """The two strands of a fold move towards each other."""
    speed = np.zeros((len(s), 3))
    speed[:, 2] = np.where(s < 0.4, 0.5, np.where(s < 0.4 + 0.05 * np.pi, 0.0, -0.5))
    return speed


def make_folded(make_hose, *, touches, **options):
    length = 0.8 + 0.05 * np.pi
    hose = make_hose(
        length=length, ei=1e-3, gravity=STILL, control_points=24, damping=0.01, **options
    )
    hose.set_obstacles([], ContactLaw(self_contact=touches))
    hose.reset(fold, close)
    return hose


def measure_gap(hose):
    """Least distance between the first and the last third of the hose, over two radii."""
    length = hose.spec.length
    one = hose.position(np.linspace(0.0, 0.3 * length, 60))
    other = hose.position(np.linspace(0.7 * length, length, 60))
    return np.min(np.linalg.norm(one[:, None] - other[None], axis=2)) / (2 * RADIUS)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_strands_that_meet_stay_apart(make_hose, plane):
    closest = {}
    for touches in (False, True):
        hose = make_folded(make_hose, touches=touches, plane=plane)
        gaps = []
        for _ in range(60):
            hose.step()
            gaps.append(measure_gap(hose))
        closest[touches] = min(gaps)
    assert closest[False] < 0.3
    # Strands of density rho that meet at 1 m/s sink by sqrt(rho / (2 k)) = dt / 2, 2.5 mm, or more
    # where the fold behind them pushes.
    assert closest[True] > 0.7


def test_self_contact_keeps_the_momenta(make_hose):
    hose = make_folded(
        make_hose, touches=True, scheme="backward-euler", tolerance=1e-13, max_iterations=400
    )
    start = hose.momentum()
    free = make_folded(make_hose, touches=False, scheme="backward-euler", tolerance=1e-13)
    hose.step(40)
    free.step(40)
    assert measure_gap(hose) > measure_gap(free) + 0.1
    np.testing.assert_allclose(hose.momentum().linear, start.linear, atol=1e-10)
    # Backward Euler loses angular momentum by itself; contact adds nothing to it.
    drift = np.abs(hose.momentum().angular - start.angular)
    assert np.max(drift) < 2e-5


def test_a_straight_hose_does_not_touch_itself(make_hose):
    ends = []
    for touches in (False, True):
        hose = make_hose()
        law = ContactLaw(self_contact=touches, points_per_span=4)
        hose.set_obstacles([], law)
        hose.clamp(0.0)
        hose.step(100)
        ends.append(hose.control_points)
    np.testing.assert_array_equal(ends[0], ends[1])


def test_self_contact_looks_closer_than_a_radius(make_hose):
    hose = make_hose(control_points=12)
    hose.set_obstacles([], ContactLaw(self_contact=True))
    assert np.max(np.diff(hose.contacts.arc_lengths)) < 1.0001 * RADIUS
    hose.set_obstacles([], ContactLaw(points_per_span=3))
    assert len(hose.contacts.arc_lengths) == 28


def make_crossing(make_hose, **options):
    hoses = [make_hose(gravity=STILL, ei=5e-3, damping=0.01, **options) for _ in range(2)]
    hoses[0].reset([[0, 0, 0.05], [1, 0, 0.05]], (0.0, 0.0, -0.5))
    hoses[1].reset([[0.45, -0.5, 0], [0.5, 0.5, 0]], (0.1, 0.0, 0.0))
    return hoses


@pytest.mark.parametrize("scheme", ["bdf2", "backward-euler"])
def test_hoses_that_cross_exchange_their_momentum(make_hose, scheme):
    one, other = make_crossing(make_hose, scheme=scheme, tolerance=1e-11)
    pair = HosePair(one, other)
    before = one.momentum().linear + other.momentum().linear
    angular = one.momentum().angular + other.momentum().angular
    forces = []
    for _ in range(60):
        pair.step()
        forces.append(pair.force[2])
    assert min(forces) < -0.1
    assert max(forces) < 1e-12
    assert one.fallbacks == other.fallbacks == 0
    after = one.momentum().linear + other.momentum().linear
    np.testing.assert_allclose(after, before, atol=1e-10)
    turned = one.momentum().angular + other.momentum().angular - angular
    assert np.max(np.abs(turned)) < 1e-3 * 0.05
    assert other.momentum().linear[2] < -0.005
    # The first hose is still above where they cross.
    assert one.position(0.475)[0, 2] > other.position(0.5)[0, 2] + RADIUS


@pytest.mark.filterwarnings("ignore:a surface is:hose_mj.HoseWarning")  # pairs are soft
def test_a_hose_lies_on_another(make_hose):
    lower, upper = make_hose(damping=0.02), make_hose(damping=0.02)
    for hose in (lower, upper):
        hose.contacts.add_floor()
    lower.reset([[0.5, -0.5, RADIUS], [0.5, 0.5, RADIUS]])
    upper.reset([[0, 0, 0.06], [1, 0, 0.06]])
    pair = HosePair(upper, lower, friction=0.5)
    pair.step(300)
    assert upper.position(0.5)[0, 2] == pytest.approx(3 * RADIUS, abs=0.3 * RADIUS)
    assert upper.energies().kinetic + lower.energies().kinetic < 1e-5
    weight = 0.1 * 9.81
    carried = upper.contacts.list_reactions()[0].force[2] + pair.force[2]
    assert carried == pytest.approx(-weight, rel=1e-3)
    assert lower.contacts.list_reactions()[0].force[2] == pytest.approx(
        pair.force[2] - weight, rel=1e-3
    )


def test_a_neighbour_is_part_of_a_snapshot(make_hose):
    one, other = make_crossing(make_hose)
    pair = HosePair(one, other, friction=0.3, capsules=40)
    pair.step(20)
    saved = one.snapshot(), other.snapshot()
    pair.step(20)
    wanted = one.control_points, other.control_points
    one.restore(saved[0])
    other.restore(saved[1])
    pair.step(20)
    np.testing.assert_array_equal(one.control_points, wanted[0])
    np.testing.assert_array_equal(other.control_points, wanted[1])


def test_wrong_pairs_are_refused(make_hose):
    hose = make_hose()
    with pytest.raises(InputError, match="second"):
        HosePair(hose, hose)
    with pytest.raises(InputError, match="timestep"):
        HosePair(hose, make_hose(timestep=0.002))
    with pytest.raises(InputError, match="friction"):
        HosePair(hose, make_hose(), friction=-1.0)
    with pytest.raises(InputError, match="neighbour"):
        hose.contacts.set_neighbour(np.zeros((1, 3)), np.zeros((1, 3)), 0.01, 0.0, 1.0)
    with pytest.raises(InputError, match="velocities"):
        hose.contacts.set_neighbour(np.zeros((2, 3)), np.zeros((3, 3)), 0.01, 0.0, 1.0)
    with pytest.raises(InputError, match="forces"):
        hose.set_push([0.1, 0.2], np.zeros((3, 3)))


@pytest.mark.parametrize("speed", [5.0, 40.0])
@pytest.mark.filterwarnings("ignore::hose_mj.HoseWarning")  # up to ten radii a step
def test_strands_that_are_thrown_at_each_other_do_not_pass(make_hose, speed):
    hose = make_folded(make_hose, touches=True, timestep=0.005)
    hose.reset(fold, lambda s: 2.0 * speed * close(s))
    gaps = []
    for _ in range(10):
        hose.step()
        gaps.append(measure_gap(hose))
    assert hose.health.crossings == 0
    assert min(gaps) > 0.9


def test_the_matrix_is_the_derivative_of_the_force(make_hose):
    """Soft rows against finite differences of the residual."""
    hose = make_folded(make_hose, touches=True, timestep=0.001)
    while measure_gap(hose) > 1.1:
        hose.step()
    dynamics = hose._dynamics
    axes, x = dynamics.axes, dynamics.state.x.copy()
    # Damping is linearized at a depth that stays.
    hose.set_obstacles([], ContactLaw(self_contact=True, damping_time=0.0))
    contact = dynamics.loads.loads.contact
    # All of the lower strand goes up.
    x[2 : 3 * 10 : 3] += 0.3 * RADIUS

    def build(places):
        work = dynamics.make_work()
        work.start[:] = dynamics.state.x
        self_contact.add_self_contact(axes, contact, places, 0.001, True, work)
        rows = work.soft.rows[: work.soft.used[0], : len(x)]
        return work.gradient[: len(x)], rows, work.soft.compliance[: len(rows)]

    force, rows, compliance = build(x)
    assert len(rows) > 5
    matrix = rows.T @ (rows / compliance[:, None])
    step = 1e-9
    found = np.zeros_like(matrix)
    for k in range(len(x)):
        moved = x.copy()
        moved[k] += step
        found[:, k] = (build(moved)[0] - force) / step
    np.testing.assert_allclose(matrix, found, atol=2e-3 * np.abs(matrix).max())
    np.testing.assert_allclose(
        force.reshape(-1, 3).sum(axis=0), 0.0, atol=1e-10 * np.abs(force).max()
    )
