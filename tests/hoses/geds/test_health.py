"""Newton stops on forces, and `hose.health` says what leaves its healthy range."""

import numpy as np
import pytest

from hose_mj import HoseSpec, HoseWarning, StepError, make_hose
from hose_mj.hoses.health import DEEPEST, LARGEST_JUMP
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.validation.ropes import carry_wire, compare_forces, swing


@pytest.mark.parametrize(("n", "dt"), [(16, 0.005), (64, 0.002)])
def test_forces_are_right_at_the_default_tolerance(n, dt):
    tight = carry_wire(n, dt, 1.0, tolerance=1e-9, force_tolerance=1e-8)
    assert compare_forces(carry_wire(n, dt, 1.0), tight) < 0.01


@pytest.mark.parametrize(
    ("axial", "bending", "n", "dt"),
    [(2e5, 1e-3, 32, 0.005), (2e5, 1e-3, 64, 0.002), (1e6, 1e-3, 64, 0.005), (1e7, 0.05, 32, 0.01)],
)
def test_a_free_swing_gains_no_energy(axial, bending, n, dt):
    _, gains = swing(axial, bending, n, dt, 2.0)
    assert gains.max() < 1e-3


@pytest.fixture
def hose(request):
    spec = HoseSpec(length=1.0, axial_stiffness=2e4, bending_stiffness=0.01, linear_density=0.1)
    made = make_hose("geds", spec, strict=getattr(request, "param", False))
    made.reset([[0, 0, 0], [1, 0, 0]])
    return made


@pytest.mark.parametrize("part", [1.5, 10.0])
def test_a_hold_that_jumps_is_said_once(hose, part):
    hold = hose.attach(1.0)
    hose.move(hold, (1.0, 0.9 * LARGEST_JUMP, 0.0))
    hose.step()
    assert hose.health.warnings == ()
    hose.move(hold, (1.0, 0.9 * LARGEST_JUMP + part * LARGEST_JUMP, 0.0))
    with pytest.warns(HoseWarning, match="moves by .* within one step"):
        hose.step()
    hose.move(hold, (1.0, 0.0, 0.0))
    hose.step()
    assert len(hose.health.warnings) == 1
    assert hose.health.largest_jump >= part * LARGEST_JUMP
    hose.reset([[0, 0, 0], [1, 0, 0]])
    assert hose.health.warnings == ()


@pytest.mark.parametrize("hose", [True], indirect=True)
def test_strict_refuses_the_step(hose):
    hold = hose.attach(1.0)
    hose.step()
    before = hose.control_points
    hose.move(hold, (1.0, 3.0, 0.0))
    with pytest.raises(StepError, match="moves by 3 m"):
        hose.step()
    with pytest.raises(StepError, match="moves by 3 m"):
        hose.step()  # to ask again changes nothing
    np.testing.assert_array_equal(hose.control_points, before)
    hose.move(hold, (1.0, 0.0, 0.0))
    hose.step()


@pytest.mark.parametrize("hose", [True], indirect=True)
def test_strict_refuses_a_strained_start(hose):
    with pytest.raises(StepError, match="laid with a strain"):
        hose.reset([[0, 0, 0], [1.1, 0, 0]])


def test_steps_with_bodies_are_looked_at_too(hose):
    floor = Obstacle(kind="plane", position=(0, 0, -0.006))
    hose.set_obstacles([floor])
    middle, tip = hose.attach(0.5), hose.attach(1.0)
    place = hose.position(1.0)
    hose.coupling.try_step([tip], place, 1e-3 * np.eye(3))
    with pytest.warns(HoseWarning, match="radii inside"):
        hose.coupling.accept_step()
    assert middle in hose.holds


def test_health_goes_on_from_a_snapshot(hose):
    hose.step(80)
    saved = hose.snapshot()
    hose.step(200)
    hose.restore(saved)
    assert hose.health.steps == 80
    assert hose.health.retry_share == 0.0


def test_where_a_hold_begins_in_statics_is_no_jump(hose):
    hose.attach(0.0)
    hose.attach(1.0, (0.5, 0.0, 0.0))
    hose.solve_static()
    hose.step()
    assert hose.health.warnings == ()
    assert hose.health.retry_share == 0.0


def test_a_deep_contact_is_said(hose):
    floor = Obstacle(kind="plane", position=(0, 0, -0.006))
    hose.set_obstacles([floor])
    hose.attach(0.5)  # within the floor
    with pytest.warns(HoseWarning, match="radii inside"):
        hose.step()
    hose.reset([[0, 0, 0.1], [1, 0, 0.1]])
    hose.set_obstacles([floor], ContactLaw(stiffness=30.0))
    hose.step(60)
    assert hose.health.deepest_contact > DEEPEST
    assert hose.health.warnings == ()
