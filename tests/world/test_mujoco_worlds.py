"""Cable and flex hoses inside a scene's mjModel: how they start, move, touch and come back."""

from __future__ import annotations

import functools

import mujoco
import numpy as np
import pytest

from hose_mj.scenes.mjcf.scene import find_scene, read_scene
from hose_mj.world.mujoco_world import Pin, fit_chain
from hose_mj.world.registry import make_world

MODELS = ("cable", "flex")
SCENES = ("floor_1", "floor_3", "corridor", "deck", "lift")

# Robots that nothing moves stand in a thick fluid.
TEXT = """
<mujoco>
  <option timestep="0.002" gravity="{gravity}"/>
  <custom>
    <numeric name="hose_length" data="1.0"/><numeric name="hose_outer_radius" data="0.01"/>
    <numeric name="hose_axial_stiffness" data="5e3"/>
    <numeric name="hose_bending_stiffness" data="{bend}"/>
    <numeric name="hose_torsional_stiffness" data="8e-3"/>
    <numeric name="hose_linear_density" data="0.2"/>
    <numeric name="hose_damping_time" data="0.05"/>
    <numeric name="hose_attachments" data="0.8 0.4"/>
    <numeric name="hose_friction" data="{friction}"/>
  </custom>
  <worldbody>
    {geoms}
    <site name="hose_source" pos="0 0 {height}"/><site name="goal" pos="0 0.5 {height}"/>
    <body name="robot0" pos="{apart[1]} 0 {height}">
      {joints}<geom size="0.02" mass="0.5"/><site name="robot0/hose_attach"/>
    </body>
    <body name="robot1" pos="{apart[0]} 0 {height}">
      {joints}<geom size="0.02" mass="0.5"/><site name="robot1/hose_attach"/>
    </body>
  </worldbody>
</mujoco>
"""
SLIDES = "".join(f'<joint type="slide" axis="{a}"{{}}/>' for a in ("1 0 0", "0 1 0", "0 0 1"))
HELD, FLOATING = (SLIDES.replace("{}", extra) for extra in (' damping="1e6"', ""))


@pytest.fixture
def make(tmp_path):
    def make(model, *, joints=HELD, gravity="0 0 -9.81", apart=(0.35, 0.7), **values):
        path = tmp_path / "scene.xml"
        values = {"friction": 0.5, "geoms": "", "height": 0.5, "bend": 1e-2} | values
        path.write_text(TEXT.format(joints=joints, gravity=gravity, apart=apart, **values))
        return make_world(read_scene(path), model, segments=20)

    return make


@functools.cache
def make_shipped(name, model):
    return make_world(read_scene(find_scene(name)), model)


def measure_momentum(world, bodies):
    rows, total = np.zeros((3, world.model.nv)), np.zeros(3)
    mujoco.mj_comPos(world.model, world.data)
    for body in bodies:
        mujoco.mj_jacBodyCom(world.model, world.data, rows, None, int(body))
        total += world.model.body_mass[body] * (rows @ world.data.qvel)
    return total


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", SCENES)
def test_a_hose_starts_at_its_robots_with_its_length(name, model):
    world = make_shipped(name, model)
    world.reset()
    assert world.start_gap < 1e-9
    points = world.hose_position(world.nodes)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(lengths, np.diff(world.nodes), atol=1e-9)
    line = world.centre_line()
    s = np.linspace(0.0, world.scene.spec.length, 97)
    np.testing.assert_allclose(line.position(s), world.hose_position(s), atol=1e-9)
    assert world.time == 0.0
    assert not world.hose_velocity(s).any()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", SCENES)
def test_robots_keep_the_hose_while_they_are_driven(name, model):
    world = make_shipped(name, model)
    world.reset()
    high = world.model.actuator_ctrlrange[:, 1]
    world.control[:] = 0.1 * high * np.where(np.arange(len(high)) % 2, 1.0, -1.0)
    start = world.site_positions()
    world.step(round(0.1 / world.timestep))
    gap = np.linalg.norm(world.hose_position(world.arc_lengths) - world.site_positions(), axis=1)
    assert gap.max() < {"cable": 5e-4, "flex": 1e-4}[model]
    assert np.abs(world.site_positions() - start)[:-1].max() > 1e-4
    np.testing.assert_array_equal(world.site_positions()[-1], start[-1])
    speeds = world.hose_velocity(world.arc_lengths) - world.site_velocities()
    assert np.abs(speeds).max() < 0.1


@pytest.mark.parametrize("model", MODELS)
def test_held_forces_are_those_of_weight_and_momentum(make, model):
    """Newton's second law for the whole hose, and its weight once it hangs still."""
    world = make(model)
    weight = world.scene.spec.mass * 9.81
    before, impulse = measure_momentum(world, world.hose_bodies), np.zeros(3)
    for _ in range(200):
        world.step()
        impulse += world.timestep * world.attachment_forces().sum(axis=0)
    gained = measure_momentum(world, world.hose_bodies) - before
    expected = gained + np.array([0.0, 0.0, weight * world.time])
    np.testing.assert_allclose(impulse, expected, atol=1e-5 * weight * world.time)
    mean = impulse / world.time
    assert mean[2] == pytest.approx(weight, rel=0.02)


