"""A hose among obstacles, against closed forms."""

import numpy as np
import pytest

from hose_mj import HoseSpec
from hose_mj import make_hose as make_model
from hose_mj.errors import InputError, StepError
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.validation.random_states import N_STEPS, make_random_hose, set_random_obstacles

WEIGHT, RADIUS = 0.1 * 9.81, 0.01
FLOOR = Obstacle(kind="plane", friction=0.4)
LAW = ContactLaw(stiffness=2e4 / (np.pi * RADIUS**2), width=0.02 * RADIUS)
"""What the default law is for the hose of `make_hose`."""
REST = RADIUS + LAW.find_gap(WEIGHT)
"""Height at which the floor carries the weight (m)."""
UPRIGHT_Y = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Turns a cylinder's axis from z to y, across the xz-plane."""


def turn_about_y(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def lay_on_floor(hose, velocity=None):
    hose.reset([[0.0, 0.0, REST], [1.0, 0.0, REST]], velocity)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_hose_dropped_on_a_floor_comes_to_rest_there(make_hose, plane):
    hose = make_hose(plane=plane, damping=0.01)
    assert hose.contacts.add_floor(friction=0.4) == 0
    tilted = [[0.0, 0.0, 0.05], [1.0, 0.0, 0.15]]
    hose.reset(tilted)
    energies = [hose.energies().total]
    for _ in range(20):
        hose.step(30)
        energies.append(hose.energies().total)
    # What the floor's spring holds is not counted, so it may come back, but never more than it.
    assert np.all(np.diff(energies) < 1e-3 * energies[0])
    assert energies[-1] == pytest.approx(WEIGHT * REST, rel=1e-3)
    heights = hose.position(np.linspace(0, 1, 21))[:, 2]
    np.testing.assert_allclose(heights, REST, atol=1e-6)
    np.testing.assert_allclose(
        hose.contacts.compute_forces().sum(axis=0), [0, 0, WEIGHT], atol=1e-6
    )
    (reaction,) = hose.contacts.list_reactions()
    np.testing.assert_allclose(reaction.force, [0, 0, -WEIGHT], atol=1e-6)
    middle = hose.position(hose.contacts.arc_lengths).mean(axis=0)[0]
    np.testing.assert_allclose(reaction.moment, [0, WEIGHT * middle, 0], atol=1e-3)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_sliding_hose_stops_after_v_squared_over_two_mu_g(make_hose, plane):
    hose = make_hose(plane=plane)
    hose.set_obstacles([FLOOR])
    lay_on_floor(hose, (1.0, 0.0, 0.0))
    hose.step(20)
    assert hose.velocity(0.5)[0, 0] == pytest.approx(1.0 - 0.4 * 9.81 * 0.1, rel=1e-3)
    assert hose.contacts.compute_forces().sum(axis=0)[0] == pytest.approx(-0.4 * WEIGHT, rel=1e-3)
    hose.step(100)
    assert hose.position(0.0)[0, 0] == pytest.approx(1.0 / (2 * 0.4 * 9.81), rel=5e-3)
    assert abs(hose.velocity(0.5)[0, 0]) < 1e-4
    assert hose.fallbacks == 0


@pytest.mark.parametrize("steep", [0.5, 0.95])
def test_on_a_slope_below_the_friction_angle_nothing_moves(make_hose, steep):
    angle = np.arctan(0.4 * steep)
    hose = make_hose()
    slope = Obstacle(kind="plane", rotation=turn_about_y(angle), friction=0.4)
    hose.set_obstacles([slope])
    along, up = slope.rotation[:, 0], slope.rotation[:, 2]
    hose.reset([REST * up, along + REST * up])
    hose.step(20)
    start = hose.position(0.5)[0]
    hose.step(2000)
    assert np.linalg.norm(hose.position(0.5)[0] - start) < 1e-7
    pull = hose.contacts.compute_forces().sum(axis=0) @ along
    assert pull == pytest.approx(-WEIGHT * np.sin(angle), rel=1e-6)


def test_on_a_slope_above_the_friction_angle_it_slides(make_hose):
    angle = np.arctan(0.8)
    hose = make_hose()
    slope = Obstacle(kind="plane", rotation=turn_about_y(angle), friction=0.4)
    hose.set_obstacles([slope])
    along, up = slope.rotation[:, 0], slope.rotation[:, 2]
    hose.reset([REST * up, along + REST * up])
    hose.step(100)
    wanted = 9.81 * (np.sin(angle) - 0.4 * np.cos(angle)) * hose.time
    assert hose.velocity(0.5)[0] @ along == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("factor", [0.0, 0.5, 2.0])
def test_a_stretch_of_the_hose_rubs_by_its_factor(make_hose, factor):
    """On an incline: of the weight, .505 (the contact points up to .505 m) rubs as elsewhere."""
    angle = np.arctan(0.8)
    hose = make_hose()
    slope = Obstacle(kind="plane", rotation=turn_about_y(angle), friction=0.3)
    law = ContactLaw(friction_profile=[(0.0, 1.0, 7.0), (0.0, 0.6, 1.0), (0.505, 1.0, factor)])
    hose.set_obstacles([slope], law)
    along, up = slope.rotation[:, 0], slope.rotation[:, 2]
    hose.reset([REST * up, along + REST * up])
    hose.step(60)
    saved = hose.snapshot()
    rubs = 0.3 * (0.505 + 0.495 * factor)
    wanted = 9.81 * (np.sin(angle) - rubs * np.cos(angle)) * hose.time
    assert hose.momentum().linear @ along / 0.1 == pytest.approx(wanted, rel=2e-3)
    hose.step(5)
    ended = hose.control_points
    hose.set_obstacles([slope])
    hose.restore(saved)
    hose.step(5)
    np.testing.assert_array_equal(hose.control_points, ended)


@pytest.mark.parametrize(
    "profile", [[(0.2, 0.1, 1.0)], [(0.0, 1.0, -1.0)], [(0.0, np.nan, 1.0)], [1.0], "grease"]
)
def test_a_wrong_friction_profile_is_refused(profile):
    with pytest.raises(InputError, match=r"friction_profile is .* valid: rows of from, to"):
        ContactLaw(friction_profile=profile)


def test_a_friction_profile_is_one_of_the_spline(make_hose):
    law = ContactLaw(friction_profile=((0.5, 1.5, 0.0),))
    with pytest.raises(InputError, match=r"friction_profile .* from 0 to 1 "):
        make_hose().set_obstacles([FLOOR], law)
    spec = HoseSpec(length=1.0, axial_stiffness=2e4, bending_stiffness=0.05, linear_density=0.1)
    with pytest.raises(InputError, match="contact_law"):
        make_model("cable", spec, contact_law=law)


def test_a_belt_carries_the_hose_along(make_hose):
    hose = make_hose()
    hose.set_obstacles([Obstacle(kind="plane", friction=0.4, velocity=(0.3, 0.4, 0.0))])
    lay_on_floor(hose)
    hose.step(10)
    # mu g along the belt until the hose has its speed, after .13 s.
    speed = 0.4 * 9.81 * hose.time
    np.testing.assert_allclose(hose.velocity(0.5)[0, :2], speed * np.array([0.6, 0.8]), rtol=2e-3)
    hose.step(100)
    np.testing.assert_allclose(hose.velocity(0.5)[0, :2], [0.3, 0.4], atol=1e-4)
    hose.contacts.move_obstacle(0, velocity=(0.0, 0.0, 0.0))
    hose.step(100)
    np.testing.assert_allclose(hose.velocity(0.5)[0], 0.0, atol=1e-4)


def test_a_rising_floor_lifts_the_hose(make_hose):
    hose = make_hose()
    hose.set_obstacles([FLOOR])
    lay_on_floor(hose)
    for k in range(100):
        hose.contacts.move_obstacle(
            0, position=(0.0, 0.0, 1e-3 * (k + 1)), velocity=(0.0, 0.0, 0.2)
        )
        hose.step()
    assert hose.position(0.5)[0, 2] == pytest.approx(0.1 + REST, abs=1e-4)
    assert hose.velocity(0.5)[0, 2] == pytest.approx(0.2, rel=1e-2)
    assert hose.contacts.compute_forces().sum(axis=0)[2] == pytest.approx(WEIGHT, rel=1e-2)


@pytest.mark.parametrize("plane", [None, "xz"])
@pytest.mark.parametrize("points", [24, 36])
def test_capstan(make_hose, plane, points):
    radius, friction, force = 0.1, 0.3, 1.0
    hose = make_hose(
        ea=2e8, ei=1e-5, damping=0.01, plane=plane, control_points=points, gravity=(0, 0, 0)
    )
    drum = Obstacle(kind="cylinder", rotation=UPRIGHT_Y, size=(radius, 0.2), friction=friction)
    hose.set_obstacles([drum])
    bend = radius + RADIUS
    leg = (1.0 - np.pi * bend) / 2

    def curve(s):
        angle = np.clip((s - leg) / bend, 0.0, np.pi)
        down = np.maximum(leg - s, 0.0) + np.maximum(s - 1.0 + leg, 0.0)
        return np.stack([-bend * np.cos(angle), 0.0 * s, bend * np.sin(angle) - down], axis=1)

    hose.reset(curve)
    hose.apply_force(0.0, (0.0, 0.0, -force))
    hold = hose.attach(1.0)
    place, pulls = hose.position(1.0)[0], []
    for _ in range(300):
        place = place - [0.0, 0.0, 0.05 * hose.timestep]
        hose.move(hold, place)
        hose.step()
        pulls.append(-hose.reaction(hold).force[2])
    assert np.mean(pulls[150:]) / force == pytest.approx(np.exp(friction * np.pi), rel=0.01)


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "box"])
@pytest.mark.parametrize("speed", [0.0, 5.0])
def test_hose_thrown_at_an_obstacle_comes_to_rest(make_hose, kind, speed):
    hose = make_hose(ei=0.01, damping=0.005, control_points=20)
    obstacle = Obstacle(
        kind=kind, position=(0.1, 0.0, 0.1), rotation=UPRIGHT_Y, size=(0.08, 0.08, 0.08)
    )
    hose.set_obstacles([obstacle, FLOOR])
    hose.reset([[-0.5, 0.003, 0.4], [0.5, 0.0, 0.4]], (0.0, 0.0, -speed))
    start = hose.energies().total
    hose.step(600)
    assert np.all(np.isfinite(hose.control_points))
    energies = hose.energies()
    assert energies.total < 0.5 * start
    assert energies.kinetic < 1e-3 * start
    reactions = hose.contacts.list_reactions()
    total = sum(reaction.force for reaction in reactions)
    np.testing.assert_allclose(total[2], -WEIGHT, rtol=0.05)


