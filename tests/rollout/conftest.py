"""A world that moves on rails: robots and hose follow closed forms, no physics in between."""

from types import SimpleNamespace

import numpy as np
import pytest

from hose_mj.scenes.mjcf.scene import find_scene, read_scene
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.world import World


class RailWorld(World):
    """Robot i moves along y at 0.1 (i + 1) m/s; the hose is a swinging arc; 10 ms steps."""

    hose_model = "rails"

    def __init__(self, scene):
        super().__init__(scene, scene.make_spec().compile())
        self._clock = 0.0
        self.reset()

    timestep = 0.01

    @property
    def time(self):
        return self._clock

    def reset(self):
        self._clock = 0.0
        self._start_bodies()
        self._start = self.data.qpos.copy()

    def step(self, n_steps=1):
        self._clock += n_steps * self.timestep
        for robot in range(self.n_robots):
            self.data.qpos[2 * robot + 1] = self._start[2 * robot + 1] + self.shift(robot)
        self._update_poses()

    def shift(self, robot):
        return -0.1 * (robot + 1) * self.time

    def hose_position(self, arc_length):
        s = np.asarray(arc_length)[:, None] / self.scene.spec.length
        places = self.site_positions()[::-1]
        k = np.minimum((s[:, 0] * self.n_robots).astype(int), self.n_robots - 1)
        u = s * self.n_robots - k[:, None]
        bow = 0.1 * np.sin(np.pi * u) * [np.cos(3 * self.time), 0, 0]
        return (1 - u) * places[k] + u * places[k + 1] + bow

    def hose_velocity(self, arc_length):
        return np.zeros((len(arc_length), 3))

    def tension(self, arc_length):
        return 4.0 * self.time * np.asarray(arc_length) / self.scene.spec.length

    def centre_line(self):
        s = np.linspace(0.0, self.scene.spec.length, 9)
        return CentreLine.of_chain(s, self.hose_position(s))

    def attachment_forces(self):
        forces = np.zeros((self.n_robots + 1, 3))
        forces[:, 1] = self.time
        return forces

    def hose_snapshot(self):
        return {"clock": self._clock}

    def restore_hose(self, state):
        self._clock = state["clock"]


class RailMonitor:
    """A tension margin that falls by 4 N/s from 10 N, and one distance that has no measure."""

    names = ("stretch 0", "obstacle 1")
    kinds = ("stretch", "obstacle")
    units = ("N", "m")
    limit_texts = ("at most 10 N", "more than 0 m")
    limits = SimpleNamespace(compute_tension_limit=lambda spec, gravity: 10.0)

    def __init__(self, world):
        self.world = world

    def measure(self):
        return np.array([10.0 - 4.0 * self.world.time, np.inf])


def make_break(world):
    """The break of `RailMonitor`: at 2.5 s."""
    return SimpleNamespace(
        kind="stretch",
        time=2.5,
        place=tuple(world.site_positions()[0]),
        describe=lambda: "2.500 s: segment 0 of the hose was stretched too far",
        to_record=lambda: {"kind": "stretch", "time": 2.5},
    )


def play_episode(capture, world, monitor, n_samples=30, settings=None):
    """An episode of 0.1 s a sample, with two robots in turn, that breaks at 2.5 s."""
    capture.start(world, monitor, settings or {"policy": "rails"})
    for k in range(n_samples):
        info = {"reward": -0.1 * k, "turn": k, "owner": world.scene.robots[(k // 5) % 2].name}
        if k % 7 == 3:
            info |= {"vetoed": ["north", "east"], "events": [f"veto {k}"]}
        capture.sample(world, monitor, info)
        world.step(10)
    capture.finish(SimpleNamespace(ended_by="break", broken=make_break(world)))


@pytest.fixture(scope="session")
def floor():
    return read_scene(find_scene("floor_2"))


@pytest.fixture
def world(floor):
    return RailWorld(floor)


@pytest.fixture
def monitor(world):
    return RailMonitor(world)


@pytest.fixture
def play():
    return play_episode


@pytest.fixture
def episode(world, monitor):
    from hose_mj.rollout.capture import Capture

    capture = Capture(keep=True)
    play_episode(capture, world, monitor)
    return capture.episode()
