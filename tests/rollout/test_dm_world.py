"""Worlds as dm_control environments: the contract of dm_env, and dm_control's viewer."""

from __future__ import annotations

import os
import subprocess
import sys

import dm_env
import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.rollout.dm_world import HOSE, N_PIECES, load


@pytest.fixture
def env():
    return load("floor_2", control_timestep=0.02, time_limit=1.0)


def test_specs_hold(env):
    action = env.action_spec()
    assert action.shape == (env.physics.world.model.nu,)
    assert np.array_equal(action.maximum, np.full(4, 20.0))
    seen = env.observation_spec()
    step = env.reset()
    assert step.step_type is dm_env.StepType.FIRST
    generator = np.random.default_rng(0)
    for _ in range(10):
        for name, spec in seen.items():
            spec.validate(step.observation[name])
        assert set(step.observation) == set(seen)
        step = env.step(generator.uniform(-1.0, 1.0, 4))
        assert step.step_type is dm_env.StepType.MID
        assert (step.reward, step.discount) == (0.0, 1.0)
    assert env.control_timestep() == pytest.approx(0.02)
    assert env.physics.time() == pytest.approx(0.2)


def test_observations_are_the_worlds_and_no_views_of_it(env):
    before = env.reset().observation
    kept = {name: value.copy() for name, value in before.items()}
    env.step(np.full(4, 5.0))
    for name, value in kept.items():
        assert np.array_equal(before[name], value)
    world = env.physics.world
    assert np.array_equal(kept["goal"], world.goal_position())
    assert np.linalg.norm(world.site_positions()[0] - kept["positions"][0]) > 1e-4


def test_the_time_limit_cuts_off_and_a_new_episode_starts(env):
    env.reset()
    steps = [env.step(np.zeros(4)) for _ in range(50)]
    assert [step.last() for step in steps] == [False] * 49 + [True]
    assert steps[-1].discount == 1.0
    assert env.step(np.zeros(4)).first()
    assert env.physics.time() == 0.0


def test_a_break_ends_an_episode_at_its_step(env):
    env.reset()
    while not (step := env.step(np.array([0.0, 20.0, 0.0, 0.0]))).last():
        pass
    assert (step.reward, step.discount) == (-1.0, 0.0)
    broken = env.physics.broken
    assert broken.time <= env.physics.time() <= broken.time + env.physics.timestep()
    assert env.reset().observation["margins"].min() > 0.0
    assert env.physics.broken is None


def test_the_goal_ends_an_episode(env):
    env.reset()
    world = env.physics.world
    world.data.qpos[:2] += (world.goal_position() - world.site_positions()[0])[:2]
    env.physics.broken = None
    assert env.task.get_reward(env.physics) == 0.0
    env.physics.world._update_poses()
    assert env.task.get_reward(env.physics) == 1.0
    assert env.task.get_termination(env.physics) == 0.0


def test_what_is_seen_follows_the_world(env):
    env.reset()
    for _ in range(10):
        env.step(np.array([1.0, -1.0, 0.5, 0.0]))
    physics, world = env.physics, env.physics.world
    assert np.array_equal(physics.data.site_xpos[world.sites], world.site_positions())
    pieces = [physics.named.data.xpos[f"{HOSE}{k}"] for k in range(N_PIECES)]
    arcs = np.linspace(0.0, world.scene.spec.length, N_PIECES + 1)
    points = world.hose_position(arcs)
    assert np.array(pieces) == pytest.approx(0.5 * (points[1:] + points[:-1]))
    # Nothing that a viewer writes reaches the world.
    before = world.snapshot()
    physics.data.xfrc_applied[:] = 5.0
    physics.data.qpos[:] += 1.0
    env.step(np.zeros(4))
    after = world.site_positions()
    world.restore(before)
    world.control[:] = 0.0
    world.step(10)
    assert np.array_equal(world.site_positions(), after)


def test_state_is_a_snapshot(env):
    env.reset()
    env.step(np.ones(4))
    state = env.physics.get_state()
    runs = []
    for _ in range(2):
        env.physics.set_state(state)
        runs.append([env.step(np.full(4, -2.0)).observation["hose"] for _ in range(3)])
    assert np.array_equal(runs[0], runs[1])


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"control_timestep": 0.003}, "control_timestep is 0.003; valid: a multiple of the world'"),
        ({"control_timestep": float("nan")}, "control_timestep is nan"),
        ({"time_limit": 0.0}, "time_limit is 0.0; valid: a number above 0"),
        ({"model": "string"}, "model is 'string'; valid: one of geds"),
    ],
)
def test_bad_options(options, what):
    with pytest.raises(InputError, match=what):
        load("floor_2", **options)


VIEWER = """
from unittest import mock
from dm_control.viewer import application
from hose_mj.rollout.dm_world import load

class Window:
    shape = (320, 240)
    def __init__(self, width, height, title):
        self.mouse, self.keyboard = mock.MagicMock(), mock.MagicMock()
    def close(self):
        pass
    def event_loop(self, tick_func):
        for _ in range(3):
            pixels = tick_func()
        print("shown", pixels.shape, pixels.std() > 5.0)

with mock.patch.object(application.gui, "RenderWindow", Window):
    app = application.Application(width=320, height=240)
    app._pause_subject.value = False
    env = load("floor_2")
    app.launch(lambda: env)
print("time", env.physics.time() > 0.0)
"""


def test_dm_controls_viewer_shows_it():
    """All of the viewer but its window, in a process of its own: it picks OpenGL at import."""
    done = subprocess.run(
        [sys.executable, "-c", VIEWER],
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | {"MUJOCO_GL": "egl"},
    )
    if "EGL" in done.stderr and done.returncode:
        pytest.skip("needs EGL: " + done.stderr.splitlines()[-1])
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:2] == ["shown (240, 320, 3) True", "time True"]
