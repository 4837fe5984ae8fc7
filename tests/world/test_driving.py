"""Servos: closed forms of their motion, limits, and robots of all kinds side by side."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.scenes.mjcf.scene import Scene, find_scene, list_scenes, read_scene
from hose_mj.world.actions import Actions
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.driving import BANDWIDTH, Driver
from hose_mj.world.world import World

WIDTH = BANDWIDTH


class BareWorld(World):
    """The scene's bodies alone; straight lines stand where the hose would be, and weigh nothing."""

    hose_model = "none"

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, scene.make_spec().compile())
        self.reset()

    @property
    def timestep(self) -> float:
        return float(self.model.opt.timestep)

    @property
    def time(self) -> float:
        return float(self.data.time)

    def reset(self) -> None:
        self._start_bodies()

    def step(self, n_steps: int = 1) -> None:
        for _ in range(n_steps):
            self._write_inputs()
            mujoco.mj_step(self.model, self.data)
        self._update_poses()

    def hose_position(self, arc_length):
        return self.centre_line().position(np.atleast_1d(arc_length))

    def hose_velocity(self, arc_length):
        return np.zeros((len(np.atleast_1d(arc_length)), 3))

    def tension(self, arc_length):
        return np.zeros(len(np.atleast_1d(arc_length)))

    def centre_line(self) -> CentreLine:
        return CentreLine.of_chain(self.arc_lengths[::-1], self.site_positions()[::-1])

    def attachment_forces(self):
        return np.zeros((len(self.sites), 3))

    def hose_snapshot(self) -> dict[str, Any]:
        return {}

    def restore_hose(self, state: dict[str, Any]) -> None:
        pass


SCENES: dict[str, Scene] = {}


def make_bare(name):
    if name not in SCENES:
        SCENES[name] = read_scene(find_scene(name))
    return BareWorld(SCENES[name])


def drive(driver, duration):
    world = driver.world
    for _ in range(round(duration / world.timestep)):
        driver.update()
        world.step()


def test_a_small_step_is_a_damped_oscillation():
    """m x'' = m w^2 e - (2 w m + c) x' with the puck's drag c: the sum of two exponentials."""
    world = make_bare("floor_1")
    world.model.opt.timestep = 1e-4
    driver = Driver(world)
    start, step = driver.targets[0, 0], 0.01
    driver.targets[0, 0] += step
    fall = 2.0 * WIDTH + 5.0 / 0.5
    root = math.sqrt(fall**2 - 4.0 * WIDTH**2)
    slow, fast = 0.5 * (fall - root), 0.5 * (fall + root)
    for _ in range(5):
        drive(driver, 0.05)
        t = world.time
        rest = (fast * math.exp(-slow * t) - slow * math.exp(-fast * t)) / (fast - slow)
        found = start + step - world.site_positions()[0, 0]
        assert found == pytest.approx(step * rest, abs=0.005 * step)


def test_no_speed_and_no_control_above_its_limit():
    world = make_bare("floor_1")
    driver = Driver(world, speed=0.4)
    driver.targets[0, :2] = -0.3, -0.3
    fastest = 0.0
    for _ in range(2000):
        drive(driver, world.timestep)
        fastest = max(fastest, driver.compute_speed(0))
        assert np.all(np.abs(world.control) <= 20.0)
    # 2 w m (v_max - v) = c v
    assert fastest == pytest.approx(0.4 / (1.0 + 5.0 / (2.0 * WIDTH * 0.5)), rel=1e-3)
    assert driver.compute_error(0) < 1e-4


def test_a_weak_and_heavy_robot_does_not_overshoot(write_scene):
    """Braking uses half the motors' strength: b = F / 2 m, v = sqrt(2 b d) on the way in."""
    world = write_scene(make_puck(0, "1 0 0.02", mass=40.0, gear=1.0, limit=20.0, damping=0.0))
    driver = Driver(world)
    driver.targets[0, 0] += 0.2
    farthest, fastest, at_limit = 0.0, 0.0, 0
    for _ in range(4000):
        drive(driver, world.timestep)
        farthest = max(farthest, world.site_positions()[0, 0] - 1.0)
        fastest = max(fastest, driver.compute_speed(0))
        at_limit += abs(abs(world.control[0]) - 20.0) < 1e-9
    assert at_limit > 100
    # v^2 / 2 a at full strength a = F / m, then v^2 / a at half of it, make 0.2 m.
    assert fastest == pytest.approx(math.sqrt(0.2 * 0.5 / 1.5), rel=0.05)
    assert farthest < 0.2 * 1.02
    assert driver.compute_error(0) < 1e-3


