"""MuJoCo's cable among obstacles."""

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.hoses.mujoco.cable import CableHose
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.spec import HoseSpec

SPEC = HoseSpec(
    length=1.0,
    axial_stiffness=2e4,
    bending_stiffness=0.02,
    torsional_stiffness=0.02,
    linear_density=0.1,
    damping_time=0.02,
)
WEIGHT, RADIUS = 0.1 * 9.81, 0.01


def make(*obstacles, **options):
    options = {"timestep": 0.002, "segments": 10, **options}
    return CableHose(SPEC, obstacles=obstacles, **options)


def test_cable_rests_on_a_floor_and_slides_with_its_friction():
    hose = make(Obstacle(kind="plane", friction=0.4))
    hose.reset([[0, 0, RADIUS], [1, 0, RADIUS]], (1.0, 0.0, 0.0))
    hose.step(50)
    assert hose.velocity(0.5)[0, 0] == pytest.approx(1.0 - 0.4 * 9.81 * hose.time, rel=0.05)
    hose.step(450)
    assert hose.position(0.5)[0, 2] == pytest.approx(RADIUS, abs=0.05 * RADIUS)
    assert hose.position(0.0)[0, 0] == pytest.approx(1.0 / (2 * 0.4 * 9.81), rel=0.05)


@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder", "box"])
def test_cable_is_held_by_every_shape(kind):
    turn = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    obstacle = Obstacle(
        kind=kind, position=(0.5, 0, -0.15), rotation=turn, size=(0.1, 0.1, 0.1), friction=0.0
    )
    hose = make(obstacle)
    hose.clamp(0.0)
    hose.step(400)
    held = hose.position(0.5)[0, 2]
    free = make()
    free.clamp(0.0)
    free.step(400)
    assert free.position(0.5)[0, 2] < held - 0.03
    assert held > -0.15


def test_obstacles_stay_through_resets_and_holds():
    hose = make(Obstacle(kind="plane"))
    hose.reset([[0, 0, 0.05], [1, 0, 0.05]])
    hold = hose.attach(0.0)
    hose.release(hold)
    hose.step(400)
    assert np.all(hose.position(np.linspace(0, 1, 11))[:, 2] > 0.5 * RADIUS)


def test_what_a_chain_cannot_do_is_refused():
    with pytest.raises(InputError, match="velocity"):
        make(Obstacle(kind="plane", velocity=(1.0, 0, 0)))
    with pytest.raises(InputError, match="obstacles"):
        make("floor")
    with pytest.raises(InputError, match="obstacles"):
        make(Obstacle(kind="plane")).solve_static()
