"""Whether an equilibrium is stable or folded, against closed forms."""

import warnings

import numpy as np
import pytest

from hose_mj.errors import HoseWarning
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import HoseSpec

EI = 0.05


def make_hose(plane=None, **changes):
    values = {
        "length": 1.0,
        "axial_stiffness": 4e5 * EI,
        "bending_stiffness": EI,
        "torsional_stiffness": 0.04,
        "linear_density": 0.1,
    }
    gravity = changes.pop("gravity", (0.0, 0.0, 0.0))
    n = changes.pop("control_points", 16)
    twist = changes.pop("twist", None)
    spec = HoseSpec(**values | changes)
    return GedsHose(spec, plane=plane, gravity=gravity, control_points=n, twist=twist)


def settle(hose):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HoseWarning)
        return hose.solve_static()


@pytest.mark.parametrize("form", [("xz", None), (None, "scalar"), (None, "theta")])
@pytest.mark.parametrize("share", [0.98, 1.02, 100.0])
def test_eulers_load(form, share):
    plane, twist = form
    hose = make_hose(plane, twist=twist)
    hose.clamp(0.0)
    hose.apply_force(1.0, [-share * np.pi**2 * EI / 4.0, 0.0, 0.0])
    assert settle(hose).is_stable == (share < 1.0)


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_greenhills_torque(share):
    # A clamped hose without tension buckles under M L / EI = 8.98682.
    hose = make_hose(control_points=24, torsional_stiffness=EI)
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    for _ in range(4):
        hose.move(last, spin=0.25 * share * 8.98682)
        found = settle(hose)
    assert found.is_stable == (share < 1.0)


@pytest.mark.parametrize("n", [8, 16, 64])
def test_what_nothing_resists_is_not_unstable(n):
    gravity = (0.0, 0.0, -9.81)
    hanging = make_hose(control_points=n, gravity=gravity)
    hanging.reset([[0, 0, 0], [0, 0, -1]])
    hanging.attach(0.0)
    assert hanging.solve_static().is_stable
    # Between two attachments a bent hose may turn about the line through them.
    sagging = make_hose(control_points=n, gravity=gravity)
    points = np.linspace(0.0, 1.0, 200)[:, None] * [1.0, 0.0, 0.0]
    points[:, 2] = -0.8 * points[:, 0] * (1.0 - points[:, 0])
    points /= np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    sagging.reset(points)
    sagging.attach(0.0), sagging.attach(1.0)
    assert sagging.solve_static().is_stable


def test_a_hose_that_stands_on_end_is_unstable_and_hanging_it_is_not():
    # Standing it buckles under its own weight above rho g L^3 / EI = 7.837.
    for weight, is_stable in ((7.5, True), (8.2, False)):
        density = weight * EI / 9.81
        hose = make_hose(linear_density=density, gravity=(0.0, 0.0, -9.81))
        hose.reset([[0, 0, 0], [0, 0, 1]])
        hose.clamp(0.0)
        assert settle(hose).is_stable == is_stable


def test_the_state_and_its_reactions_are_not_touched_by_the_question():
    hose = make_hose(gravity=(0.0, 0.0, -9.81))
    clamp = hose.clamp(0.0)
    last = hose.clamp(1.0)
    hose.move(last, [0.9, 0.0, 0.1], spin=1.0)
    hose.solve_static()
    before, reaction = hose.snapshot(), hose.reaction(clamp)
    hose._dynamics.check_stability()
    after = hose.snapshot()
    np.testing.assert_array_equal(after["state"]["x"], before["state"]["x"])
    for name, part in before["holds"]["twist"].items():
        np.testing.assert_array_equal(after["holds"]["twist"][name], part, err_msg=name)
    np.testing.assert_array_equal(hose.reaction(clamp).moment, reaction.moment)


def test_a_fold_is_told():
    hose = make_hose()
    points = hose.control_points
    points[8:] = 2.0 * points[8] - points[8:]
    hose.set_control_points(points)
    assert hose.measure_least_stretch() < 0.1
    hose.reset([[0, 0, 0], [1, 0, 0]])
    hose.clamp(0.0)
    assert hose.measure_least_stretch() == pytest.approx(1.0)
    found = settle(hose)
    assert (found.is_folded, found.least_stretch) == (False, pytest.approx(1.0))
