"""Bodies and hose, one step at a time: against MuJoCo, finite differences and conservation laws."""

import mujoco
import numpy as np
import pytest

from hose_mj.hoses.geds.integrators import SCHEMES
from hose_mj.hoses.geds.point_masses import PointMasses
from hose_mj.hoses.geds.shapes import ROW
from hose_mj.scenes.mjcf.scene import find_scene, read_scene
from hose_mj.world.geds_world import Bodies, GedsWorld

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
IMPLICIT = [name for name in SCHEMES if name != "verlet"]


@pytest.fixture(params=["floor_2", "deck", "lift"])
def bodies(request):
    """The robots of a shipped scene in motion, and a copy of their data."""
    scene = read_scene(find_scene(request.param))
    model = scene.make_spec().compile()
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data, copy = mujoco.MjData(model), mujoco.MjData(model)
    data.ctrl[:] = 0.1 * model.actuator_ctrlrange[:, 1]
    mujoco.mj_step(model, data, 200)
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    mujoco.mj_setState(model, copy, state, STATE)
    sites = np.array([model.site(robot.site).id for robot in scene.robots])
    return Bodies(model, data, sites), model, data, copy, sites


def test_a_step_tried_is_the_step_that_mujoco_takes(bodies):
    pair, model, data, copy, sites = bodies
    forces = np.random.default_rng(0).normal(size=(len(sites), 3))
    pair.begin()
    for other in (0.0, -3.0, 1.0):  # those before the last leave nothing behind
        reached = pair.try_step(other * forces)
    pair.end()
    mujoco.mj_kinematics(model, copy)
    mujoco.mj_comPos(model, copy)
    for site, force in zip(sites, forces, strict=True):
        body, point = model.site_bodyid[site], copy.site_xpos[site]
        mujoco.mj_applyFT(model, copy, -force, np.zeros(3), point, body, copy.qfrc_applied)
    mujoco.mj_step(model, copy)
    np.testing.assert_allclose(data.qpos, copy.qpos, rtol=0, atol=1e-14)
    np.testing.assert_allclose(data.qvel, copy.qvel, rtol=0, atol=1e-11)
    assert data.time == copy.time
    mujoco.mj_kinematics(model, copy)
    np.testing.assert_allclose(reached, copy.site_xpos[sites], atol=1e-14)


def test_compliance_is_the_derivative_of_a_step_while_contacts_stay(bodies):
    pair, *_, sites = bodies
    rng = np.random.default_rng(0)
    forces, change = rng.normal(size=(2, len(sites), 3))
    pair.begin()
    reached = pair.try_step(forces)
    exact = pair.compute_compliance(is_exact=True)
    symmetric = pair.compute_compliance(is_exact=False)
    step = 1e-4
    moved = (pair.try_step(forces + step * change) - reached).ravel() / step
    scale = np.abs(moved).max()
    np.testing.assert_allclose(moved, -exact @ change.ravel(), atol=1e-3 * scale)
    np.testing.assert_array_equal(symmetric, symmetric.T)
    assert np.linalg.eigvalsh(symmetric).min() > -1e-12
    np.testing.assert_allclose(moved, -symmetric @ change.ravel(), atol=0.1 * scale)


