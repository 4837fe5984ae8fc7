"""The cubic B-spline of the hose: knots, basis, quadrature, mass (thesis A.1-A.3, A.12-A.19).

Everything that does not change while a hose moves is computed here, once. Arc length s runs over
the rest length, [0, L]; n control points make n - 3 spans, and four control points, from number
`span` on, shape each span.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from hose_mj.hoses.protocol import Array
from hose_mj.jit import compiled, inlined

DEGREE = 3
MASS_WEIGHTS = np.polynomial.legendre.leggauss(4)[1] / 2.0
"""Weights of the mass matrix's Gauss points, as fractions of a span."""


class Tables(NamedTuple):
    """Quadrature tables of the strain energy: three Gauss points on each of S spans.

    Attributes:
        value: basis N at the Gauss points, (S, 3, 4).
        first: basis derivatives dN/ds at the Gauss points, (S, 3, 4).
        second: d2N/ds2, (S, 3, 4).
        ends: dN/ds at the end of each span, (S, 4).
        products: outer products of derivatives, of which a tangent stiffness is made: first x first
            at each Gauss point, first x second, second x first, second x second, (7, 12, 16), for
            each kind of span (`find_kind`).
        turn_products: the same for theta with the place, first x first, value x first, value x
            second, and for theta with itself, first x first, value x value, (7, 15, 16).
        weights: Gauss weights that sum to 1, (3,).
        linear: sqrt(3) xi at the Gauss points, xi in [-1, 1]: the linear strain mode, (3,).
        gaps: distance of each Gauss point from the one before it, in span lengths, (3,).
        span_length: L / S (m).
    """

    value: Array
    first: Array
    second: Array
    ends: Array
    products: Array
    turn_products: Array
    weights: Array
    linear: Array
    gaps: Array
    span_length: float


def make_knots(n_control_points: int, length: float) -> Array:
    """Returns the open-uniform knots over [0, length], shape (n + 4,)."""
    inner = np.linspace(0.0, length, n_control_points - DEGREE + 1)
    return np.concatenate([[0.0] * DEGREE, inner, [length] * DEGREE])


