"""Closed forms against published digits, their limits, and other ways to the same numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.special import j0

from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import reference

LAST_DIGIT = 0.51e-8
"""Half a unit of the eighth decimal, the last that the table of reference values has."""


@pytest.mark.parametrize(
    ("gamma", "ratio"),
    [
        (0.1, 0.01249955),
        (1.0, 0.12456177),
        (3.0, 0.36462083),
        (10.0, 1.06680232),
        (30.0, 2.54721393),
        (100.0, 5.88810462),
    ],
)
def test_heavy_cantilever_has_the_published_digits(gamma, ratio):
    assert reference.heavy_cantilever(gamma) == pytest.approx(ratio, rel=0, abs=LAST_DIGIT)


@pytest.mark.parametrize(
    ("alpha", "axial", "transverse"),
    [
        (1.0, 0.05643324, 0.30172077),
        (2.0, 0.16064172, 0.49345748),
        (5.0, 0.38762836, 0.71379152),
        (10.0, 0.55499560, 0.81060902),
    ],
)
def test_tip_load_has_the_published_digits(alpha, axial, transverse):
    assert reference.tip_load(alpha) == pytest.approx((axial, transverse), rel=0, abs=LAST_DIGIT)


def test_small_loads_follow_linear_beam_theory():
    small = 1e-3
    axial, transverse = reference.tip_load(small)
    assert transverse == pytest.approx(small / 3.0, rel=1e-6)
    assert axial == pytest.approx(small**2 / 15.0, rel=1e-5)
    assert reference.heavy_cantilever(small) == pytest.approx(small / 8.0, rel=1e-6)


@pytest.mark.parametrize(("load", "weight"), [(5.0, 0.0), (0.0, 10.0)])
def test_the_elastica_is_that_of_a_boundary_value_solver(load, weight):
    """Angle down from the horizontal: angle'' = -(load + weight (1 - s)) cos angle."""

    def rates(s, state):
        angle, bend = state[:2]
        pull = load + weight * (1.0 - s)
        return np.stack([bend, -pull * np.cos(angle), np.cos(angle), np.sin(angle)])

    def ends(wall, tip):
        return np.array([wall[0], tip[1], wall[2], wall[3]])

    s = np.linspace(0.0, 1.0, 50)
    solution = solve_bvp(rates, ends, s, np.zeros((4, 50)), tol=1e-9, max_nodes=20000)
    assert solution.success
    x, y = solution.y[2:, -1]
    if weight:
        assert reference.heavy_cantilever(weight) == pytest.approx(y / x, rel=1e-7)
    else:
        assert reference.tip_load(load) == pytest.approx((1.0 - x, y), rel=1e-7)


@pytest.mark.parametrize("turn", [0.1, 1.0, math.pi, 5.0, 2.0 * math.pi])
def test_an_end_moment_makes_an_arc_of_a_circle(turn):
    x, y = reference.end_moment(turn)
    radius = 1.0 / turn
    assert math.hypot(x, y - radius) == pytest.approx(radius, rel=1e-12)
    chord = 2.0 * radius * abs(math.sin(0.5 * turn))
    assert math.hypot(x, y) == pytest.approx(chord, abs=1e-15)


def test_a_full_turn_closes_the_circle():
    assert reference.end_moment(2.0 * math.pi) == pytest.approx((0.0, 0.0), abs=1e-15)


@pytest.mark.parametrize(
    ("ends", "roots"),
    [
        ("clamped-free", [1.87510407, 4.69409113, 7.85475744]),
        ("free-free", [4.73004074]),
        ("clamped-pinned", [3.92660231]),
    ],
)
def test_beam_frequencies_have_the_published_digits(ends, roots):
    found = np.sqrt(reference.beam_frequencies(ends, len(roots)))
    np.testing.assert_allclose(found, roots, rtol=0, atol=LAST_DIGIT)


@pytest.mark.parametrize(
    ("ends", "residual", "limit"),
    [
        ("clamped-free", lambda b: np.cos(b) * np.cosh(b) + 1.0, 0.5),
        ("free-free", lambda b: np.cos(b) * np.cosh(b) - 1.0, 1.5),
        ("clamped-pinned", lambda b: np.tan(b) - np.tanh(b), 1.25),
    ],
)
def test_beam_frequencies_are_neighbouring_roots_of_their_equation(ends, residual, limit):
    roots = np.sqrt(reference.beam_frequencies(ends, 5))
    for root in roots:
        assert residual(root * (1.0 - 1e-9)) * residual(root * (1.0 + 1e-9)) < 0.0
    # None is left out: roots approach (limit + k) pi, k = 0, 1, ...
    np.testing.assert_allclose(roots / math.pi, limit + np.arange(5), rtol=0, atol=0.1)
    assert roots[-1] / math.pi == pytest.approx(limit + 4.0, abs=1e-5)


def test_chain_frequencies_are_half_the_zeros_of_the_bessel_function():
    found = reference.chain_frequencies(4)
    np.testing.assert_allclose(j0(2.0 * found), 0.0, atol=1e-14)
    np.testing.assert_allclose(found[:3], [1.20241, 2.76004, 4.32686], rtol=0, atol=0.5e-5)
    # No zero is skipped: they draw towards a distance of pi.
    assert np.all(np.abs(np.diff(2.0 * found) - math.pi) < 0.03)


def test_catenary_has_the_published_digits():
    ratio = 1.5
    sag, tension = reference.catenary(ratio)
    # The table has lengths by the span, and the tension by the weight of one span.
    published = (0.50263326, 0.81086973)
    assert (sag * ratio, tension * ratio) == pytest.approx(published, rel=0, abs=LAST_DIGIT)


@pytest.mark.parametrize("ratio", [1.001, 1.1, 1.5, 3.0, 20.0])
def test_forces_on_half_a_catenary_balance(ratio):
    """T^2 = H^2 + (W / 2)^2, and T - H is the weight of a piece as long as the sag."""
    sag, tension = reference.catenary(ratio)
    assert tension**2 == pytest.approx((tension - sag) ** 2 + 0.25, rel=1e-12)


def test_catenary_limits():
    # Shallow: a parabola whose length exceeds its span by 8 sag^2 / (3 span).
    excess = 1e-3
    sag, _ = reference.catenary(1.0 + excess)
    assert sag == pytest.approx(math.sqrt(3.0 / 8.0 * excess), rel=2e-3)
    # Deep: two vertical strands, each of which carries half the weight.
    sag, tension = reference.catenary(500.0)
    assert (sag, tension) == pytest.approx((0.5, 0.5), rel=1e-3)


def test_euler_loads():
    assert reference.euler_load("pinned") == pytest.approx(math.pi**2)
    assert reference.euler_load("clamped-free") == pytest.approx(math.pi**2 / 4.0)


def test_the_elastic_catenary_is_in_balance_and_tends_to_the_catenary():
    spec = HoseSpec(
        length=1.5,
        axial_stiffness=40.0,
        bending_stiffness=0.0,
        linear_density=0.1,
        outer_radius=1e-3,
    )
    (pull, up), curve = reference.elastic_catenary(spec, 1.0, 2.0)
    assert up == pytest.approx(0.5 * 2.0 * 1.5)
    np.testing.assert_allclose(curve([0.0, 1.5]), [[0, 0, 0], [1, 0, 0]], atol=1e-12)
    s = np.linspace(0.01, 1.49, 20)
    slope = curve(s, 1)
    force = np.stack([pull + 0.0 * s, 2.0 * s - up], axis=1)  # what each part carries
    tension = np.linalg.norm(force, axis=1)
    stretched = force / tension[:, None] * (1.0 + tension / 40.0)[:, None]
    np.testing.assert_allclose(slope[:, [0, 2]], stretched, atol=1e-8)
    stiff = replace(spec, axial_stiffness=1e9)
    (pull, up), curve = reference.elastic_catenary(stiff, 1.0, 2.0)
    sag, support = reference.catenary(1.5)
    assert -curve(0.75)[2] / 1.5 == pytest.approx(sag, rel=1e-6)
    assert np.hypot(pull, up) / 3.0 == pytest.approx(support, rel=1e-6)


@pytest.mark.parametrize("k", [0.2, 0.7, 0.9])
def test_the_whirling_rope_is_in_balance(k):
    length, unit, curve = reference.whirling_rope(k, 0.5)
    np.testing.assert_allclose(curve([0.0, length]), [[-0.5, 0], [0.5, 0]], atol=1e-9)
    s = np.linspace(0.05, 0.95, 19) * length
    slope = curve(s, 1)
    np.testing.assert_allclose(np.linalg.norm(slope, axis=1), 1.0, atol=1e-6)
    # The axial force is the same all along; across, T r' falls by the centripetal force r.
    across = curve(s, 2)[:, 1] / slope[:, 0] - slope[:, 1] * curve(s, 2)[:, 0] / slope[:, 0] ** 2
    np.testing.assert_allclose(-unit * across, curve(s)[:, 1], rtol=2e-4)


def test_the_plectoneme_meets_its_table():
    # Angle .3 and .5: T h^2 / EI and M h / EI.
    for tension, moment in ((0.01305, 0.05975), (0.12419, 0.35797)):
        assert reference.find_plectoneme_moment(tension) == pytest.approx(moment, rel=1e-3)


def test_the_knots_pull_tends_to_that_of_a_loop_of_line():
    for size in (150.0, 400.0, 1000.0):
        # 2 pi^2 EI (1 + 2.35 sqrt(h / e)) / e^2, to leading order.
        assert reference.find_knot_pull(size) == pytest.approx(1 + 2.35 * size**-0.5, rel=0.12)