@pytest.mark.parametrize("scheme", IMPLICIT)
@pytest.mark.parametrize("stiffness", [1e3, 1e6])
def test_masses_drawn_together_keep_their_momentum(make_hose_of, scheme, stiffness):
    timestep = 0.005 if scheme != "midpoint" else 2e-4  # the midpoint rule is not stable there
    hose = make_hose_of(axial_stiffness=stiffness, timestep=timestep, scheme=scheme)
    hose.reset([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    holds = [hose.attach(0.0), hose.attach(1.0)]
    masses = make_masses(hose.position([0.0, 1.0]), 0.05, [[-0.4, 0.1, 0.0], [0.6, 0.0, 0.05]])
    before = total_momentum(hose, masses)
    assert hose.coupling.step_with_masses(holds, masses, 300) == 300
    np.testing.assert_allclose(total_momentum(hose, masses), before, atol=1e-10)
    np.testing.assert_allclose(hose.position([0.0, 1.0]), masses.position, atol=1e-14)


@pytest.mark.parametrize("scheme", IMPLICIT)
def test_free_robots_and_hose_keep_their_momentum(write_scene, scheme):
    robots = [
        write_scene.ball(0, (0.5, 0.2, 0.1), 0.5),
        write_scene.ball(1, (0.2, 0.1, 0.0), 2.0),
    ]
    timestep = 0.005 if scheme != "midpoint" else 5e-4
    world = GedsWorld(write_scene(robots, timestep=timestep), scheme=scheme)
    world.hose.release(world.hose.holds[-1])  # the source's
    world.data.qvel[:3], world.data.qvel[6:9] = [1.5, 0.3, 0.0], [-1.0, 0.0, 0.4]
    mass = np.repeat([0.5, 2.0], 3)
    free = [0, 1, 2, 6, 7, 8]

    def add_up():
        robots = (mass * world.data.qvel[free]).reshape(2, 3).sum(axis=0)
        return world.hose.momentum().linear + robots

    before = add_up()
    world.step(200)
    assert np.abs(world.hose.momentum().linear).max() > 0.01
    np.testing.assert_allclose(add_up(), before, atol=1e-10)


@pytest.mark.parametrize("compiled_pucks", [True, False])
def test_robots_are_point_masses_in_the_hoses_own_mass_matrix(write_scene, compiled_pucks):
    mass = {0: 0.05, 1: 5.0}
    robots = [
        write_scene.slider(0, (0.6, 0.2, 0.0), mass[0], solid=False),
        write_scene.slider(1, (0.3, -0.1, 0.0), mass[1], solid=False),
    ]
    scene = write_scene(robots, gravity="0 0 -9.81", timestep=0.002, axial_stiffness=1e5)
    world = GedsWorld(scene, scheme="backward-euler", compiled_pucks=compiled_pucks)
    # The same hose with m W W^T in its mass matrix, and its weight.
    reference = GedsWorld(scene, scheme="backward-euler").hose
    source = reference.holds[-1]
    for hold in reference.holds[:-1]:
        reference.release(hold)
    band, weight = reference._hose.mass.copy(), reference._loads._weight.copy()
    for i, hold in enumerate(world.hose.holds[:-1]):
        (start,), values = reference._spline.compute_basis(np.array([hold.arc_length]))
        basis = values[0, 0]
        for a in range(4):
            weight[start + 3 * a + 2] -= mass[i] * basis[a] * 9.81
            for b in range(a, 4):
                band[start // 3 + a, b - a] += mass[i] * basis[a] * basis[b]
    reference._dynamics.hose = reference._hose._replace(mass=band)
    reference._loads._weight[:] = weight
    reference._loads.clear()
    assert reference.holds == [source]
    apart = 0.0
    for _ in range(100):
        world.step(10)
        reference.step(10)
        places = reference.position(world.arc_lengths)
        apart = max(apart, np.abs(world.site_positions() - places).max())
    assert np.abs(reference.velocity(0.5)).max() > 0.01
    assert apart < 1e-8


def make_masses(places, mass, velocities):
    k = len(places)
    zero = np.zeros((k, 3))
    return PointMasses(
        position=np.array(places),
        velocity=np.array(velocities, dtype=float),
        mass=np.full((k, 3), mass),
        drag=zero.copy(),
        force=zero.copy(),
        radius=np.full(k, 1e-6),
        across=3,
        reach=np.full(k, 1e-6),
        walls=np.zeros((0, ROW)),
        owner=np.zeros(0, dtype=np.int64),
        arm=np.zeros((0, 3)),
        push=zero.copy(),
    )


def total_momentum(hose, masses):
    return hose.momentum().linear + (masses.mass * masses.velocity).sum(axis=0)
