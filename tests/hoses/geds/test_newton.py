import numpy as np
import pytest

from hose_mj.errors import InputError, StepError

WEIGHT = 0.1 * 9.81
planes = pytest.mark.parametrize("plane", [None, "xz"])
schemes = pytest.mark.parametrize(
    "scheme", ["bdf2", "backward-euler", "sdirk2", "midpoint", "verlet"]
)


@planes
@schemes
def test_moving_holds_are_met(make_hose, plane, scheme):
    dt = 1e-5 if scheme == "verlet" else 2e-3
    hose = make_hose(plane=plane, scheme=scheme, timestep=dt, control_points=12)
    hose.clamp(0.0)
    middle, end = hose.attach(0.43), hose.attach(1.0)
    for k in range(1, 31):
        to_middle = hose.position(0.43)[0] + [0.1 * dt, 0.0, 0.2 * dt]
        to_end = np.array([1.0 - 0.5 * dt * k, 0.0, 0.1 * dt * k])
        hose.move(middle, to_middle)
        hose.move(end, to_end)
        hose.step()
        np.testing.assert_allclose(hose.position(0.43)[0], to_middle, atol=1e-12)
        np.testing.assert_allclose(hose.position(1.0)[0], to_end, atol=1e-12)
        np.testing.assert_allclose(hose.position(0.0)[0], 0.0, atol=1e-12)
        np.testing.assert_allclose(hose.tangent(0.0)[0], [1.0, 0.0, 0.0], atol=1e-12)


@schemes
@pytest.mark.parametrize("plane", [None, "xy"])
def test_a_clamp_spins_with_the_hose(make_hose, plane, scheme):
    dt = 1e-5 if scheme == "verlet" else 2e-3
    hose = make_hose(plane=plane, scheme=scheme, timestep=dt, control_points=12, gravity=(0, 0, 0))
    rate = 5.0
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=lambda s: np.outer(rate * s, [0, 1, 0]))
    clamp = hose.clamp(0.0)
    for k in range(1, 151):
        angle = rate * dt * k
        tangent = np.array([np.cos(angle), np.sin(angle), 0.0])
        hose.move(clamp, tangent=tangent)
        hose.step()
        np.testing.assert_allclose(hose.tangent(0.0)[0], tangent, atol=1e-12)
    # The clamp drives a rod that already turns: it stays straight but for the error of the scheme.
    tip = hose.position(1.0)[0]
    atol = 2e-2 if scheme == "backward-euler" else 1e-2
    np.testing.assert_allclose(tip, [np.cos(angle), np.sin(angle), 0.0], atol=atol)


@planes
def test_hanging_hose_pulls_with_its_weight(make_hose, plane):
    hose = make_hose(plane=plane)
    hose.reset([[0, 0, 0], [0, 0, -1.0]])
    hold = hose.attach(0.0)
    hose.solve_static()
    np.testing.assert_allclose(hose.reaction(hold).force, [0, 0, WEIGHT], atol=1e-9)
    np.testing.assert_allclose(hose.reaction(hold).moment, 0.0, atol=1e-12)
    s = np.linspace(0.0, 1.0, 7)
    # The strain of a span is its mean: the tension's error is of second order in the span's length.
    np.testing.assert_allclose(hose.tension(s), WEIGHT * (1.0 - s), atol=5e-3 * WEIGHT)


@planes
def test_hose_hanging_from_its_middle(make_hose, plane):
    hose = make_hose(plane=plane, control_points=24)
    hold = hose.attach(0.5)
    hose.solve_static()
    reaction = hose.reaction(hold)
    np.testing.assert_allclose(reaction.force, [0, 0, WEIGHT], atol=1e-9)
    left, right = hose.position(0.0)[0], hose.position(1.0)[0]
    assert left[2] == pytest.approx(right[2], abs=1e-6)
    assert left[2] < -0.01


