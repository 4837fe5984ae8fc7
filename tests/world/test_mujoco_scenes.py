"""What a hose inside a scene's mjModel leaves alone, what it may touch, and what is refused."""

from __future__ import annotations

import functools
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from hose_mj.errors import InputError, StepError
from hose_mj.scenes.mjcf.scene import find_scene, read_scene
from hose_mj.world.cable_world import CableWorld, compute_stable_step
from hose_mj.world.flex_world import FlexWorld
from hose_mj.world.scene_geoms import OWN_ARC, compute_radius

WORLDS = {"cable": CableWorld, "flex": FlexWorld}
TEXT = """
<mujoco>
  <compiler {compiler}/><option timestep="0.002"><flag {flag}/></option>
  <default><joint damping="3" armature="0.5"/><geom contype="4" solref="0.05 1"/></default>
  <custom>
    <numeric name="hose_length" data="1.0"/><numeric name="hose_outer_radius" data="0.01"/>
    <numeric name="hose_axial_stiffness" data="5e3"/>
    <numeric name="hose_bending_stiffness" data="1e-2"/>
    <numeric name="hose_linear_density" data="0.2"/>
    <numeric name="hose_attachments" data="0.9 0.45"/>
    {numeric}
  </custom>
  <worldbody>
    <site name="hose_source" pos="0 0 1"/><site name="goal" pos="0 0.5 1"/>
    <body name="robot0" pos="0.8 0 1">
      <joint name="x" type="slide" axis="1 0 0"/><geom size="0.02" mass="0.5"/>
      <site name="robot0/hose_attach"/>
    </body>
    <body name="robot1" pos="0.4 0 1">
      <joint name="y" type="slide" axis="0 1 0"/><geom size="0.02" mass="0.5"/>
      <site name="robot1/hose_attach"/>
    </body>
  </worldbody>
  <actuator><motor name="b" joint="y"/><motor name="a" joint="x"/></actuator>
  <keyframe>
    <key name="other" qpos="0.3 0.3"/><key name="start" qpos="-0.05 0.1" qvel="0 0"/>
  </keyframe>
</mujoco>
"""


@pytest.fixture
def read(tmp_path):
    def read(*, compiler="", flag="", numeric=""):
        path = tmp_path / "scene.xml"
        path.write_text(TEXT.format(compiler=compiler, flag=flag, numeric=numeric))
        return read_scene(path)

    return read


@functools.cache
def make_shipped(name, model):
    return WORLDS[model](read_scene(find_scene(name)))


def collides(model, first, second):
    return bool(
        (model.geom_contype[first] & model.geom_conaffinity[second])
        | (model.geom_contype[second] & model.geom_conaffinity[first])
    )


def find_pieces(world):
    """Bits of the hose's pieces for all geoms but planes, by piece."""
    model = world.model
    if isinstance(world, CableWorld):
        first = [model.body_geomadr[body] for body in world.hose_bodies]
        return model.geom_contype[first], model.geom_conaffinity[first]
    bits = np.zeros(len(world.nodes) - 1, dtype=int)
    begin = 0
    for k in range(1, model.nflex):
        count = model.flex_elemnum[k]
        bits[begin : begin + count] = model.flex_contype[k]
        begin += count
    assert begin == len(bits)
    assert model.flex_contype[0] == model.flex_conaffinity[0] == 0
    assert not model.flex_conaffinity.any()
    return bits, np.zeros_like(bits)


@pytest.mark.parametrize("model", WORLDS)
@pytest.mark.parametrize("name", ["floor_2", "deck"])
def test_the_scene_s_own_contacts_are_those_of_the_plain_scene(name, model):
    world = make_shipped(name, model)
    plain = world.scene.make_spec().compile()
    n = plain.ngeom
    for what in ("friction", "solref", "solimp", "condim", "priority", "margin", "contype"):
        ours, theirs = (getattr(m, f"geom_{what}") for m in (world.model, plain))
        np.testing.assert_array_equal(ours[:n], theirs)
    for a in range(n):
        for b in range(a):
            assert collides(world.model, a, b) == collides(plain, a, b)
    names = [world.model.actuator(k).name for k in range(world.model.nu)]
    assert names == [plain.actuator(k).name for k in range(plain.nu)]
    np.testing.assert_array_equal(world.model.body_mass[: plain.nbody], plain.body_mass)


@pytest.mark.parametrize("model", WORLDS)
@pytest.mark.parametrize("name", ["floor_2", "deck", "lift"])
def test_pieces_touch_all_but_the_robot_that_holds_them_near_its_site(name, model):
    world = make_shipped(name, model)
    world.reset()
    m, (types, affinities) = world.model, find_pieces(world)
    assert not (types & affinities).any()  # not itself
    planes = m.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    scene = [g for g in range(m.ngeom) if m.geom_bodyid[g] not in world.hose_bodies]
    solid = [g for g in scene if (m.geom_contype[g] | m.geom_conaffinity[g]) & 1 and not planes[g]]
    begin, end = world.nodes[:-1], world.nodes[1:]
    skipped = 0
    for g in solid:
        expected = np.ones(len(begin), dtype=bool)
        for k, bodies in enumerate(world.robot_bodies):
            if m.geom_bodyid[g] in bodies:
                own = np.flatnonzero(np.isin(m.geom_bodyid, bodies))
                reach = OWN_ARC * compute_radius(m, world.data, world.sites[k], own)
                s = world.arc_lengths[k]
                expected = (begin >= s + reach) | (end <= s - reach)
        np.testing.assert_array_equal((types & m.geom_conaffinity[g]) != 0, expected)
        skipped += np.count_nonzero(~expected)
    assert skipped > 0
    loose = [g for g in scene if g not in solid and not planes[g]]
    assert not any((types & m.geom_conaffinity[g]).any() for g in loose)


