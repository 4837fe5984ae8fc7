"""What a robot is, and what can be in its way."""

from __future__ import annotations

import numpy as np
import pytest

from hose_mj.constraints.footprints import find_hose_bodies, find_obstacles, make_footprint
from hose_mj.constraints.limits import Limits
from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import InputError
from hose_mj.scenes.mjcf.scene import find_scene, read_scene

BALL = '<geom type="sphere" size=".1"/>'


def name_obstacles(world, ground=()):
    footprints = [make_footprint(world, i) for i in range(world.n_robots)]
    geoms, may_hit = find_obstacles(world, footprints, ground)
    assert may_hit.shape == (sum(len(f.geoms) for f in footprints), len(geoms))
    return [world.model.geom(g).name for g in geoms]


def test_a_puck_is_one_upright_disc(floor):
    footprint = make_footprint(floor, 0)
    assert [floor.model.geom(g).name for g in footprint.geoms] == ["robot0/disc"]
    assert footprint.radius == pytest.approx(0.02)
    assert footprint.upright


@pytest.mark.parametrize(
    ("geoms", "radius"),
    [
        (BALL, 0.1),
        ('<geom type="box" size=".3 .4 .2" pos="1 2 0"/>', 0.5),
        ('<geom type="capsule" size=".1 .2" euler="0 90 0"/>', 0.3),
        ('<geom type="ellipsoid" size=".1 .3 .2"/>', 0.3),
        ('<geom size=".1" pos="-.5 0 0"/><geom size=".1" pos=".5 0 1"/>', 0.6),
        (
            '<geom type="box" size=".1 .1 .1"/><geom size="9" contype="0" conaffinity="0"/>',
            0.02**0.5,
        ),
        ('<geom type="box" size=".3 .4 .1" contype="0" conaffinity="0"/>', 0.5),
    ],
)
def test_radius_about_the_middle_of_what_collides(make_world, geoms, radius):
    assert make_footprint(make_world(geoms, BALL), 0).radius == pytest.approx(radius)


def test_a_cylinder_that_can_tip_is_no_disc(make_world):
    tower = '<geom type="cylinder" size=".1 .2"/>'
    assert make_footprint(make_world(tower, BALL), 0).upright
    lying = '<geom type="cylinder" size=".1 .2" euler="90 0 0"/>'
    assert not make_footprint(make_world(lying, BALL), 0).upright
    joint = '<joint name="robot{{i}}/turn" type="hinge" axis="{}"/>'
    assert make_footprint(make_world(tower, BALL, turn=joint.format("0 0 1")), 0).upright
    assert not make_footprint(make_world(tower, BALL, turn=joint.format("1 0 0")), 0).upright
    two = tower + '<geom type="cylinder" size=".05 .2"/>'
    assert not make_footprint(make_world(two, BALL), 0).upright


def test_a_robot_without_geoms_is_refused(make_world):
    world = make_world("<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>", BALL)
    with pytest.raises(InputError, match="geoms of robot0"):
        Monitor(world)


def test_what_robots_stand_on_is_no_obstacle(make_world):
    """Balls at z = 0.5: one on a block, one above a low floor, a wall beside it nearly touching."""
    block = '<geom name="block" type="box" size=".2 .2 .2" pos="2 0 0.2"/>'
    wall = '<geom name="wall" type="box" size=".01 1 1" pos="2.112 0 1"/>'
    world = make_world(BALL, BALL, others=block + wall)
    assert name_obstacles(world) == ["floor", "block", "wall"]  # robot 1 may hit the block
    footprint = make_footprint(world, 0)
    geoms, may_hit = find_obstacles(world, [footprint], ())
    assert [world.model.geom(g).name for g in geoms] == ["floor", "wall"]
    assert may_hit.all()


@pytest.mark.parametrize(("angle", "is_ground"), [(30, True), (44, True), (46, False), (90, False)])
def test_ground_is_not_steeper_than_45_degrees(make_world, angle, is_ground):
    """A ball of 0.1 m touches a plane that is tilted so much, 1 mm away from it."""
    tilt = np.radians(angle)
    x, z = 2.0 + 0.101 * np.sin(tilt), 0.5 - 0.101 * np.cos(tilt)
    plane = f'<geom name="slope" type="plane" size="5 5 1" pos="{x} 0 {z}" euler="0 {-angle} 0"/>'
    world = make_world(BALL, others=plane, length=6.0)
    assert ("slope" in name_obstacles(world)) == (not is_ground)


def test_what_cannot_collide_is_no_obstacle(make_world):
    ghost = '<geom name="ghost" size=".1" pos="2 1 0.5" contype="0" conaffinity="0"/>'
    other = '<geom name="other" size=".1" pos="2 1 0.5" contype="2" conaffinity="2"/>'
    solid = '<geom name="solid" size=".1" pos="2 1 0.5" contype="2" conaffinity="1"/>'
    world = make_world(BALL, others=ghost + other + solid)
    assert name_obstacles(world) == ["floor", "solid"]
    assert name_obstacles(world, ground=("solid",)) == ["floor"]


@pytest.mark.parametrize(
    ("name", "robots_stand_on_it"), [("corridor", True), ("deck", True), ("lift", False)]
)
def test_the_floor_of_shipped_scenes(make_fake, name, robots_stand_on_it):
    found = name_obstacles(make_fake(read_scene(find_scene(name))))
    assert ("floor" in found) == (not robots_stand_on_it)
    assert len(found) >= 6


def test_the_floors_have_nothing_in_the_way(floor):
    assert name_obstacles(floor) == []
    assert "obstacle" not in Monitor(floor, Limits()).kinds


def test_bodies_of_the_hose_are_those_that_the_scene_does_not_have(floor):
    assert len(find_hose_bodies(floor)) == 0
    spec = floor.scene.make_spec()
    body = spec.worldbody.add_body(name="hose/first")
    body.add_body(name="hose/second").add_geom(size=[0.01, 0.0, 0.0])
    floor.model = spec.compile()
    names = [floor.model.body(b).name for b in find_hose_bodies(floor)]
    assert names == ["hose/first", "hose/second"]
