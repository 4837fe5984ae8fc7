"""Moments about the tangent, the verdict of statics, even laying: promises of every hose model."""

import re
import warnings

import numpy as np
import pytest

from hose_mj.errors import HoseWarning
from hose_mj.hoses.protocol import Equilibrium
from hose_mj.hoses.registry import MODELS, make_hose
from hose_mj.hoses.spec import HoseSpec

EI, GJ = 0.05, 0.04
SIZES = {"geds": {"control_points": 12}, "flex": {"segments": 20}}
WITH_TWIST = sorted(name for name, entry in MODELS.items() if entry.twists)


def make(model, segments=40, **changes):
    values = {
        "length": 1.0,
        "axial_stiffness": 2e4,
        "bending_stiffness": EI,
        "torsional_stiffness": GJ,
        "linear_density": 0.1,
        "damping_time": 0.01,
    }
    options = SIZES.get(model, {"segments": segments})
    corrected = MODELS[model].has_clamp_correction and model != "flex"
    options = options | ({"clamp_correction": True} if corrected else {})
    gravity = (0.0, 0.0, 0.0)
    hose = make_hose(model, HoseSpec(**values | changes), timestep=5e-4, gravity=gravity, **options)
    hose.reset([[0, 0, 0], [1, 0, 0]])
    return hose


@pytest.fixture(params=sorted(MODELS))
def model(request):
    return request.param


# -- a moment along the tangent --------------------------------------------------------------------


@pytest.mark.parametrize("model", WITH_TWIST)
@pytest.mark.parametrize("end", [0.0, 1.0])
def test_torque_at_a_free_end_goes_to_the_clamp(model, end):
    hose = make(model)
    clamp = hose.clamp(1.0 - end)
    hose.apply_moment(end, [0.01, 0.0, 0.0])
    hose.solve_static()
    torque = 0.01 if end == 1.0 else -0.01
    np.testing.assert_allclose(hose.torque([0.2, 0.5, 0.8]), torque, rtol=1e-6)
    np.testing.assert_allclose(hose.twist([0.2, 0.5, 0.8]), torque / GJ, rtol=1e-6)
    np.testing.assert_allclose(hose.reaction(clamp).moment, [-0.01, 0.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(hose.reaction(clamp).force, 0.0, atol=1e-7)
    assert hose.energies().twisting == pytest.approx(0.5 * 0.01**2 / GJ, rel=0.03)
    hose.clear_loads()
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.2, 0.5, 0.8]), 0.0, atol=1e-8)


