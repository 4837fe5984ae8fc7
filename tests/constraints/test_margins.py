"""Margins against closed forms, for footprints of every shape, and how they change with motion."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from hose_mj.constraints.limits import Limits
from hose_mj.constraints.monitor import Monitor
from hose_mj.world.centre_line import CentreLine

HOSE = 0.01
FAR = Limits(sight=10.0, own_arc=0.5, run_over_distance=0.0)
GEOMS = {
    "sphere": '<geom type="sphere" size=".1"/>',
    "capsule": '<geom type="capsule" size=".05 .1"/>',
    "ellipsoid": '<geom type="ellipsoid" size=".1 .05 .15"/>',
    "cylinder": '<geom type="cylinder" size=".1 .15"/>',
    "box": '<geom type="box" size=".1 .05 .15"/>',
    "mesh": '<geom type="mesh" mesh="wedge"/>',
    "two": '<geom type="box" size=".1 .05 .02"/><geom type="sphere" size=".06" pos=".2 0 .1"/>',
}
REACH = {"sphere": 0.1, "capsule": 0.05, "ellipsoid": 0.05, "cylinder": 0.1, "box": 0.05}
"""How far these reach from their centres towards y."""
BALL = GEOMS["sphere"]


def get(monitor, name):
    return monitor.measure()[monitor.names.index(name)]


def lay_over(world, y, x_end=2.0, z=0.5):
    """A straight hose at y along x, the tip at x_end, the source beyond all robots."""
    length = world.scene.spec.length
    start, end = np.array([x_end - length, y, z]), np.array([x_end, y, z])
    arcs = np.linspace(0.0, length, 9)
    world.line = CentreLine.of_chain(arcs, np.linspace(start, end, 9))


# -- the hose under robots -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", REACH)
def test_run_over_is_the_distance_to_the_surface_of_the_hose(make_world, kind):
    world = make_world(GEOMS[kind], BALL)  # sites at x = 2 and 1
    monitor = Monitor(world, FAR)
    for y in (0.9, 0.3, 0.061 + REACH[kind], 0.001 + REACH[kind]):
        lay_over(world, y, x_end=3.5)
        # Robot 0 holds the tip, so its own hose is at x > 3, out of the way.
        assert get(monitor, "run-over 0") == pytest.approx(y - REACH[kind] - HOSE, abs=2e-6)


@pytest.mark.parametrize("kind", GEOMS)
def test_a_hose_through_a_robot_is_run_over(make_world, kind):
    world = make_world(GEOMS[kind], BALL)
    monitor = Monitor(world, FAR)
    lay_over(world, 0.0, x_end=3.5, z=0.49)
    assert get(monitor, "run-over 0") < -HOSE
    found = monitor.check()
    assert found is not None
    assert "run-over" in [one.kind for one in monitor.breaks]


def test_what_robots_hold_themselves_does_not_count(make_world):
    """A straight hose through both robots: robot 1 meets its own hose 0.5 m of arc away."""
    world = make_world(BALL, BALL)
    monitor = Monitor(world, FAR)
    lay_over(world, 0.0)  # robot 0 at the tip, x = 2; robot 1 holds arc 2 m, which is at x = 0
    for own in (0.3, 0.5):
        world.put(1, (0.0, 0.0))
        monitor = Monitor(world, Limits(sight=10.0, own_arc=own, run_over_distance=0.0))
        assert get(monitor, "run-over 0") == pytest.approx(own - 0.1 - HOSE)
        assert get(monitor, "run-over 1") == pytest.approx(own - 0.1 - HOSE)
    # Both sides are left out, and nothing else: robot 0 at x = 0 runs over robot 1's hose.
    world.put(0, (0.0, 0.0, 1.0))
    assert get(monitor, "run-over 0") == pytest.approx(0.5 - 0.1 - HOSE)


@pytest.mark.parametrize(
    ("z", "wanted"),
    [(0.5, 0.2), (0.64, 0.2), (0.66, np.hypot(0.2, 0.01)), (1.0, np.hypot(0.2, 0.35))],
)
def test_a_puck_sees_the_hose_beside_it_across_and_above_it_in_space(make_world, z, wanted):
    world = make_world(GEOMS["cylinder"], BALL)
    monitor = Monitor(world, FAR)
    lay_over(world, 0.3, x_end=3.5, z=z)
    assert get(monitor, "run-over 0") == pytest.approx(wanted - HOSE)


def test_a_hose_right_above_a_puck_is_as_far_as_it_is_high(make_world):
    world = make_world(GEOMS["cylinder"], BALL)
    monitor = Monitor(world, FAR)
    lay_over(world, 0.05, x_end=3.5, z=0.9)
    assert get(monitor, "run-over 0") == pytest.approx(0.25 - HOSE)


def test_a_helix_around_a_robot(make_world, make_curve):
    """Around a ball at its middle a helix of radius R is R away."""
    world = make_world(BALL, GEOMS["mesh"])
    radius, turns, length = 0.4, 1.0, world.scene.spec.length
    pitch = np.sqrt(1.0 - (2 * np.pi * turns * radius / length) ** 2)
    w = 2 * np.pi * turns / length

    def curve(s):
        return np.stack(
            [2 + radius * np.cos(w * s), radius * np.sin(w * s), 0.5 + pitch * (s - 2.0)], axis=1
        )

    def slope(s):
        return np.stack(
            [-radius * w * np.sin(w * s), radius * w * np.cos(w * s), 0 * s + pitch], axis=1
        )

    world.line = make_curve(curve, slope, length)
    monitor = Monitor(world, FAR)
    assert get(monitor, "run-over 0") == pytest.approx(radius - 0.1 - HOSE, abs=1e-5)
    # The helix is as long as the hose: no lengthening, tension 0.
    assert get(monitor, "stretch 0") == pytest.approx(20.0)


# -- robots, obstacles, bounds ---------------------------------------------------------------------


@pytest.mark.parametrize("kind", REACH)
def test_robots_of_every_shape_collide(make_world, kind):
    world = make_world(GEOMS[kind], BALL)
    monitor = Monitor(world, FAR)
    for gap in (0.5, 0.05, 1e-4, -0.01):
        world.put(1, (2.0, REACH[kind] + 0.1 + gap))
        assert get(monitor, "collision 0-1") == pytest.approx(gap, abs=2e-6)


def test_upright_cylinders_beside_and_above_each_other(make_world):
    world = make_world(GEOMS["cylinder"], GEOMS["cylinder"])
    monitor = Monitor(world, FAR)
    for offset, wanted in {
        (0.3, 0.4, 0.0): 0.3,
        (0.3, 0.4, 0.29): 0.3,
        (0.3, 0.4, 0.7): 0.5,
        (0.1, 0.0, 0.45): 0.15,
        (0.03, 0.04, 0.0): -0.15,
        (0.0, 0.0, 0.28): -0.02,
    }.items():
        world.put(1, np.array([2.0, 0.0, 0.5]) + offset)
        assert get(monitor, "collision 0-1") == pytest.approx(wanted, abs=1e-12)


OBSTACLES = {
    "sphere": '<geom name="it" type="sphere" size=".2" pos="2 1 0.5"/>',
    "capsule": '<geom name="it" type="capsule" size=".2 .4" pos="2 1 0.5"/>',
    "cylinder": '<geom name="it" type="cylinder" size=".2 .4" pos="2 1 0.5"/>',
    "ellipsoid": '<geom name="it" type="ellipsoid" size=".3 .2 .4" pos="2 1 0.5"/>',
    "box": '<geom name="it" type="box" size=".5 .2 .4" pos="2 1 0.5"/>',
    "wall": '<geom name="it" type="plane" size="5 5 .1" pos="2 .8 0" zaxis="0 -1 0"/>',
    "moving": '<body><freejoint/><geom name="it" size=".2" pos="2 1 0.5"/></body>',
}


@pytest.mark.parametrize("kind", OBSTACLES)
@pytest.mark.parametrize("own", ["cylinder", "ellipsoid"])
def test_obstacles_of_every_shape(make_world, kind, own):
    """All of them reach to y = 0.8; the floor is farther away."""
    world = make_world(GEOMS[own], BALL, others=OBSTACLES[kind])
    monitor = Monitor(world, FAR)
    for gap in (0.3, 0.01, 1e-4, -0.005):
        world.put(0, (2.0, 0.8 - REACH[own] - gap))
        assert get(monitor, "obstacle 0") == pytest.approx(gap, abs=3e-6)
    found = monitor.check()
    assert (found.kind, found.robot, found.other) == ("obstacle", 0, "it")
    assert found.place[1] == pytest.approx(0.8, abs=0.3)


def test_a_mesh_and_a_height_field_stand_in_the_way(make_world):
    """The wedge's corner is its body's (-.1, -.1, -.1), its feet point along x, y and z."""
    mesh = '<geom name="it" type="mesh" mesh="wedge" pos="2 1 0.5"/>'
    world = make_world(BALL, BALL, others=mesh)
    monitor = Monitor(world, FAR)
    world.put(0, (1.95, 0.5, 0.45))
    assert get(monitor, "obstacle 0") == pytest.approx(0.9 - 0.5 - 0.1, abs=1e-6)
    hill = '<geom name="it" type="hfield" hfield="hill" pos="2 1 0.3"/>'
    world = make_world(BALL, BALL, others=hill)
    monitor = Monitor(world, FAR)
    world.put(0, (2.0, 1.0, 0.62))
    assert get(monitor, "obstacle 0") == pytest.approx(0.22, abs=1e-6)


def test_bounds_inside_and_outside(make_world):
    world = make_world(BALL, BALL, custom='<numeric name="bounds" data="-1 -2 3 2"/>')
    monitor = Monitor(world, FAR)
    for place, wanted in {
        (2.0, 0.0): 1.0,
        (0.0, 1.7): 0.3,
        (3.3, 0.0): -0.3,
        (3.3, 2.4): -0.5,
    }.items():
        world.put(0, place)
        assert get(monitor, "bounds 0") == pytest.approx(wanted)


def test_no_bounds_and_no_obstacles_have_no_margins(make_world):
    monitor = Monitor(
        make_world(
            BALL.replace("/>", ' contype="4" conaffinity="4"/>'),
            BALL.replace("/>", ' contype="4" conaffinity="4"/>'),
        )
    )
    assert set(monitor.kinds) == {"stretch", "run-over", "collision"}


# -- stretch ---------------------------------------------------------------------------------------


def test_tension_is_seen_at_joints_and_middles_of_either_kind(floor):
    """The peak of a tension that is straight between pieces' ends, or between their middles."""
    length, rng = floor.scene.spec.length, np.random.default_rng(0)
    monitor = Monitor(floor, Limits(max_tension=100.0))
    ends = np.linspace(0.0, length, 9)
    for nodes in (ends, np.concatenate([[0.0], 0.5 * (ends[1:] + ends[:-1]), [length]])):
        for _ in range(20):
            values = rng.uniform(0.0, 50.0, len(nodes))
            floor.pull = lambda s, x=nodes, y=values: np.interp(s, x, y)
            dense = np.linspace(0.0, length, 8001)
            pull = floor.pull(dense)
            tip, source = pull[dense > length / 2].max(), pull[dense < length / 2].max()
            margins = monitor.measure()
            assert margins[:2] == pytest.approx([100.0 - tip, 100.0 - source], abs=0.05)