@pytest.mark.parametrize("model", WORLDS)
def test_a_keyframe_and_defaults_of_the_scene_are_its_own(read, model):
    world = WORLDS[model](read(), segments=20)
    np.testing.assert_allclose(world.site_positions()[:, :2], [[0.75, 0], [0.4, 0.1], [0, 0]])
    assert world.start_gap < 1e-9
    joints = world.model.jnt_dofadr[world.model.body_jntadr[world.hose_bodies[-1]]]
    assert world.model.dof_armature[joints] == 0.0
    assert world.model.dof_damping[joints] == 0.0
    assert [world.model.actuator(k).name for k in range(2)] == ["b", "a"]
    world.control[:] = [0.0, 1.0]
    world.step(20)
    assert world.site_velocities()[0, 0] > 0.0


@pytest.mark.parametrize("model", WORLDS)
@pytest.mark.parametrize(
    ("numeric", "what"),
    [
        ('<numeric name="hose_rest_curvature" data="1"/>', "rest_curvature"),
        ('<numeric name="hose_drag" data="1"/>', "drag"),
        ('<numeric name="hose_second_bending_stiffness" data="2e-2"/>', "second_bending_stiffness"),
    ],
)
def test_what_the_models_lack_is_refused(read, model, numeric, what):
    with pytest.raises(InputError, match=what):
        WORLDS[model](read(numeric=numeric))


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
@pytest.mark.parametrize("model", WORLDS)
@pytest.mark.parametrize(
    ("scene", "options", "what"),
    [
        ({}, {"segments": 1}, "segments"),
        ({}, {"substeps": 0}, "substeps"),
        ({}, {"timestep": float("nan")}, "timestep"),
        ({"flag": 'equality="disable"'}, {}, "equality"),
        ({"compiler": 'settotalmass="3"'}, {}, "mass of the hose"),
        ({}, {"segments": 2}, "segments|arc_length"),
    ],
)
def test_what_cannot_be_is_refused(read, model, scene, options, what):
    with pytest.raises(InputError, match=what):
        WORLDS[model](read(**scene), **options)


def test_bad_numbers_end_a_step_with_one_message_and_the_state_before(read, capfd):
    world = CableWorld(read(), timestep=0.004, substeps=1)
    world.control[:] = [20.0, 5.0]
    message = "NaN or a huge number in the step from time .*more substeps"
    found = ""
    while not found:
        assert world.time < 2.0
        before = world.snapshot()
        try:
            world.step()
        except StepError as error:
            found = str(error)
    assert re.search(message, found)
    after = world.snapshot()
    np.testing.assert_array_equal(after["mujoco"], before["mujoco"])
    for name, value in before["hose"].items():
        np.testing.assert_array_equal(after["hose"][name], value)
    with pytest.raises(StepError, match=re.escape(f"from time {world.time:g} s")):
        world.step()
    assert capfd.readouterr() == ("", "")
    world.control[0] = np.nan
    with pytest.raises(InputError, match="control"):
        world.step()


def test_the_largest_stable_step_is_where_an_oscillator_begins_to_grow():
    """The fastest motion, omega^2 = 48 EI / (rho h^4), with implicit damping, x' and v' by hand."""
    base = make_shipped("floor_2", "cable").scene.spec
    for relaxation in (0.0, 1e-4, 1e-2):
        spec = replace(base, damping_time=relaxation)
        rate = 48.0 * spec.bending_stiffness / (spec.linear_density * 0.02**4)
        step = compute_stable_step(spec, 0.02, 0.0)
        for factor, grows in ((0.99, False), (1.01, True)):
            dt = factor * step
            damped = 1.0 + dt * rate * relaxation
            speed = np.array([-dt * rate, 1.0]) / damped
            matrix = np.stack([np.array([1.0, 0.0]) + dt * speed, speed])
            assert bool(np.abs(np.linalg.eigvals(matrix)).max() > 1.0 + 1e-9) == grows


def test_the_cable_takes_as_many_substeps_as_stability_asks_for(read):
    damped = make_shipped("floor_2", "cable")
    assert (damped.timestep, damped.substeps) == (0.002, 4)
    world = CableWorld(read(), segments=60)
    stable = compute_stable_step(world.scene.spec, 1 / 60, 0.0)
    assert world.timestep / world.substeps <= 0.5 * stable < world.timestep / (world.substeps - 1)
    assert world.model.opt.timestep == pytest.approx(world.timestep / world.substeps)
    world.step(50)
    assert np.abs(world.hose_velocity(world.nodes)).max() < 10.0
