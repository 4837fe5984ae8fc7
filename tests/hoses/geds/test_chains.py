"""A hose without bending stiffness is a chain: it hangs and swings, and no NaN comes of it."""

import contextlib

import numpy as np
import pytest
import scipy.linalg
import scipy.special

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import Fitting, HoseSpec

DENSITY, GRAVITY = 0.1, 9.81
WEIGHT = DENSITY * GRAVITY
MODES = (1.20241, 2.76004, 4.32686)
"""Of a chain that hangs from one end, omega sqrt(L / g)."""


def make_chain(plane=None, control_points=32, length=1.0, gravity=GRAVITY, **changes):
    values = {
        "length": length,
        "axial_stiffness": 1e5,
        "bending_stiffness": 0.0,
        "linear_density": DENSITY,
    }
    spec = HoseSpec(**values | changes)
    return GedsHose(
        spec, plane=plane, gravity=(0, 0, -gravity), control_points=control_points, timestep=2e-3
    )


@pytest.mark.parametrize("plane", [None, "xz"])
def test_catenary(plane):
    hose = make_chain(plane, 64, 1.5, axial_stiffness=1e7)
    s = np.linspace(-1.0, 1.0, 201)
    hose.reset(np.stack([0.5 + 0.5 * s, 0 * s, 0.505 * (s**2 - 1.0)], axis=1))
    first, last = hose.attach(0.0, [0, 0, 0]), hose.attach(1.5, [1, 0, 0])
    assert hose.solve_static().is_stable
    assert -hose.position(0.75)[0, 2] == pytest.approx(0.50263326, rel=1e-3)
    force = hose.reaction(first).force
    assert np.linalg.norm(force) / WEIGHT == pytest.approx(0.81086973, rel=1e-3)
    assert -force[0] / WEIGHT == pytest.approx(0.30823647, rel=2e-3)
    np.testing.assert_allclose(force + hose.reaction(last).force, [0, 0, 1.5 * WEIGHT], atol=1e-7)


def test_a_straight_chain_without_tension_finds_its_catenary():
    hose = make_chain(axial_stiffness=2e3)
    hose.attach(0.0), hose.attach(1.0)
    hose.solve_static()
    # A shallow arc: w L^2 / (8 sag) = EA (8 / 3) (sag / L)^2.
    sag = (3.0 * WEIGHT / (64.0 * 2e3)) ** (1.0 / 3.0)
    assert -hose.position(0.5)[0, 2] == pytest.approx(sag, rel=0.01)
    np.testing.assert_allclose(hose.tension([0.2, 0.5]), WEIGHT / (8.0 * sag), rtol=0.01)


@pytest.mark.parametrize("plane", [None, "xz"])
def test_modes_of_a_hanging_chain(plane):
    hose = make_chain(plane, 24, axial_stiffness=1e6)
    hose.reset([[0, 0, 0], [0, 0, -1]])
    hose.attach(0.0)
    assert hose.solve_static().is_stable
    linear = hose.linearize()
    free = scipy.linalg.null_space(linear.constraints)
    squares = scipy.linalg.eigh(
        free.T @ linear.stiffness @ free, free.T @ linear.mass @ free, eigvals_only=True
    )
    found = np.sqrt(squares[: 6 if plane is None else 3] / GRAVITY)
    wanted = np.repeat(MODES, 2) if plane is None else MODES
    np.testing.assert_allclose(found, wanted, rtol=2e-3)


def test_a_chain_swings_with_its_period_and_keeps_its_energy():
    hose = make_chain("xz", 20, axial_stiffness=1e4)
    hose.reset([[0, 0, 0], [0, 0, -1]])
    hose.attach(0.0)
    hose.solve_static()
    amplitude = 2e-3

    def first_mode(s):
        speed = amplitude * scipy.special.j0(2.0 * MODES[0] * np.sqrt(1.0 - s))
        return np.outer(speed, [1, 0, 0])

    hose.reset([[0, 0, 0], [0, 0, -1]], velocity=first_mode)
    hose.attach(0.0)
    start = hose.energies().total
    quarter = 0.5 * np.pi / (MODES[0] * np.sqrt(GRAVITY))
    hose.step(round(2.0 * quarter / 2e-3))
    # After half a period it goes the other way, as fast.
    assert hose.velocity(1.0)[0, 0] == pytest.approx(-amplitude, rel=0.02)
    assert hose.energies().total <= start + 1e-9


def test_a_slack_chain_falls_and_folds_without_a_nan():
    hose = make_chain(damping_time=0.002, drag=0.02)
    hose.reset(lambda s: np.stack([s, 0 * s, 0.02 * np.sin(9 * s)], axis=1))
    hose.attach(0.0)
    hold = hose.attach(1.0)
    for k in range(1, 251):
        hose.move(hold, [1.0 - 4e-3 * min(k, 240), 0.0, 0.0])
        hose.step()
        assert np.all(np.isfinite(hose.control_points))
    assert hose.position(0.5)[0, 2] < -0.2


def test_a_chain_without_weight_is_no_nan():
    hose = make_chain(gravity=0.0)
    hose.reset(lambda s: np.stack([s, 0 * s, 0.02 * np.sin(9 * s)], axis=1))
    hose.attach(0.0), hose.attach(1.0)
    hose.step(20)
    assert np.all(np.isfinite(hose.control_points))
    with contextlib.suppress(StepError):
        hose.solve_static()
    assert np.all(np.isfinite(hose.control_points))


def test_what_bends_unequally_is_no_chain():
    for changes in ({"rest_curvature": 1.0}, {"second_bending_stiffness": 1.0}):
        with pytest.raises(InputError, match=r"bending_stiffness is 0\.0"):
            make_chain(**changes)
    with pytest.raises(InputError, match="bending_stiffness"):
        make_chain(fittings=(Fitting(start=0.2, end=0.4, bending_stiffness=1.0),))