@pytest.mark.parametrize(
    ("mass", "gear", "damping", "angle"), [(0.3, 1, 0, 0), (2, 3, 0, 0), (0.5, 0.5, 0, 37)]
)
def test_gains_follow_mass_gear_and_axes(write_scene, mass, gear, damping, angle):
    """At rest the site's acceleration is w^2 e, in the direction of e, whatever the robot."""
    world = write_scene(
        make_puck(0, "1 0 0.02", mass, gear, limit=1e4, damping=damping, angle=angle)
    )
    driver = Driver(world)
    error = np.array([0.01, -0.004, 0.0])
    driver.targets[0] += error
    driver.update()
    world.step()
    found = world.site_velocities()[0] / world.timestep
    assert found == pytest.approx(WIDTH**2 * error, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", list_scenes())
def test_every_robot_reaches_the_next_cells(name):
    for robot in range(len(make_bare(name).scene.robots)):
        for action in ("right", "up", "left", "down"):
            world = make_bare(name)
            actions = Actions(Driver(world))
            before = world.site_positions()
            actions.begin(robot, action)
            while not actions.is_done():
                actions.update()
                world.step()
            after = world.site_positions()
            others = np.arange(len(before)) != robot
            assert np.linalg.norm((after - before)[others, :2], axis=1).max() < actions.tolerance
            assert not actions.stalled, (robot, action)
            away = np.linalg.norm(after[robot, :2] - actions.driver.targets[robot, :2])
            assert away <= actions.tolerance


def find_heading(world, robot):
    forward = world.data.body(f"robot{robot}/base").xmat[[0, 3]]
    return math.atan2(forward[1], forward[0])


@pytest.mark.parametrize("target", [(1, 0), (-1, 0), (0, 1), (0.7, -0.7), (-0.7, 0.7)])
def test_a_base_turns_no_more_than_it_must(target):
    """The line through the axle's middle, 0.16 m before the site, is to lead to the target."""
    world = make_bare("corridor")
    # Where there is room around it.
    world.data.joint("robot1/free").qpos[:2] = 0.0, 30.0
    world.step()
    driver = Driver(world)
    goal = driver.targets[1, :2] + target
    driver.targets[1, :2] = goal
    drive(driver, 5.0)
    assert np.linalg.norm(world.site_positions()[1, :2] - goal) < 0.01
    turned = math.degrees(find_heading(world, 1))
    needed = math.degrees(math.atan2(target[1], target[0] - 0.16))
    needed = (needed + 90.0) % 180.0 - 90.0  # forwards or backwards
    assert abs((turned - needed + 90.0) % 180.0 - 90.0) < 20.0  # it drives on as it turns
    assert abs(turned) < 110.0


def make_puck(number, place, mass=0.5, gear=1.0, limit=20.0, damping=5.0, angle=0.0):
    body = f"""
    <body name="robot{number}" pos="{place}">
      <joint name="x{number}" type="slide" axis="1 {math.tan(math.radians(angle))} 0"
             damping="{damping}"/>
      <joint name="y{number}" type="slide" axis="0 1 0" damping="{damping}"/>
      <geom type="cylinder" size="0.02 0.01" mass="{mass}"/>
      <site name="robot{number}/hose_attach"/>
    </body>"""
    motors = "".join(
        f'<motor joint="{axis}{number}" gear="{gear}" ctrlrange="{-limit} {limit}"/>'
        for axis in "xy"
    )
    return body, motors


ARM = (
    """
    <body name="robot2" pos="0.6 0.5 0.2">
      <joint name="shoulder" axis="0 0 1" damping="0.1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.5"/>
      <body pos="0.3 0 0">
        <joint name="elbow" axis="0 0 1" ref="0" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0 -0.3 0" size="0.02" mass="0.4"/>
        <site name="robot2/hose_attach" pos="0 -0.3 0"/>
      </body>
    </body>""",
    """<motor joint="shoulder" gear="2" ctrlrange="-5 5"/>
       <motor joint="elbow" ctrlrange="-5 5"/>""",
)


@pytest.fixture
def write_scene(tmp_path):
    """Writes a scene with robots, each a body and its actuators, and makes its bare world."""

    def write(*robots, length=4.0, extra=""):
        bodies, motors = ("".join(parts) for parts in zip(*robots, strict=True))
        path = tmp_path / "scene.xml"
        path.write_text(
            f"""<mujoco>
              <option timestep="0.002" integrator="implicitfast"/>
              <custom>
                <numeric name="hose_length" data="{length}"/>
                <text name="hose_material" data="garden-hose-19mm"/>
              </custom>
              <asset><model name="base" file="base.xml"/></asset>
              <worldbody>
                <geom name="floor" type="plane" size="9 9 0.1"/>
                <site name="hose_source" pos="0 0 0.02"/>
                <site name="goal" pos="1 1 0"/>{bodies}{extra}
              </worldbody>
              <actuator>{motors}</actuator>
            </mujoco>"""
        )
        base = find_scene("corridor").parent / "robots" / "base.xml"
        (tmp_path / "base.xml").write_bytes(base.read_bytes())
        return BareWorld(read_scene(path))

    return write


FLYER = (
    """
    <body name="robot3" pos="0.5 -0.5 0.6" gravcomp="1">
      <joint name="fx" type="slide" axis="1 0 0"/><joint name="fy" type="slide" axis="0 1 0"/>
      <joint name="fz" type="slide" axis="0 0 1"/>
      <geom type="sphere" size="0.05" mass="1"/><site name="robot3/hose_attach"/>
    </body>""",
    "".join(f'<motor joint="f{axis}" ctrlrange="-20 20"/>' for axis in "xyz"),
)
BASE = '<frame pos="2 0 0"><attach model="base" body="base" prefix="robot0/"/></frame>'


def test_robots_of_all_kinds_in_one_scene(write_scene):
    world = write_scene(make_puck(1, "1.2 0.3 0.02"), ARM, FLYER, extra=BASE)
    driver = Driver(world)
    assert driver.wheeled == (0,)
    assert driver.axes.tolist() == [2, 2, 2, 3]
    steps = np.array([[0.3, 0.2, 0], [-0.1, 0.1, 0], [-0.1, 0.15, 0], [0.1, 0.1, 0.2]])
    wanted = driver.targets + steps
    driver.drive_to(wanted)
    drive(driver, 4.0)
    for robot, axes in enumerate(driver.axes):
        away = (world.site_positions()[robot] - wanted[robot])[:axes]
        assert np.linalg.norm(away) < 5e-3, robot


def test_an_arm_pushes_with_the_wanted_force(write_scene):
    """Joint torques are J^T f: held by a wall of force -f at the site, nothing accelerates."""
    world = write_scene(ARM_ALONE)
    driver = Driver(world)
    driver.targets[0, :2] += (0.002, -0.001)
    driver.update()
    world.step()
    found = world.site_velocities()[0, :2] / world.timestep
    assert found == pytest.approx(WIDTH**2 * np.array([0.002, -0.001]), rel=0.02)


ARM_ALONE = tuple(part.replace("robot2", "robot0").replace('"0.1"', '"0"') for part in ARM)


def test_what_cannot_be_driven_is_said(write_scene):
    puck = make_puck(0, "1 0 0.02")
    position = puck[1].replace("<motor", '<position name="servo"', 1)
    with pytest.raises(InputError, match="actuator servo is 'no motor'; valid: a <motor>"):
        Driver(write_scene((puck[0], position)))
    one_motor = '<motor name="only" joint="x0" ctrlrange="-1 1"/>'
    with pytest.raises(InputError, match=r"motors of robot robot0 is \['only'\]; valid: motors t"):
        Driver(write_scene((puck[0], one_motor)))


def test_bad_targets_and_settings():
    world = make_bare("floor_2")
    driver = Driver(world)
    before = driver.targets.copy()
    for bad in ([[0, 0, 0]], np.full((2, 3), np.nan), "here"):
        with pytest.raises(InputError, match="targets"):
            driver.drive_to(bad)
    assert np.array_equal(driver.targets, before)
    with pytest.raises(InputError, match="bandwidth is 0"):
        Driver(world, bandwidth=0.0)
    with pytest.raises(InputError, match="speed is nan"):
        Driver(world, speed=math.nan)


def test_forces_of_the_mode_force():
    """m x'' = F - c x' for half a second, motors at rest; then the puck holds where it is."""
    world = make_bare("floor_1")
    driver = Driver(world)
    actions = Actions(driver, "force")
    start = world.site_positions()[0]
    actions.begin(0, "left")
    while not actions.is_done():
        actions.update()
        world.step()
    assert world.time == pytest.approx(0.5)
    rate = 5.0 / 0.5
    wanted = 2.0 / 5.0 * (0.5 - (1.0 - math.exp(-rate * 0.5)) / rate)
    moved = start - world.site_positions()[0]
    assert moved[:2] == pytest.approx([wanted, 0.0], rel=0.02, abs=1e-9)
    end = world.site_positions()[0]
    drive(driver, 1.0)
    assert np.linalg.norm(world.site_positions()[0] - end) < 1e-3