@pytest.mark.parametrize("model", MODELS)
def test_a_chain_that_hangs_from_its_source_has_the_tension_of_what_is_below(make, model):
    world = make(model, joints=FLOATING, gravity="9.81 0 0", apart=(0.4, 0.8))
    world.step(500)
    s = np.array([0.1, 0.3])
    carried = world.scene.spec.linear_density * (1.0 - s) + 2 * 0.5
    np.testing.assert_allclose(world.tension(s), 9.81 * carried, rtol=0.02)
    s = np.array([0.85, 0.95])
    np.testing.assert_allclose(world.tension(s), 9.81 * 0.2 * (1.0 - s), atol=0.03)


def test_all_models_swing_alike(make):
    """Two weights on a hose, let go: the same motion to 2 % of the length until it snaps taut."""
    worlds = [make(model, joints=FLOATING) for model in MODELS]
    worlds.append(make_world(worlds[0].scene, "geds"))
    for _ in range(3):
        for world in worlds:
            world.step(50)
        places = np.array([world.hose_position([0.2, 0.4, 0.8, 1.0]) for world in worlds])
        assert np.abs(places[:2] - places[2]).max() < 0.02
    assert places[0, 2, 2] < 0.1  # from 0.5


@pytest.mark.parametrize("model", MODELS)
def test_momentum_changes_by_the_forces_of_user_and_source_alone(make, model):
    world = make(model, joints=FLOATING, gravity="0 0 0")
    moving = np.concatenate([world.hose_bodies, *world.robot_bodies])
    force, impulse = np.array([0.0, 2.0, 0.5]), np.zeros(3)
    world.apply_force(0, force)
    for _ in range(150):
        world.step()
        impulse += world.timestep * (force + world.attachment_forces()[-1])
    found = measure_momentum(world, moving)
    assert np.linalg.norm(found) > 0.1
    # The cable's joint coordinates keep it to first order in the time step, the flex's exactly.
    np.testing.assert_allclose(found, impulse, atol={"cable": 5e-3, "flex": 1e-6}[model])


@pytest.mark.parametrize("model", MODELS)
def test_a_restored_world_goes_on_bit_by_bit(model):
    world = make_shipped("floor_1", model)
    world.reset()
    world.control[:] = [5.0, -3.0]
    world.apply_force(0, [1.0, 0.0, 0.0])
    world.step(10)
    state = world.snapshot()
    forces = world.attachment_forces()
    s = np.linspace(0.0, world.scene.spec.length, 9)

    def read():
        told = [world.attachment_forces(), world.site_positions()]
        told += [ask(s) for ask in (world.tension, world.hose_position, world.hose_velocity)]
        return [world.data.qpos.copy(), world.data.qvel.copy(), *told]

    world.step(15)
    first = read()
    world.control[:] = 0.0
    world.step(3)
    world.restore(state)
    np.testing.assert_array_equal(world.attachment_forces(), forces)
    world.tension(s)
    world.step(15)
    for a, b in zip(first, read(), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("model", MODELS)
def test_friction_holds_a_hose_on_a_slope_below_its_angle(make, model):
    """Coulomb: at rest while tan(slope) = 0.2 is below the coefficient; else it slides."""
    floor = '<geom name="floor" type="plane" size="2 2 0.1" friction="0.9 0 0"/>'
    ways = {}
    for friction in (0.0, 0.1, 0.3):
        world = make(model, gravity="0 0 -9.6", friction=friction, geoms=floor, height=0.01)
        world.step(50)
        start = world.hose_position(world.nodes)
        world.model.opt.gravity[1] = 1.92
        world.step(100)
        assert world.hose_position(world.nodes)[:, 2].min() > 0.009
        ways[friction] = np.abs(world.hose_position(world.nodes) - start).max()
    assert ways[0.3] < 4e-3  # it also settles: its shape was found without friction
    # Nothing goes further than free fall along the slope.
    assert ways[0.3] < 0.5 * ways[0.1] < 0.5 * 0.93 * ways[0.0]
    assert ways[0.0] < 0.5 * 1.92 * 0.2**2


@pytest.mark.parametrize("model", MODELS)
def test_a_box_carries_what_lies_on_it(make, model):
    box = '<geom type="box" pos="0.2 0 0.4" size="0.06 0.3 0.04"/>'
    world = make(model, geoms=box, bend=1e-3)
    world.step(150)
    points = world.hose_position(np.linspace(0.0, 0.4, 81))
    above = np.abs(points[:, 0] - 0.2) < 0.06
    assert above.any()
    assert points[above, 2].min() == pytest.approx(0.44 + 0.01, abs=2e-3)
    weight = world.scene.spec.mass * 9.81
    assert world.attachment_forces()[:, 2].sum() < 0.95 * weight


def test_a_chain_is_fitted_to_its_pins():
    rng = np.random.default_rng(3)
    steps = rng.normal(size=(12, 3)) + np.array([2.0, 0.0, 0.0])
    points = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    lengths = np.full(12, 2.5)
    pins = [Pin(0, 0.0, np.array([0.1, 0.0, 0.0])), Pin(7, 0.25, points[7] + 0.2)]
    nodes = fit_chain(points, lengths, pins)
    np.testing.assert_allclose(np.linalg.norm(np.diff(nodes, axis=0), axis=1), lengths, atol=1e-11)
    np.testing.assert_allclose(nodes[0], pins[0].target, atol=1e-11)
    np.testing.assert_allclose(0.75 * nodes[7] + 0.25 * nodes[8], pins[1].target, atol=1e-11)
    assert np.abs(nodes - points).max() < 3.0
