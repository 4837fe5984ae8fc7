"""A world without dynamics: bodies are put where a test wants them, the hose is an exact curve."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from hose_mj.scenes.mjcf.scene import find_scene, read_scene
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.world import World


def _make_straight(start, end, length, pieces=8):
    arcs = np.linspace(0.0, length, pieces + 1)
    points = np.linspace(start, end, pieces + 1)
    return CentreLine.of_chain(arcs, points)


@pytest.fixture(scope="session")
def make_straight():
    """Makes a straight line: start, end, length."""
    return _make_straight


@pytest.fixture(scope="session")
def make_curve():
    """Makes a curve from functions of arc lengths (k,): position and slope, (k, 3) each."""

    def make(curve, slope, length, pieces=16):
        arcs = np.linspace(0.0, length, pieces + 1)
        return CentreLine.of_spline(arcs, curve(arcs), slope(arcs))

    return make


class FakeWorld(World):
    hose_model = "fake"

    def __init__(self, scene):
        super().__init__(scene, scene.make_spec().compile())
        self.clock = 0.0
        length, start = scene.spec.length, np.array(scene.source.position)
        self.line = _make_straight(start, start + length * np.eye(3)[2], length)  # straight up
        self.pull = lambda s: np.zeros(len(s))
        self._start_bodies()

    @property
    def timestep(self):
        return 0.01

    @property
    def time(self):
        return self.clock

    def reset(self):
        self.clock = 0.0
        self._start_bodies()

    def step(self, n_steps=1):
        self.clock += n_steps * self.timestep

    def hose_position(self, arc_length):
        return self.line.position(np.atleast_1d(arc_length))

    def hose_velocity(self, arc_length):
        return np.zeros((len(np.atleast_1d(arc_length)), 3))

    def tension(self, arc_length):
        return self.pull(np.atleast_1d(arc_length))

    def centre_line(self):
        return self.line

    def attachment_forces(self):
        return np.zeros((self.n_robots + 1, 3))

    def hose_snapshot(self):
        return {}

    def restore_hose(self, state):
        pass

    def put(self, robot, position):
        """Moves a robot on slides so that its site has these coordinates (x, y or x, y, z)."""
        joints = np.flatnonzero(np.isin(self.model.jnt_bodyid, self.robot_bodies[robot]))
        here = self.site_positions()[robot]
        for c in range(len(position)):
            self.data.qpos[self.model.jnt_qposadr[joints[c]]] += position[c] - here[c]
        self._update_poses()


@pytest.fixture(scope="session")
def floors():
    return {n: read_scene(find_scene(f"floor_{n}")) for n in (1, 2, 3, 6)}


@pytest.fixture(scope="session")
def make_fake():
    return FakeWorld


@pytest.fixture
def floor(floors):
    return FakeWorld(floors[2])


SCENE = """<mujoco>
  <custom>
    <numeric name="hose_length" data="{length}"/>
    <numeric name="hose_outer_radius" data="0.01"/>
    <numeric name="hose_axial_stiffness" data="1e4"/>
    <numeric name="hose_bending_stiffness" data="0.01"/>
    <numeric name="hose_torsional_stiffness" data="0.01"/>
    <numeric name="hose_linear_density" data="0.1"/>
    {custom}
  </custom>
  <asset>
    <mesh name="wedge" vertex="-.1 -.1 -.1  .1 -.1 -.1  -.1 .1 -.1  -.1 -.1 .1"/>
    <hfield name="hill" nrow="2" ncol="2" size="0.2 0.2 0.1 0.05"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1"/>
    {others}
    <site name="hose_source" pos="0 0 0.5"/>
    <site name="goal" pos="0.5 0.5 0.5"/>
    {robots}
  </worldbody>
</mujoco>"""
ROBOT = """<body name="robot{i}/body" pos="{at}">
  <joint name="robot{i}/x" type="slide" axis="1 0 0"/>
  <joint name="robot{i}/y" type="slide" axis="0 1 0"/>
  <joint name="robot{i}/z" type="slide" axis="0 0 1"/>
  {turn}
  {geoms}
  <site name="robot{i}/hose_attach"/>
</body>"""


@pytest.fixture(scope="session")
def make_world(tmp_path_factory):
    """Makes a world of robots with given geoms, one after the other along x at z = 0.5."""
    folder, scenes = tmp_path_factory.mktemp("scenes"), {}

    def make(*robots, others="", custom="", length=4.0, turn=""):
        bodies = [
            ROBOT.format(i=i, at=f"{2.0 - i} 0 0.5", geoms=geoms, turn=turn.format(i=i))
            for i, geoms in enumerate(robots)
        ]
        text = SCENE.format(length=length, custom=custom, others=others, robots="\n".join(bodies))
        if text not in scenes:
            path = folder / f"scene{len(scenes)}.xml"
            path.write_text(text)
            scenes[text] = read_scene(path)
        return FakeWorld(scenes[text])

    return make


@pytest.fixture(scope="session")
def make_rotation():
    def make(rng):
        quaternion, matrix = rng.normal(size=4), np.zeros(9)
        mujoco.mju_quat2Mat(matrix, quaternion / np.linalg.norm(quaternion))
        return matrix.reshape(3, 3)

    return make
