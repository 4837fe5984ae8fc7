"""How a user's hose is laid: as long as it is, through its holds, along its clamps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hose_mj.assets import find_asset
from hose_mj.scenes.hose_file.grasps import Grasp
from hose_mj.scenes.hose_file.hose_file import read_hose_file
from hose_mj.validation.user_hose.case import bend_between, make_line

OWN = read_hose_file(find_asset("hoses/garden_hose.toml"))
LENGTH = OWN.spec.length
DOWN = (0.0, 0.0, -9.81)
vectors = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: math.hypot(*v) > 0.1)
units = vectors.map(lambda v: tuple(x / math.hypot(*v) for x in v))


def lay(*holds, **changes):
    return make_line(replace(OWN, holds=tuple(holds), **changes))


def measure(points):
    return float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


@settings(deadline=None)
@given(units, units, vectors, st.floats(0.0, 1.0), st.sampled_from([DOWN, (0.0, 0.0, 0.0)]))
def test_a_curve_of_a_given_length_between_two_clamps(one, other, aim, share, gravity):
    ends = [np.zeros(3), share * np.array(aim) / math.hypot(*aim)]
    points = bend_between(ends, [np.array(one), np.array(other)], 1.0, gravity)
    np.testing.assert_allclose(points[[0, -1]], ends, atol=1e-12)
    assert measure(points) == pytest.approx(1.0, abs=1e-6)
    if share < 0.9:  # a taut hose has no room to leave its clamps along their tangents
        fine = np.diff(points, axis=0)[[0, -1]]
        fine /= np.linalg.norm(fine, axis=1, keepdims=True)
        assert np.all(np.einsum("ij,ij->i", fine, [one, other]) > 0.0)


@settings(deadline=None, max_examples=30)
@example((0.0, 0.0, 1.0), (0.0, 1e-112, 0.0), 0.25)  # straight up from a clamp, and back to it
@given(units, st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.floats(0.1, 0.9))
def test_a_line_passes_its_holds_evenly(tangent, position, share):
    inside = Grasp(share * LENGTH, tuple(share * LENGTH * x for x in position), None)
    line = lay(Grasp(0.0, (0.0, 0.0, 0.0), tangent), inside)
    np.testing.assert_allclose(line(np.array([0.0]))[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(line(np.array([inside.arc_length]))[0], inside.position, atol=1e-6)
    assert measure(line(np.linspace(0.0, LENGTH, 4001))) == pytest.approx(LENGTH, rel=2e-2)


@pytest.mark.parametrize("gravity", [DOWN, (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("end", [0.0, LENGTH])
def test_from_a_single_attachment_it_hangs(gravity, end):
    line = lay(Grasp(end, (0.3, 0.2, 1.0), None), gravity=gravity)
    far = line(np.array([LENGTH - end]))[0] - [0.3, 0.2, 1.0]
    expected = [0.0, 0.0, -LENGTH] if any(gravity) else [LENGTH if end == 0.0 else -LENGTH, 0, 0]
    np.testing.assert_allclose(far, expected, atol=1e-9)


def test_nothing_holds_it():
    np.testing.assert_allclose(lay()(np.array([0.0, 2.0])), [[0, 0, 0], [2, 0, 0]])


def test_along_the_points_of_the_user():
    shape = ((0.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 2.0, 1.0))
    line = lay(shape=shape)
    np.testing.assert_allclose(line(np.array([0.0, 1.0, 2.5])), [[0, 0, 0], [0, 1, 0], [0, 2, 0.5]])


@pytest.mark.parametrize("torsion", [0.0, 3.0, -2.0])
def test_a_coil_has_its_curvature_and_torsion(torsion):
    spec = replace(OWN.spec, rest_curvature=5.0, rest_torsion=torsion)
    clamp = Grasp(0.0, (1.0, 2.0, 3.0), (0.0, 0.0, 1.0))
    line = lay(clamp, spec=spec)
    h, s = 1e-3, 1.3
    points = line(s + h * np.arange(-2.0, 3.0))
    first = (points[3] - points[1]) / (2 * h)
    second = (points[3] - 2 * points[2] + points[1]) / h**2
    third = (points[4] - 2 * points[3] + 2 * points[1] - points[0]) / (2 * h**3)
    across = np.cross(first, second)
    assert np.linalg.norm(first) == pytest.approx(1.0, abs=1e-4)
    assert np.linalg.norm(across) == pytest.approx(5.0, rel=1e-4)
    assert across @ third / (across @ across) == pytest.approx(torsion, abs=1e-3)
    start = line(np.array([0.0, 1e-6]))
    np.testing.assert_allclose(start[0], clamp.position)
    np.testing.assert_allclose((start[1] - start[0]) / 1e-6, clamp.tangent, atol=1e-5)