def test_a_hose_that_is_too_long_is_broken_whatever_its_tension(floor):
    spec = floor.scene.spec
    margins = []
    for strain in (0.0, 0.099, 0.12):
        line = floor.line
        monitor = Monitor(floor)
        floor.line = CentreLine(line.arc_lengths, line.coefficients * (1.0 + strain))
        margins.append(monitor.measure()[0])
        floor.line = line
    assert margins == pytest.approx(
        [10.0, 0.001 * spec.axial_stiffness, -0.02 * spec.axial_stiffness]
    )


# -- how margins change ----------------------------------------------------------------------------


def make_state(world, rng):
    """A random curve and random places of the robots."""
    length = world.scene.spec.length
    arcs = np.linspace(0.0, length, 13)
    points = np.cumsum(rng.normal(size=(13, 3)), axis=0) * 0.15 + [1.0, 0.0, 0.5]
    world.line = CentreLine.of_spline(arcs, points, rng.normal(size=(13, 3)))
    for robot in range(world.n_robots):
        world.put(robot, rng.uniform((0.5, -0.7, 0.1), (2.0, 0.7, 1.0)))


@pytest.mark.parametrize("kind", GEOMS)
def test_turning_and_shifting_everything_changes_no_distance(make_world, make_rotation, kind):
    world = make_world(GEOMS[kind], GEOMS["box"], GEOMS["two"])
    monitor = Monitor(world, FAR)
    rng = np.random.default_rng(len(kind))
    for _ in range(5):
        world._start_bodies()
        make_state(world, rng)
        before = monitor.measure()
        turn, shift = make_rotation(rng), rng.normal(size=3)
        data, line = world.data, world.line
        data.geom_xpos[:] = data.geom_xpos @ turn.T + shift
        data.geom_xmat[:] = (turn @ data.geom_xmat.reshape(-1, 3, 3)).reshape(-1, 9)
        coefficients = line.coefficients @ turn.T
        coefficients[:, 0] += shift
        world.line = CentreLine(line.arc_lengths, coefficients)
        np.testing.assert_allclose(monitor.measure(), before, rtol=0.0, atol=5e-6)