@pytest.mark.parametrize("model", WITH_TWIST)
def test_torque_inside_goes_to_the_only_clamp(model):
    hose = make(model)
    clamp = hose.clamp(0.0)
    hose.apply_moment(0.5, [0.01, 0.0, 0.0])
    hose.solve_static()
    # A spline for theta rounds the corner; a chain has it at a joint.
    np.testing.assert_allclose(hose.torque([0.2, 0.3]), 0.01, rtol=1e-3)
    np.testing.assert_allclose(hose.torque([0.7, 0.9]), 0.0, atol=1e-5)
    np.testing.assert_allclose(hose.reaction(clamp).moment, [-0.01, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("model", WITH_TWIST)
def test_torque_between_two_clamps_is_shared_by_stiffness(model):
    # GJ / 0.25 and GJ / 0.75 side by side.
    hose = make(model)
    clamps = hose.clamp(0.0), hose.clamp(1.0)
    hose.apply_moment(0.25, [0.01, 0.0, 0.0])
    hose.solve_static()
    np.testing.assert_allclose(hose.torque([0.1, 0.15]), 0.0075, rtol=0.03)
    np.testing.assert_allclose(hose.torque([0.5, 0.9]), -0.0025, rtol=0.03)
    found = [hose.reaction(clamp).moment[0] for clamp in clamps]
    np.testing.assert_allclose(found, [-0.0075, -0.0025], rtol=0.03)
    assert sum(found) == pytest.approx(-0.01, rel=1e-5)


@pytest.mark.parametrize("model", WITH_TWIST)
def test_torque_turns_a_damped_hose_while_it_runs(model):
    hose = make(model, segments=10)
    clamp = hose.clamp(0.0)
    hose.apply_moment(1.0, [0.01, 0.0, 0.0])
    hose.step(3000)
    np.testing.assert_allclose(hose.torque(0.5), 0.01, rtol=0.05)
    np.testing.assert_allclose(hose.reaction(clamp).moment[0], -0.01, rtol=0.05)


def test_a_moment_that_nothing_carries_is_said(model):
    hose = make(model, **({"torsional_stiffness": 0.0} if MODELS[model].twists else {}))
    hose.clamp(0.0)
    with pytest.warns(
        HoseWarning, match=r"moment of 0.01 N m about the tangent at s = 1 m is lost"
    ):
        hose.apply_moment(1.0, [0.01, 0.0, 0.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hose.apply_moment(1.0, [0.0, 0.01, 0.0])


# -- the verdict of statics ------------------------------------------------------------------------


def test_a_cantilever_is_stable(model):
    hose = make(model, segments=10)
    hose.clamp(0.0)
    hose.apply_force(1.0, [0.0, 0.0, -0.02])
    found = hose.solve_static()
    assert isinstance(found, Equilibrium)
    assert found.is_stable
    assert not found.is_folded
    assert found.least_stretch == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("share", [0.9, 1.1, 40.0])
def test_a_straight_column_beyond_eulers_load_is_told_from_one_below(model, share):
    hose = make(model)
    hose.clamp(0.0)
    hose.apply_force(1.0, [-share * np.pi**2 * EI / 4.0, 0.0, 0.0])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = hose.solve_static()
    bent = np.abs(hose.position(1.0)[0, 1:]).max() > 1e-3
    # It may also have left the straight state, which is stable then.
    assert found.is_stable == (share < 1.0 or bent)
    assert bool(said) == (not found.is_stable)
    if said:
        assert said[0].category is HoseWarning
        assert re.search("unstable", str(said[0].message))
        assert said[0].filename == __file__


# -- laying ----------------------------------------------------------------------------------------


def arch(s):
    """A quarter of a circle in the xz-plane, of length 1."""
    angle = np.pi / 2 * np.asarray(s)
    return np.stack([np.sin(angle), 0 * angle, np.cos(angle) - 1], axis=1) / (np.pi / 2)


def uneven_arch(s):
    """The same at a pace from 0.5 to 1.5."""
    return arch(s + 0.35 / np.pi * (np.sin(np.pi * s) ** 2 - 0.5 * np.sin(2 * np.pi * s)))


def test_the_pace_of_a_curve_makes_no_strain(model):
    hose, even = make(model), make(model)
    even.reset(arch)
    hose.reset(uneven_arch)
    places = np.linspace(0.0, 1.0, 7)
    np.testing.assert_allclose(hose.position(places), even.position(places), atol=1e-5)
    np.testing.assert_allclose(hose.tension(places), even.tension(places), atol=2.0)


# -- the material's frame --------------------------------------------------------------------------


def test_frames_are_rotations_along_the_tangent(model):
    hose = make(model, segments=10)
    hose.reset(arch)
    hose.clamp(0.0)
    places = np.array([0.0, 0.33, 0.71, 1.0])
    found = hose.frame(places)
    assert found.shape == (4, 3, 3)
    assert hose.frame(0.5).shape == (1, 3, 3)
    np.testing.assert_allclose(
        found @ found.transpose(0, 2, 1), np.tile(np.eye(3), (4, 1, 1)), atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(found), 1.0)
    np.testing.assert_allclose(found[:, :, 0], hose.tangent(places), atol=1e-9)


@pytest.mark.parametrize("model", WITH_TWIST)
def test_frames_turn_with_the_clamps(model):
    hose = make(model)
    hose.clamp(0.0)
    last = hose.clamp(1.0)
    before = hose.frame([0.0, 1.0])
    hose.move(last, spin=0.8)
    hose.solve_static()
    after = hose.frame([0.0, 0.5, 1.0])
    np.testing.assert_allclose(after[0], before[0], atol=1e-6)
    turned = np.arctan2(
        np.sum(after[2][:, 1] * before[1][:, 2]), np.sum(after[2][:, 1] * before[1][:, 1])
    )
    assert turned == pytest.approx(0.8, abs=0.03)
    half = np.arctan2(
        np.sum(after[1][:, 1] * before[0][:, 2]), np.sum(after[1][:, 1] * before[0][:, 1])
    )
    assert half == pytest.approx(0.4, abs=0.03)
