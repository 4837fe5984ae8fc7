"""Pucks in compiled code move as MuJoCo moves them, and go back to it where they may touch."""

import numpy as np
import pytest

from hose_mj.world.driving import Driver
from hose_mj.world.geds_world import GedsWorld
from hose_mj.world.registry import make_world


def run_both(scene, n_steps, control, **options):
    """The same motion with and without compiled pucks; returns the worlds."""
    worlds = [make_world(scene, compiled_pucks=fast, **options) for fast in (True, False)]
    for world in worlds:
        world.control[:] = control
        world.step(n_steps)
    return worlds


@pytest.mark.parametrize("scheme", ["bdf2", "backward-euler", "sdirk2"])
def test_pucks_move_as_mujoco_moves_them(scheme):
    fast, slow = run_both("floor_3", 150, [2.0, 1.0, -1.5, 1.0, 0.5, -2.0], scheme=scheme)
    assert slow.coupling_iterations >= 150
    assert fast.coupling_iterations < 150
    for quantity in ("qpos", "qvel", "site_xpos"):
        one, other = getattr(fast.data, quantity), getattr(slow.data, quantity)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)
    s = np.linspace(0.0, 0.8, 33)
    np.testing.assert_allclose(fast.hose_position(s), slow.hose_position(s), rtol=0, atol=1e-8)
    np.testing.assert_allclose(fast.tension(s), slow.tension(s), atol=1e-4)
    assert fast.time == slow.time == pytest.approx(fast.data.time)


def test_a_puck_that_runs_over_the_hose_feels_it_as_mujoco_lets_it():
    worlds = [make_world("floor_2", compiled_pucks=fast) for fast in (True, False)]
    pushed = []
    for world in worlds:
        driver = Driver(world)
        target = world.site_positions()[:-1]
        target[0] = world.hose_position([0.2])[0]
        driver.drive_to(target)
        for _ in range(230):
            driver.update()
            world.step()
        pushed.append(world._contact.pushes[:, :3].sum(axis=0))
    assert np.abs(pushed[0][:2]).max() > 0.01
    np.testing.assert_allclose(pushed[0], pushed[1], atol=1e-5)
    np.testing.assert_allclose(worlds[0].data.qpos, worlds[1].data.qpos, atol=1e-8)
    assert worlds[0].coupling_iterations < 230


def test_pucks_that_may_meet_are_mujocos(write_scene):
    robots = [
        write_scene.slider(0, (0.6, 0.0, 0.0), 0.5, axes="x"),
        write_scene.slider(1, (0.4, 0.0, 0.0), 0.5, axes="x"),
    ]
    scene = write_scene(robots, timestep=0.002)
    worlds = [GedsWorld(scene, compiled_pucks=fast) for fast in (True, False)]
    for world in worlds:
        world.apply_force(0, (-5.0, 0.0, 0.0))
        world.apply_force(1, (5.0, 0.0, 0.0))
        world.step(300)
    fast, slow = worlds
    gap = np.linalg.norm(np.diff(fast.site_positions()[:2], axis=0))
    assert 0.035 < gap < 0.041  # pressed against each other, MuJoCo's contact a little soft
    np.testing.assert_allclose(fast.data.qpos, slow.data.qpos, atol=1e-7)
    assert 0 < fast.coupling_iterations < slow.coupling_iterations


@pytest.mark.parametrize(
    "change",
    [
        'damping="5" stiffness="3"',
        'damping="5" frictionloss="0.1"',
        'damping="5" limited="true" range="-1 1"',
    ],
)
def test_what_is_more_than_a_puck_is_mujocos(write_scene, change):
    robot = write_scene.slider(0, (0.6, 0.0, 0.0), 0.5, axes="xy", damping=5)
    assert GedsWorld(write_scene([robot]))._point_robots is not None
    changed = robot.replace('damping="5"', change)
    assert GedsWorld(write_scene([changed]))._point_robots is None


def test_weight_and_slides_that_are_not_there_count(write_scene):
    # A body on x and z alone falls freely beside its hose, which is light.
    robot = write_scene.slider(0, (0.5, 0.0, 0.0), 2.0, axes="xz", solid=False)
    world = GedsWorld(write_scene([robot], gravity="0 0 -9.81", linear_density=1e-3))
    assert world._point_robots is not None
    world.step(40)
    fallen = -float(world.site_positions()[0, 2])
    t = 40 * world.timestep
    assert fallen == pytest.approx(0.5 * 9.81 * t * (t + world.timestep), rel=5e-3)
    assert world.site_positions()[0, 1] == 0.0