@planes
def test_cantilever_reaction_is_weight_and_its_moment(make_hose, plane):
    hose = make_hose(plane=plane)
    clamp = hose.clamp(0.0)
    hose.apply_force(0.7, [0.1, 0.0, -0.2])
    hose.solve_static()
    reaction = hose.reaction(clamp)
    np.testing.assert_allclose(reaction.force, [-0.1, 0.0, WEIGHT + 0.2], atol=1e-9)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    centre = (0.5 * weights) @ hose.position(0.5 + 0.5 * nodes)
    load = np.cross(centre, [0, 0, -WEIGHT]) + np.cross(hose.position(0.7)[0], [0.1, 0, -0.2])
    np.testing.assert_allclose(reaction.moment, -load, atol=1e-7)


def test_reactions_at_rest_under_time_stepping_equal_the_static_ones(make_hose):
    hose = make_hose(plane="xz", timestep=0.01)
    clamp, end = hose.clamp(0.0), hose.attach(1.0)
    hose.solve_static()
    before = hose.reaction(clamp), hose.reaction(end)
    hose.step(5)
    for hold, wanted in zip((clamp, end), before, strict=True):
        np.testing.assert_allclose(hose.reaction(hold).force, wanted.force, atol=1e-6)
        np.testing.assert_allclose(hose.reaction(hold).moment, wanted.moment, atol=1e-6)


def test_release_keeps_the_reactions_of_the_others(make_hose):
    hose = make_hose(plane="xz")
    first, second, third = hose.attach(0.0), hose.attach(0.5), hose.attach(1.0)
    hose.solve_static()
    wanted = hose.reaction(third).force
    hose.release(second)
    np.testing.assert_array_equal(hose.reaction(third).force, wanted)
    fourth = hose.attach(0.25)
    np.testing.assert_array_equal(hose.reaction(third).force, wanted)
    assert np.linalg.norm(wanted) > 0.1
    with pytest.raises(InputError, match="not released"):
        hose.reaction(second)
    for hold in (first, third, fourth):
        hose.release(hold)
    # Freely falling from now on: no hold acts.
    before = hose.momentum().linear
    hose.step()
    gained = hose.momentum().linear - before
    np.testing.assert_allclose(gained, [0, 0, -WEIGHT * 0.005], atol=1e-12)


def test_hold_numbers_are_never_used_twice(make_hose):
    hose = make_hose()
    old = hose.attach(0.0)
    hose.reset([[0, 0, 0], [1, 0, 0]])
    assert hose.attach(0.0) != old
    with pytest.raises(InputError, match="not released"):
        hose.release(old)


def test_holds_that_depend_on_each_other_give_one_error(make_hose):
    hose = make_hose(control_points=8)  # spans of 0.2 m, 4 control points each
    for s in (0.21, 0.25, 0.30, 0.35, 0.39):
        hose.attach(s)
    before = hose.snapshot()
    with pytest.raises(StepError, match=r"holds ask for the same thing") as caught:
        hose.step()
    assert "\n" not in str(caught.value)
    with pytest.raises(StepError, match=r"holds ask for the same thing"):
        hose.solve_static()
    np.testing.assert_array_equal(hose.snapshot()["state"]["x"], before["state"]["x"])
    np.testing.assert_array_equal(hose.snapshot()["state"]["v"], before["state"]["v"])
    assert hose.time == 0.0


@planes
def test_attachment_jacobian(make_hose, wave, plane):
    hose = make_hose(plane=plane, control_points=11)
    hose.reset(wave)
    s = np.array([0.0, 0.2, 0.77, 1.0])
    jacobian = hose.attachment_jacobian(s)
    assert jacobian.shape == (11, 4)
    np.testing.assert_allclose(jacobian.sum(axis=0), 1.0, rtol=1e-14)
    np.testing.assert_allclose(jacobian.T @ hose.control_points, hose.position(s), atol=1e-14)