def test_momentum_lost_is_the_impulse_on_the_obstacle(make_hose):
    hose = make_hose(gravity=(0, 0, 0), scheme="backward-euler", tolerance=1e-12, max_iterations=60)
    ball = Obstacle(kind="sphere", position=(0.3, 0.02, -0.1), size=0.08, friction=0.4)
    hose.set_obstacles([ball])
    hose.reset([[0, 0, 0], [1, 0, 0]], (0.3, 0.0, -2.0))
    impulse, before, most = np.zeros(3), hose.momentum().linear, 0.0
    for _ in range(30):
        hose.step()
        (reaction,) = hose.contacts.list_reactions()
        impulse += reaction.force * hose.timestep
        most = max(most, np.linalg.norm(reaction.force))
    assert most > 1.0
    np.testing.assert_allclose(before - hose.momentum().linear, impulse, atol=1e-9)


def test_the_motion_turns_with_the_scene(make_hose):
    rng = np.random.default_rng(10)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    box = Obstacle(kind="box", position=(0.3, 0.0, -0.2), size=(0.1, 0.3, 0.1), friction=0.3)
    shift, curve = rng.normal(size=3), np.array([[0.0, 0, 0], [1.0, 0, 0]])
    one = make_hose(tolerance=1e-10)
    one.set_obstacles([box])
    one.reset(curve)
    other = make_hose(tolerance=1e-10, gravity=turn @ one.gravity)
    other.set_obstacles(
        [
            Obstacle(
                kind="box",
                position=turn @ box.position + shift,
                rotation=turn,
                size=box.size,
                friction=0.3,
            )
        ]
    )
    other.reset(curve @ turn.T + shift)
    one.step(60)
    other.step(60)
    assert np.linalg.norm(one.contacts.list_reactions()[0].force) > 0.1
    np.testing.assert_allclose(other.control_points, one.control_points @ turn.T + shift, atol=1e-7)
    np.testing.assert_allclose(
        other.contacts.list_reactions()[0].moment,
        turn @ one.contacts.list_reactions()[0].moment,
        atol=1e-5,
    )