@pytest.mark.parametrize("kind", GEOMS)
def test_a_small_move_changes_distances_by_no_more(make_world, kind):
    """Also where margins are cut at the sight, and where they come from MuJoCo on one side only."""
    world = make_world(
        GEOMS[kind],
        GEOMS["cylinder"],
        others=OBSTACLES["box"],
        custom='<numeric name="bounds" data="-1 -2 3 2"/>',
    )
    monitor = Monitor(world, Limits(sight=0.3, own_arc=0.5))
    distances = np.array(monitor.kinds) != "stretch"
    rng = np.random.default_rng(len(kind))
    for _ in range(20):
        make_state(world, rng)
        before = monitor.measure()
        for _ in range(10):
            step = 0.02 * rng.normal(size=3)
            world.put(0, world.site_positions()[0] + step)
            now = monitor.measure()
            change = np.abs(now - before)[distances]
            assert change.max() <= np.linalg.norm(step) + 5e-6
            before = now


def test_a_box_that_turns_meets_the_hose_with_its_corner(make_world):
    world = make_world(
        GEOMS["box"], BALL, turn='<joint name="robot{i}/turn" type="hinge" axis="0 0 1"/>'
    )
    monitor = Monitor(world, FAR)
    lay_over(world, 0.4, x_end=3.5)
    for angle in np.linspace(0.0, np.pi, 13):
        world.data.qpos[3] = angle
        world._update_poses()
        reach = 0.1 * abs(np.sin(angle)) + 0.05 * abs(np.cos(angle))
        assert get(monitor, "run-over 0") == pytest.approx(0.4 - reach - HOSE, abs=1e-9)