@planes
def test_inverse_dynamics_agrees_with_the_simulated_acceleration(make_hose, wave, plane):
    dt = 1e-4
    hose = make_hose(plane=plane, scheme="verlet", timestep=dt, ea=1e3, control_points=10)
    hose.reset(wave)
    force = np.array([0.3, 0.0, -0.5])
    hose.apply_force(0.31, force)
    before = hose.control_points
    hose.step()
    acceleration = 2.0 * (hose.control_points - before) / dt**2
    hose.reset(wave)
    # A.23, A.27: without the load in F_e it is what a robot at 0.31 m has to do.
    wanted = hose.attachment_jacobian([0.31]) @ force[None]
    np.testing.assert_allclose(hose.compute_required_forces(acceleration), wanted, atol=1e-6)
    hose.apply_force(0.31, force)
    np.testing.assert_allclose(hose.compute_required_forces(acceleration), 0.0, atol=1e-6)


def test_inverse_dynamics_counts_drag_and_damping(make_hose):
    hose = make_hose(plane="xz", drag=0.3, damping=0.2, gravity=(0, 0, 0), control_points=10)
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=[0.0, 0.0, 2.0])
    forces = hose.compute_required_forces(np.zeros((10, 3)))
    np.testing.assert_allclose(forces.sum(axis=0), [0.0, 0.0, 0.3 * 2.0 * 1.0], atol=1e-12)
    # Stretched at the rate 1/s: the viscous tension tau EA pulls the ends together.
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=lambda s: np.outer(s - 0.5, [1.0, 0.0, 0.0]))
    along = hose.compute_required_forces(np.zeros((10, 3)))[:, 0] @ hose.control_points[:, 0]
    drag = 0.3 * ((1.0 - 0.5) ** 3 + 0.5**3) / 3
    assert along == pytest.approx(0.2 * hose.spec.axial_stiffness + drag, rel=1e-9)


@planes
@pytest.mark.parametrize("turn", [1.0, np.pi, 2.0 * np.pi])
def test_end_moment_rolls_the_hose_into_a_circle(make_hose, plane, turn):
    hose = make_hose(plane=plane, gravity=(0, 0, 0), ea=1e5, control_points=32)
    clamp = hose.clamp(0.0)
    hose.apply_moment(1.0, [0.0, -turn * 0.05, 0.0])
    hose.solve_static()
    wanted = [np.sin(turn) / turn, 0.0, (1.0 - np.cos(turn)) / turn]
    np.testing.assert_allclose(hose.position(1.0)[0], wanted, atol=2e-4)
    np.testing.assert_allclose(hose.curvature(np.linspace(0, 1, 9)), turn, rtol=2e-2)
    np.testing.assert_allclose(hose.reaction(clamp).moment, [0, turn * 0.05, 0], atol=1e-8)
    assert hose.energies().bending == pytest.approx(0.5 * 0.05 * turn**2, rel=1e-3)


def test_end_moment_bends_in_its_own_plane(make_hose):
    hose = make_hose(gravity=(0, 0, 0), ea=1e5, control_points=24)
    hose.clamp(0.0)
    axis = np.array([0.0, 0.6, 0.8])
    hose.apply_moment(1.0, 0.05 * axis)
    hose.solve_static()
    tip = np.array([np.sin(1.0), 0, 0]) + (1.0 - np.cos(1.0)) * np.cross(axis, [1.0, 0, 0])
    np.testing.assert_allclose(hose.position(1.0)[0], tip, atol=2e-4)


def test_the_number_of_steps_is_checked(make_hose, wave):
    hose = make_hose(plane="xz")
    hose.reset(wave)
    before = hose.control_points
    hose.step(0)
    np.testing.assert_array_equal(hose.control_points, before)
    assert hose.time == 0.0
    for bad in (-1, 1.0, True, None, "2"):
        with pytest.raises(InputError, match=r"n_steps is .*valid: a whole number at or above 0"):
            hose.step(bad)
    hose.step(np.int64(2))
    assert hose.time == pytest.approx(0.01)