def test_a_hose_in_a_plane_meets_a_scene_in_space(make_hose):
    ball = Obstacle(kind="sphere", position=(0.4, 0.0, -0.15), size=0.1)
    ends = []
    for plane in (None, "xz"):
        hose = make_hose(plane=plane, tolerance=1e-10)
        hose.set_obstacles([ball])
        hose.step(60)
        assert hose.contacts.compute_forces().any()
        ends.append(hose.control_points)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


def test_static_hose_over_a_drum_is_where_it_comes_to_rest(make_hose):
    drum = Obstacle(
        kind="cylinder", position=(0.5, 0, -0.1), rotation=UPRIGHT_Y, size=(0.09, 0.3), friction=0
    )
    hose = make_hose(ei=0.005, damping=0.05, drag=0.3, plane="xz")
    hose.set_obstacles([drum])
    hose.clamp(0.0, (0, 0, 0), (1, 0, 0))
    hose.step(2000)
    rest = hose.position(np.linspace(0, 1, 11))
    hose.reset([[0, 0, 0], [1, 0, 0]])
    hose.clamp(0.0, (0, 0, 0), (1, 0, 0))
    hose.solve_static(4)
    np.testing.assert_allclose(hose.position(np.linspace(0, 1, 11)), rest, atol=1e-4)
    carried = hose.contacts.compute_forces().sum(axis=0)[2]
    assert 0.2 * WEIGHT < carried < WEIGHT