def make_greville(knots: Array) -> Array:
    """Returns the arc lengths at which control points rest on a straight hose, shape (n,)."""
    return np.asarray(np.minimum((knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0, knots[-1]))


@compiled
def evaluate_basis(knots, arc_lengths, spans, values):
    """Cox-de Boor recursion (thesis A.2) with two derivatives.

    Writes the span (k,) of each arc length and `values` (k, 3, 4): N, dN/ds and d2N/ds2 of the four
    basis functions that do not vanish there.
    """
    last_span = len(knots) - 2 * DEGREE - 2
    step = knots[DEGREE + 1] - knots[DEGREE]
    lower = np.zeros((4, 4))
    for k in range(len(arc_lengths)):
        s = arc_lengths[k]
        span = min(max(int(s / step), 0), last_span)
        spans[k] = span
        lower[:, :] = 0.0
        lower[0, 0] = 1.0
        # lower[p, i]: N_(span + 3 - p + i, p)(s), one degree after the other.
        for degree in range(1, DEGREE + 1):
            for i in range(degree + 1):
                at = span + DEGREE - degree + i
                value = 0.0
                if i > 0:
                    value += (
                        (s - knots[at])
                        / (knots[at + degree] - knots[at])
                        * lower[degree - 1, i - 1]
                    )
                if i < degree:
                    gap = knots[at + degree + 1] - knots[at + 1]
                    value += (knots[at + degree + 1] - s) / gap * lower[degree - 1, i]
                lower[degree, i] = value
        for i in range(4):
            values[k, 0, i] = lower[3, i]
            values[k, 1, i] = _difference(knots, span, 3, i, lower[2, i - 1], lower[2, i])
            before = _difference(knots, span, 2, i - 1, lower[1, i - 2], lower[1, i - 1])
            after = _difference(knots, span, 2, i, lower[1, i - 1], lower[1, i])
            values[k, 2, i] = _difference(knots, span, 3, i, before, after)


@inlined
def find_kind(n_spans, e):
    """Kind of span e: the first three and the last three are one each, all between them a seventh.

    Tables by kind stay in the processor's nearest memory however long the hose is.
    """
    return max(min(e, 3), e - n_spans + min(n_spans, 7))


@compiled
def _difference(knots, span, degree, i, before, after):
    """Derivative of N_(span + 3 - degree + i, degree) from its two neighbours of lower degree."""
    at = span + DEGREE - degree + i
    value = 0.0
    if 0 < i <= degree:
        value += degree / (knots[at + degree] - knots[at]) * before
    if 0 <= i < degree:
        value -= degree / (knots[at + degree + 1] - knots[at + 1]) * after
    return value


def compute_basis(knots: Array, arc_lengths: Array) -> tuple[np.ndarray, Array]:
    """Returns the spans (k,) and the basis values and derivatives (k, 3, 4) at arc lengths (k,)."""
    spans = np.empty(len(arc_lengths), dtype=np.int64)
    values = np.empty((len(arc_lengths), 3, 4))
    evaluate_basis(knots, arc_lengths, spans, values)
    return spans, values


def make_tables(knots: Array) -> Tables:
    """Returns the quadrature tables of the strain energy."""
    n_spans = len(knots) - 2 * DEGREE - 1
    nodes, weights = np.polynomial.legendre.leggauss(3)
    span_length = float(knots[-1]) / n_spans
    at = (np.arange(n_spans)[:, None] + 0.5 + 0.5 * nodes) * span_length
    _, values = compute_basis(knots, at.ravel())
    value, first, second = (
        np.ascontiguousarray(values[:, k].reshape(n_spans, 3, 4)) for k in range(3)
    )
    # One span of each kind; see `find_kind`.
    of = [e for e in range(n_spans) if e < 4 or e >= n_spans - 3]
    return Tables(
        value,
        first,
        second,
        _compute_end_slopes(knots),
        _multiply(first, first, first, second, second, first, second, second)[of],
        _multiply(first, first, value, first, value, second, first, first, value, value)[of],
        weights / 2.0,
        np.sqrt(3.0) * nodes,
        np.array([1.0 - nodes[2], 0.5 * nodes[2], 0.5 * nodes[2]]),
        span_length,
    )


def _multiply(*factors: Array) -> Array:
    """Returns outer products of pairs of basis rows at the Gauss points, (S, 3 pairs, 16)."""
    n_spans = len(factors[0])
    outer = [
        np.einsum("sgi,sgj->sgij", left, right).reshape(n_spans, 3, 16)
        for left, right in zip(factors[::2], factors[1::2], strict=True)
    ]
    return np.concatenate(outer, axis=1)


def _compute_end_slopes(knots: Array) -> Array:
    """Returns dN/ds of a span's four basis functions at its end, (S, 4)."""
    n_spans = len(knots) - 2 * DEGREE - 1
    spans, values = compute_basis(knots, knots[DEGREE + 1 : -DEGREE])
    slopes = np.zeros((n_spans, 4))
    for e, (span, slope) in enumerate(zip(spans, values[:, 1], strict=True)):
        # A knot may count to the span that begins there, whose last basis function is 0 there.
        slopes[e, span - e :] = slope[: 4 - (span - e)]
    return slopes


def make_mass(knots: Array, linear_density: Array) -> Array:
    """Returns the constant mass matrix of thesis A.18 per coordinate, as a lower band (n, 4).

    Entry (j, k) couples control points j + k and j; four Gauss points a span, at which the linear
    density (S, 4) kg/m is given, integrate that of a uniform hose exactly.
    """
    n_spans = len(knots) - 2 * DEGREE - 1
    nodes = np.polynomial.legendre.leggauss(4)[0]
    span_length = float(knots[-1]) / n_spans
    at = (np.arange(n_spans)[:, None] + 0.5 + 0.5 * nodes) * span_length
    spans, values = compute_basis(knots, at.ravel())
    scale = (linear_density * MASS_WEIGHTS * span_length).ravel()
    mass = np.zeros((n_spans + DEGREE, 4))
    for span, basis, weight in zip(spans, values[:, 0], scale, strict=True):
        for j in range(4):
            for i in range(j, 4):
                mass[span + j, i - j] += weight * basis[i] * basis[j]
    return mass


def interpolate(knots: Array, arc_lengths: Array, points: Array) -> Array:
    """Returns control points (n, d) of the spline through n points at n arc lengths (A.3)."""
    design = BSpline.design_matrix(arc_lengths, knots, DEGREE).toarray()
    return np.asarray(np.linalg.solve(design, points))