@pytest.mark.parametrize(
    "bad",
    [
        [1.0, 2.0],
        np.zeros((1, 3)),
        np.zeros((4, 2)),
        1.0,
        [np.nan, 0, 0],
        "fast",
        lambda s: s,
        lambda s: np.zeros((3, 3)),
    ],
)
def test_velocity_is_checked_before_anything_changes(make_hose, wave, bad):
    hose = make_hose(plane="xz")
    hose.reset(wave)
    hold, before = hose.attach(0.0), hose.control_points
    with pytest.raises(InputError, match=r"velocity.* valid: (finite|shape)"):
        hose.reset([[0, 0, 0], [1, 0, 0]], velocity=bad)
    np.testing.assert_array_equal(hose.control_points, before)
    hose.reaction(hold)


def test_velocity_as_rows_or_as_a_function(make_hose):
    hose = make_hose()
    straight, s = [[0, 0, 0], [1, 0, 0]], [0.0, 0.25, 1.0]
    rows = np.array([[0.0, 1.0, 2.0], [4.0, 1.0, -2.0]])
    hose.reset(straight, velocity=rows)
    np.testing.assert_allclose(hose.velocity(s), rows[:1] + np.outer(s, rows[1] - rows[0]))
    hose.reset(straight, velocity=lambda s: np.outer(s**3, [0.0, 1.0, 0.0]))
    np.testing.assert_allclose(hose.velocity(s)[:, 1], np.array(s) ** 3, atol=1e-13)


def test_a_planar_hose_stays_in_its_plane(make_hose):
    hose = make_hose(plane="xz")
    hose.reset([[0.0, 2.0, 0.0], [1.0, 2.0, 0.0]])
    assert hose.position(0.3)[0, 1] == 2.0
    hold = hose.attach(0.0)
    for call in (
        lambda: hose.move(hold, [0.0, 0.0, 0.0]),
        lambda: hose.clamp(0.5, tangent=[1.0, 0.1, 0.0]),
        lambda: hose.apply_force(0.5, [0.0, 0.1, 0.0]),
        lambda: hose.apply_moment(0.5, [0.1, 0.0, 0.0]),
        lambda: hose.reset([[0, 0, 0], [1, 0.1, 0]]),
        lambda: hose.reset([[0, 0, 0], [1, 0, 0]], velocity=[0.0, 1.0, 0.0]),
        lambda: make_hose(plane="xy"),  # gravity
    ):
        with pytest.raises(InputError, match="plane"):
            call()
    hose.step(3)
    assert hose.position(0.3)[0, 1] == 2.0


def test_control_points_in_and_out(make_hose):
    hose = make_hose(plane="xz", control_points=6)
    wanted = np.random.default_rng(0).normal(size=(6, 3)) * [1.0, 0.0, 1.0] + [0.0, 0.7, 0.0]
    hose.attach(0.0)
    hose.set_control_points(wanted)
    np.testing.assert_array_equal(hose.control_points, wanted)
    np.testing.assert_array_equal(hose.control_velocities, np.zeros((6, 3)))
    np.testing.assert_allclose(hose.position([0.0, 1.0]), wanted[[0, -1]], atol=1e-14)
    hose.attach(0.0)  # the hold from before is gone
    for bad in (wanted[:5], wanted * np.nan, np.eye(6, 3), "points"):
        with pytest.raises(InputError):
            hose.set_control_points(bad)
    np.testing.assert_array_equal(hose.control_points, wanted)


@planes
def test_a_clamp_turns_by_ninety_degrees_at_most(make_hose, plane):
    # The rows r' . e = 0 know no sign: a hose told to point back would not, and nobody would see.
    hose = make_hose(plane=plane, gravity=(0, 0, 0))
    with pytest.raises(InputError, match=r"tangent is .*within 90 degrees"):
        hose.clamp(0.0, tangent=[-1.0, 0.0, 0.1])
    clamp = hose.clamp(0.0)
    with pytest.raises(InputError, match="in steps"):
        hose.move(clamp, tangent=[-0.1, 0.0, 1.0])
    for angle in np.linspace(0.0, np.pi, 7)[1:]:
        hose.move(clamp, tangent=[np.cos(angle), 0.0, np.sin(angle)])
        hose.solve_static()
    np.testing.assert_allclose(hose.tangent(0.0)[0], [-1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(hose.position(1.0)[0], [-1.0, 0.0, 0.0], atol=1e-6)