def test_inverse_dynamics_counts_contact(make_hose):
    hose = make_hose()
    hose.set_obstacles([FLOOR])
    lay_on_floor(hose, (1.0, 0.0, 0.0))
    hose.step()  # friction is known of what has moved
    needed = hose.compute_required_forces(np.zeros((16, 3)))
    # The floor carries the weight; to slide on at one speed takes mu W.
    np.testing.assert_allclose(needed.sum(axis=0), [0.4 * WEIGHT, 0.0, 0.0], atol=1e-5)


def test_distances_handed_in_do_what_the_shape_does(make_hose):
    ends = []
    for handed in (False, True):
        hose = make_hose(tolerance=1e-10)
        hose.set_obstacles([] if handed else [FLOOR])
        hose.reset([[0, 0, 0.02], [1, 0, 0.06]], (0.4, 0.1, 0.0))
        for _ in range(60):
            if handed:
                heights = hose.position(hose.contacts.arc_lengths)[:, 2]
                hose.contacts.set_distances(heights, (0.0, 0.0, 1.0), 0.4)
            hose.step()
        assert hose.contacts.compute_forces().any()
        ends.append(hose.control_points)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-8)
    hose.contacts.set_distances(None)
    assert not hose.contacts.compute_forces().any()


def test_far_obstacles_change_nothing(make_hose):
    ends = []
    for obstacles in ([], [Obstacle(kind="box", position=(9, 0, 0), size=(1, 1, 1))] * 3):
        hose = make_hose()
        hose.set_obstacles(obstacles)
        hose.step(40)
        ends.append(hose.control_points)
    np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.parametrize("plane", [None, "xz"])