def test_chords_miss_a_bent_hose_by_their_sagitta_only(make_world, make_curve):
    """The hose as a circle about an ellipsoid, which is measured along chords."""
    world = make_world('<geom type="ellipsoid" size=".1 .1 .1"/>', BALL)
    length, radius = world.scene.spec.length, 0.8

    def curve(s):
        a = s / radius
        return np.stack([2 + radius * np.cos(a), radius * np.sin(a), 0 * s + 0.5], axis=1)

    def slope(s):
        return np.stack([-np.sin(s / radius), np.cos(s / radius), 0 * s], axis=1)

    world.line = make_curve(curve, slope, length, pieces=16)
    sagitta = (length / 16 / 4) ** 2 / radius / 8
    found = get(Monitor(world, FAR), "run-over 0")
    wanted = radius - 0.1 - HOSE
    assert wanted - 1.01 * sagitta - 1e-5 <= found <= wanted + 1e-5


def test_mujoco_is_asked_about_near_pairs_only(make_world, monkeypatch):
    """Robots of many geoms far apart cost no call; near each other, few."""
    many = "".join(f'<geom type="box" size=".02 .02 .02" pos="{0.05 * i} 0 0"/>' for i in range(8))
    world = make_world(many, many)
    monitor = Monitor(world, Limits(sight=0.3))
    calls = []
    measure = mujoco.mj_geomDistance
    monkeypatch.setattr(mujoco, "mj_geomDistance", lambda *a: calls.append(a) or measure(*a))
    world.put(1, (1.0, 1.0))
    monitor.measure()
    assert not calls
    world.put(1, (2.0, 0.2))
    assert get(monitor, "collision 0-1") == pytest.approx(0.16)
    assert 0 < len(calls) < 64 / 2
