from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import BSpline

from hose_mj.hoses.geds import basis

lengths = st.floats(0.01, 100.0)
counts = st.integers(5, 40)
fractions = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=10)


def make_dense(knots, arc_lengths, derivative):
    """Row k: the derivative of all n basis functions at arc_lengths[k], from our four."""
    spans, values = basis.compute_basis(knots, arc_lengths)
    dense = np.zeros((len(arc_lengths), len(knots) - 4))
    for k, span in enumerate(spans):
        dense[k, span : span + 4] = values[k, derivative]
    return dense


@given(n=counts, length=lengths, at=fractions)
@settings(deadline=None, max_examples=60)
def test_values_and_derivatives_are_those_of_scipy(n, length, at):
    knots = basis.make_knots(n, length)
    s = np.minimum(np.array(at) * length, length)
    for derivative in range(3):
        spline = BSpline(knots, np.eye(n), 3).derivative(derivative) if derivative else None
        wanted = spline(s) if spline else BSpline(knots, np.eye(n), 3)(s)
        scale = (n / length) ** derivative
        found = make_dense(knots, s, derivative)
        # At a knot r'' has one value, but the rounding of s / h may choose either side.
        np.testing.assert_allclose(found, wanted, atol=1e-8 * scale)


def test_both_ends_and_all_knots_are_on_the_hose():
    knots = basis.make_knots(9, 2.0)
    spans, _ = basis.compute_basis(knots, np.unique(knots))
    assert spans.tolist() == [0, 1, 2, 3, 4, 5, 5]


@given(n=counts, length=lengths, at=fractions)
@settings(deadline=None, max_examples=60)
def test_partition_of_unity(n, length, at):
    _, values = basis.compute_basis(basis.make_knots(n, length), np.array(at) * length)
    np.testing.assert_allclose(values[:, 0].sum(axis=1), 1.0, rtol=1e-13)
    np.testing.assert_allclose(values[:, 1].sum(axis=1), 0.0, atol=1e-11 * n / length)
    assert np.all(values[:, 0] >= -1e-14)


@given(n=counts, length=lengths, at=fractions)
@settings(deadline=None, max_examples=60)
def test_greville_points_rest_straight_and_unstretched(n, length, at):
    knots = basis.make_knots(n, length)
    greville = basis.make_greville(knots)
    s = np.array(at) * length
    np.testing.assert_allclose(make_dense(knots, s, 0) @ greville, s, atol=1e-13 * length)
    np.testing.assert_allclose(make_dense(knots, s, 1) @ greville, 1.0, rtol=1e-11)


def make_dense_mass(knots, density):
    band = basis.make_mass(knots, np.full((len(knots) - 7, 4), density))
    n = len(band)
    mass = np.zeros((n, n))
    for j in range(n):
        for k in range(min(4, n - j)):
            mass[j + k, j] = mass[j, j + k] = band[j, k]
    return mass


def test_mass_matrix_is_the_integral_of_products():
    n, length, density = 7, 1.3, 0.2
    knots = basis.make_knots(n, length)
    splines = [BSpline(knots, row, 3) for row in np.eye(n)]
    mass = make_dense_mass(knots, density)
    pieces = np.unique(knots)
    for i, left in enumerate(splines):
        for j, right in enumerate(splines):
            parts = [
                quad(lambda s, f=left, g=right: f(s) * g(s), a, b)[0] for a, b in pairwise(pieces)
            ]
            assert mass[i, j] == pytest.approx(density * sum(parts), rel=1e-10, abs=1e-16)


@given(n=counts, length=lengths, density=st.floats(1e-4, 10.0))
@settings(deadline=None, max_examples=30)
def test_total_mass_and_first_moment(n, length, density):
    knots = basis.make_knots(n, length)
    mass = make_dense_mass(knots, density)
    assert mass.sum() == pytest.approx(density * length, rel=1e-12)
    centre = np.ones(n) @ mass @ basis.make_greville(knots)
    assert centre == pytest.approx(density * length**2 / 2, rel=1e-12)
    assert np.linalg.eigvalsh(mass)[0] > 0.0


def test_interpolation_goes_through_the_points():
    rng = np.random.default_rng(1)
    knots = basis.make_knots(12, 1.0)
    s, points = np.linspace(0.0, 1.0, 12), rng.normal(size=(12, 3))
    control_points = basis.interpolate(knots, s, points)
    np.testing.assert_allclose(make_dense(knots, s, 0) @ control_points, points, atol=1e-11)


def test_interpolation_is_of_fourth_order():
    fine = np.linspace(0.0, 1.0, 2001)
    errors = []
    for n in (19, 35, 67):
        knots, s = basis.make_knots(n, 1.0), np.linspace(0.0, 1.0, n)
        control_points = basis.interpolate(knots, s, np.sin(5.0 * s)[:, None])
        found = make_dense(knots, fine, 0) @ control_points
        errors.append(np.abs(found[:, 0] - np.sin(5.0 * fine)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.8), orders


def test_quadrature_tables_integrate_polynomials():
    tables = basis.make_tables(basis.make_knots(8, 2.0))
    assert tables.weights.sum() == pytest.approx(1.0, rel=1e-15)
    # xi^2 has the mean 1/3 over a span, so the linear mode sqrt(3) xi has unit norm.
    assert tables.weights @ tables.linear**2 == pytest.approx(1.0, rel=1e-14)
    assert tables.weights @ tables.linear == pytest.approx(0.0, abs=1e-15)
    assert tables.span_length * len(tables.first) == pytest.approx(2.0, rel=1e-15)


@pytest.mark.parametrize("n", [5, 6, 9, 10, 11, 24])
def test_every_span_finds_its_products(n):
    tables = basis.make_tables(basis.make_knots(n, 1.3))
    n_spans = n - 3
    assert len(tables.products) == len(tables.turn_products) == min(n_spans, 7)
    value, first, second = tables.value, tables.first, tables.second
    pairs = [(first, first), (first, second), (second, first), (second, second)]
    of_theta = [(first, first), (value, first), (value, second), (first, first), (value, value)]
    for e in range(n_spans):
        kind = basis.find_kind(n_spans, e)
        for table, factors in ((tables.products, pairs), (tables.turn_products, of_theta)):
            wanted = [np.outer(a[e, g], b[e, g]).ravel() for a, b in factors for g in range(3)]
            scale = np.abs(wanted).max()
            np.testing.assert_allclose(table[kind], wanted, atol=1e-12 * scale)