def test_snapshot_among_obstacles_restores_bitwise(make_hose, plane):
    hose = make_hose(plane=plane)
    ball = Obstacle(kind="sphere", position=(0.4, 0.0, -0.15), size=0.1, velocity=(0, 0, 0.1))
    hose.set_obstacles(
        [ball, Obstacle(kind="plane", position=(0, 0, -0.3))], ContactLaw(width=1e-4)
    )
    hose.step(40)
    hose.contacts.move_obstacle(0, position=(0.41, 0.0, -0.14))
    saved = hose.snapshot()
    hose.step(20)
    wanted = hose.control_points
    hose.set_obstacles([])
    hose.reset([[0, 0, 0], [0, 0, -1]])
    hose.restore(saved)
    assert [one.kind for one in hose.contacts.obstacles] == ["sphere", "plane"]
    assert hose.contacts.obstacles[0].position[0] == 0.41
    hose.step(20)
    np.testing.assert_array_equal(hose.control_points, wanted)


def test_obstacles_stay_through_a_reset(make_hose):
    hose = make_hose(plane="xz")
    hose.contacts.add_floor(-0.2)
    hose.contacts.add_floor(-0.1)
    hose.reset([[0, 3.0, 0], [1, 3.0, 0]])
    hose.step(100)
    assert hose.position(0.5)[0, 2] == pytest.approx(-0.1 + RADIUS, abs=1e-3)


def test_wrong_obstacles_are_refused(make_hose):
    hose = make_hose()
    with pytest.raises(InputError, match="obstacles"):
        hose.set_obstacles(["a box"])
    with pytest.raises(InputError, match="obstacle"):
        hose.contacts.move_obstacle(0, position=(0, 0, 0))
    hose.contacts.add_floor()
    with pytest.raises(InputError, match="position"):
        hose.contacts.move_obstacle(0, position=(0, 0, np.nan))
    with pytest.raises(InputError, match="distances"):
        hose.contacts.set_distances(np.zeros(3))
    with pytest.raises(InputError, match="distances"):
        hose.contacts.set_distances(np.full(len(hose.contacts.arc_lengths), np.nan))
    with pytest.raises(InputError, match="scheme"):
        make_hose(scheme="verlet").contacts.add_floor()


@pytest.mark.filterwarnings("ignore::hose_mj.HoseWarning")
def test_random_states_among_obstacles_stay_finite():
    rng = np.random.default_rng(11)
    verdicts = touched = 0
    for _ in range(150):
        hose = make_random_hose(rng)
        set_random_obstacles(hose, rng)
        for _ in range(N_STEPS):
            before = hose.control_points
            try:
                hose.step()
            except StepError:
                verdicts += 1
                np.testing.assert_array_equal(hose.control_points, before)
                break
            touched += bool(hose.contacts.compute_forces().any())
            assert np.all(np.isfinite(hose.control_points))
            assert np.all(np.isfinite(hose.control_velocities))
    assert touched > 150
    assert verdicts <= 3


def test_names_that_moved_to_a_part_say_where(make_hose):
    hose = make_hose()
    with pytest.warns(DeprecationWarning, match="add_floor is now GedsHose.contacts.add_floor"):
        assert hose.add_floor(-1.0) == 0
    with pytest.warns(DeprecationWarning, match="contacts.obstacles"):
        assert hose.obstacles is hose.contacts.obstacles
    with pytest.warns(DeprecationWarning, match="contacts.list_reactions"):
        assert len(hose.contact_reactions()) == 1
    with pytest.raises(AttributeError, match="'no_such_name'"):
        _ = hose.no_such_name
