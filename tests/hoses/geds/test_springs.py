"""Holds that give way by a spring and a damper: closed forms, limits, stability."""

import numpy as np
import pytest

from hose_mj import HoseSpec, InputError, Spring, make_hose
from hose_mj.hoses.geds.hose import GedsHose

MASS, DT, GRAVITY = 0.1, 0.005, 9.81
BAR = HoseSpec(
    length=1.0,
    axial_stiffness=1e7,
    bending_stiffness=5.0,
    torsional_stiffness=4.0,
    linear_density=MASS,
)
"""As good as rigid: what moves is the spring."""
LIMP = HoseSpec(length=1.0, axial_stiffness=2e4, bending_stiffness=0.01, linear_density=MASS)
forms = pytest.mark.parametrize("options", [{}, {"plane": "xz"}, {"twist": "theta"}])


def lay(spec=BAR, along=(0.0, 0.0, -1.0), **options):
    hose = make_hose("geds", spec, **({"control_points": 8, "timestep": DT} | options))
    hose.reset([[0.0, 0.0, 0.0], along])
    return hose


@forms
@pytest.mark.parametrize("stiffness", [0.5, 1e3, 1e8, 1e13])
def test_a_hose_hangs_on_a_spring(stiffness, options):
    hose = lay(**options)
    hold = hose.clamp(0.0, spring=Spring(stiffness))
    found = hose.solve_static()
    weight = MASS * GRAVITY
    assert found.is_stable
    np.testing.assert_allclose(hose.reaction(hold).force, [0, 0, weight], rtol=1e-6, atol=1e-9)
    drop = -hose.position(0.0)[0, 2]
    assert drop == pytest.approx(weight / stiffness, rel=1e-6, abs=1e-11)
    hose.step(20)  # at rest it stays
    assert -hose.position(0.0)[0, 2] == pytest.approx(drop, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_it_swings_as_a_mass_on_a_spring(damping):
    stiffness, start = 10.0, 0.1
    errors = []
    for dt in (0.004, 0.002):
        hose = lay(gravity=(0, 0, 0), timestep=dt)
        hose.attach(0.0, (0, 0, start), Spring(stiffness, damping))
        steps = round(0.4 / dt)
        hose.step(steps)
        rate, decay = np.sqrt(stiffness / MASS), damping / (2.0 * MASS)
        swing, t = np.sqrt(rate**2 - decay**2), steps * dt
        exact = np.exp(-decay * t) * (np.cos(swing * t) + decay / swing * np.sin(swing * t))
        errors.append(abs(start - hose.position(0.0)[0, 2] - start * exact))
    assert errors[1] < 2e-4 * start * 10
    assert errors[1] < 0.45 * errors[0]


def test_what_it_does_is_read_back():
    spring = Spring(300.0, 2.0)
    hose = lay(LIMP, (1.0, 0.0, 0.0), scheme="backward-euler", control_points=16)
    hose.attach(0.0)
    hold, target = hose.attach(1.0, spring=spring), np.array([1.0, 0.0, 0.0])
    for k in range(60):
        speed = np.array([-1.0, 0.0, 0.5])
        target = target + DT * speed
        hose.move(hold, target)
        hose.step()
        gap, slip = target - hose.position(1.0)[0], speed - hose.velocity(1.0)[0]
        wanted = spring.stiffness * gap + spring.damping * slip
        np.testing.assert_allclose(hose.reaction(hold).force, wanted, atol=2e-3, err_msg=str(k))


def test_beyond_its_limit_it_pulls_as_hard_as_that():
    hose = lay(along=(1.0, 0.0, 0.0), gravity=(0, 0, 0), scheme="backward-euler")
    hold = hose.attach(1.0, (5.0, 0.0, 0.0), Spring(1e6, 10.0, limit=0.2))
    hose.step(100)
    np.testing.assert_allclose(hose.reaction(hold).force, [0.2, 0, 0], atol=1e-9)
    assert hose.momentum().linear[0] == pytest.approx(0.2 * 0.5, rel=1e-6)
    # Below it, it is the spring again.
    hose = lay(along=(1.0, 0.0, 0.0), gravity=(0, 0, 0))
    hold = hose.attach(1.0, (1.1, 0.0, 0.0), Spring(1.0, 0.6, limit=0.2))
    hose.step(1000)
    np.testing.assert_allclose(hose.position(1.0)[0], [1.1, 0, 0], atol=1e-4)


@pytest.mark.parametrize("stiffness", [1e-3, 1e2, 1e5, 1e9, 1e14])
@pytest.mark.parametrize("damping", [0.0, 30.0])
@pytest.mark.parametrize("limit", [np.inf, 2.0])
def test_it_is_stable_at_any_stiffness(stiffness, damping, limit):
    hose = lay(LIMP, (1.0, 0.0, 0.0), control_points=16)
    hose.clamp(0.0)
    spring = Spring(stiffness, damping, limit)
    start = hose.energies().total
    hold, middle = hose.attach(1.0, spring=spring), hose.attach(0.5, spring=spring)
    for _ in range(10):
        hose.step(20)
        reach = [hose.position(1.0)[0] - [1, 0, 0], hose.position(0.5)[0] - [0.5, 0, 0]]
        held = 0.0 if limit < np.inf else 0.5 * stiffness * np.sum(np.square(reach))
        assert hose.energies().total + held < start + 1e-3
    forces = [np.linalg.norm(hose.reaction(one).force) for one in (hold, middle)]
    assert max(forces) <= limit * (1 + 1e-4)
    assert hose.health.retry_share < 0.1


def test_as_stiff_as_nothing_it_is_a_rigid_hold():
    found = []
    for spring in (None, Spring(1e13), Spring()):
        hose = lay(LIMP, (1.0, 0.0, 0.0), control_points=16)
        hose.clamp(0.0, spring=spring)
        hold = hose.attach(1.0, spring=spring)
        path = np.array([1.0, 0.0, 0.0]) - np.linspace(0.0, 0.1, 60)[:, None] * [1, 0, 2]
        hose.follow({hold: path})
        found.append(hose.control_points)
    np.testing.assert_allclose(found[1], found[0], atol=1e-8)
    np.testing.assert_array_equal(found[2], found[0])


@forms
def test_a_clamp_turns_against_a_spring(options):
    turn, moment = 0.3, 0.1
    angle = 0.5 * np.arcsin(2.0 * moment / turn)
    hose = lay(along=(1.0, 0.0, 0.0), gravity=(0, 0, 0), **options)
    hold = hose.clamp(0.0, spring=Spring(turn_stiffness=turn))
    hose.apply_moment(1.0, (0.0, -moment, 0.0))
    hose.solve_static()
    tangent = hose.tangent(0.0)[0]
    assert tangent[2] == pytest.approx(np.sin(angle), rel=1e-6)
    np.testing.assert_allclose(hose.reaction(hold).moment, [0, moment, 0], atol=1e-6)
    np.testing.assert_allclose(hose.position(0.0)[0], 0.0, atol=1e-9)
    hose.step(10)
    assert hose.tangent(0.0)[0, 2] == pytest.approx(np.sin(angle), rel=1e-5)


def test_it_counts_in_small_motions():
    hose = lay(gravity=(0, 0, 0))
    hose.attach(0.0, spring=Spring(40.0))
    small = hose.linearize()
    assert small.constraints.shape[0] == 0
    up = np.tile([0.0, 0.0, 1.0], 8)
    assert up @ small.stiffness @ up == pytest.approx(40.0)
    assert up @ small.mass @ up == pytest.approx(MASS)


def test_a_snapshot_goes_on_bit_by_bit():
    hose = lay(LIMP, (1.0, 0.0, 0.0), control_points=16)
    hose.clamp(0.0, spring=Spring(1e3, 1.0, 50.0, 0.5))
    hold = hose.attach(1.0, spring=Spring(20.0, 0.1))
    hose.step(7)
    hose.move(hold, (0.98, 0.0, 0.0))
    saved = hose.snapshot()
    hose.step(9)
    wanted = hose.control_points
    other = lay(LIMP, (1.0, 0.0, 0.0), control_points=16)
    other.restore(saved)
    other.step(9)
    np.testing.assert_array_equal(other.control_points, wanted)


def test_a_hold_made_later_leaves_a_moved_target_its_way():
    hoses = [lay(LIMP, (1.0, 0.0, 0.0), control_points=16) for _ in range(2)]
    for late, hose in enumerate(hoses):
        if not late:
            hose.attach(0.5)
        hold = hose.attach(1.0, spring=Spring(20.0, 5.0))
        hose.step(1 - late)
        if late:
            first = hose.attach(0.5)
            hose.step()
            assert first in hose.holds
        hose.move(hold, (0.98, 0.0, 0.0))
    extra = hoses[1].attach(0.25)
    hoses[1].release(extra)
    for hose in hoses:
        hose.step(3)
    np.testing.assert_allclose(hoses[1].control_points, hoses[0].control_points, atol=1e-12)


@pytest.mark.parametrize("name", ["stiffness", "damping", "limit", "turn_stiffness"])
@pytest.mark.parametrize("value", [-1.0, np.nan, "x", None, 1j])
def test_odd_springs_are_refused(name, value):
    with pytest.raises(InputError, match=f"{name} of a spring"):
        Spring(**{"stiffness": 1.0, name: value})


def test_springs_where_there_can_be_none():
    for numbers in ({"damping": 1.0}, {"limit": 1.0}):
        with pytest.raises(InputError, match="stiffness of a spring is inf"):
            Spring(**numbers)
    hose = lay()
    with pytest.raises(InputError, match="spring is 5; valid: a Spring"):
        hose.attach(0.5, spring=5)
    hold = hose.attach(0.0, spring=Spring(1.0))
    with pytest.raises(InputError, match="an attachment without a spring"):
        hose.coupling.try_step([hold], np.zeros((1, 3)), np.zeros((3, 3)))
    explicit = GedsHose(BAR, control_points=8, scheme="verlet", timestep=1e-6)
    with pytest.raises(InputError, match="scheme is 'verlet'; valid: an implicit"):
        explicit.clamp(0.0, spring=Spring(1.0))
