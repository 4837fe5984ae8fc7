"""One Newton solver for every implicit stage and for statics, with holds as Lagrange multipliers.

A stage of length h asks for the x with

    M [(x - X - h V) / h^2 + c (x - X) / h] + dU(x) + C (x - X) / h - f - G^T lambda = 0,  G x = g,

and then v = (x - X) / h. Backward Euler: h = dt, X = x_n, V = v_n. BDF2: h = 2 dt / 3,
X = (4 x_n - x_(n-1)) / 3, V likewise. Statics: h infinite. G are the rows of the holds; the
multipliers lambda are the forces with which they act on the hose.

The solver raises nothing: it returns a verdict, and the boundary (model.py) turns it into an error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.band import factorize, solve_lower, solve_upper
from hose_mj.hoses.geds.basis import Tables
from hose_mj.hoses.geds.compiled import compiled, kernel
from hose_mj.hoses.geds.contact import add_contact
from hose_mj.hoses.geds.contact_law import TOLERANCE, Contact
from hose_mj.hoses.geds.energy import Elasticity, Span, assemble, make_span
from hose_mj.hoses.geds.self_contact import add_self_contact
from hose_mj.hoses.model import Array

DONE, NOT_CONVERGED, NOT_FINITE, NOT_POSITIVE, DEPENDENT_HOLDS = range(5)
VERDICTS = (
    "done",
    "Newton's iteration did not converge",
    "numbers left the finite range",
    "no positive definite stiffness was found",
    "two holds ask for the same thing, or more than the spline can follow there",
)


class Hose(NamedTuple):
    """Constants of one hose: tables, elasticity, mass band (n, 4) and drag per mass c (1/s)."""

    tables: Tables
    elasticity: Elasticity
    mass: Array
    drag_rate: float


class Holds(NamedTuple):
    """m rows of G x = g.

    Attributes:
        start: index of the first of the 4 d unknowns that a row reads, (m,).
        rows: their coefficients, (m, 4 d).
        before: g at the beginning of a step, (m,).
        after: g at its end, (m,).
        multipliers: lambda at the end of the last step, (m,), written.
    """

    start: np.ndarray
    rows: Array
    before: Array
    after: Array
    multipliers: Array


class Loads(NamedTuple):
    """Dead loads, and what may be touched.

    Attributes:
        force: generalised force on the control points, gravity included, flat (n d,).
        moment_start: index of the first of the 4 d unknowns at each point moment, (k,).
        moment_basis: dN/ds there, (k, 4).
        moment: (k, 3) N m; a planar hose reads the first entry.
        contact: obstacles; see contact.py.
    """

    force: Array
    moment_start: np.ndarray
    moment_basis: Array
    moment: Array
    contact: Contact


class Limits(NamedTuple):
    """When to stop.

    Attributes:
        tolerance: largest move of a control point in the last iteration (m).
        max_iterations: Newton iterations at most.
        rotation_cap: largest turn of a tangent in one iteration (rad).
        line_search: True to shorten steps that run past the lowest point along them.
        hold_weight: weight of G^T G in the matrix, relative to its mean diagonal; above 0 where
            the hose alone has rigid motions (statics).
    """

    tolerance: float
    max_iterations: int
    rotation_cap: float
    line_search: bool
    hold_weight: float


class Work(NamedTuple):
    """Work arrays of one hose and the multipliers of its holds.

    x, X and V are a stage, x_now and v_now a step in the making, flat (n d,): nothing reaches the
    state before the step is done.
    """

    span: Span
    gradient: Array
    rate: Array
    band: Array
    lower: Array
    schur: Array
    multipliers: Array
    shift: Array
    residual: Array
    step: Array
    x: Array
    X: Array
    V: Array
    x_now: Array
    v_now: Array


@compiled
def make_work(n_control_points, dimension, n_rows):  # type: ignore[no-untyped-def]
    """Returns work arrays for n control points of d unknowns each and m rows of holds."""
    size = n_control_points * dimension
    padded = size + 4 * dimension
    return Work(
        make_span(),
        np.zeros(padded),
        np.zeros(padded),
        np.zeros((padded, 8 * dimension)),
        np.zeros((n_rows + 1, padded)),
        np.zeros((n_rows, n_rows)),
        np.zeros(n_rows),
        np.zeros(padded),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
    )


@kernel
def multiply_mass(axes, mass, factor, x, out):  # type: ignore[no-untyped-def]
    """Adds factor M x to out; x and out flat, the first n d entries count."""
    d = len(axes)
    n = mass.shape[0]
    for j in range(n):
        for c in range(d):
            out[j * d + c] += factor * mass[j, 0] * x[j * d + c]
        for k in range(1, min(4, n - j)):
            weight = factor * mass[j, k]
            for c in range(d):
                out[(j + k) * d + c] += weight * x[j * d + c]
                out[j * d + c] += weight * x[(j + k) * d + c]


@kernel
def add_mass(axes, mass, factor, band):  # type: ignore[no-untyped-def]
    """Adds factor M to a band."""
    d = len(axes)
    for j in range(mass.shape[0]):
        for c in range(d):
            for k in range(4):
                band[j * d + c, k * d] += factor * mass[j, k]


@kernel
def add_moments(axes, loads, exact, x, work):  # type: ignore[no-untyped-def]
    """Subtracts the generalised force of the point moments, M x a / A on a = r', from the gradient.

    Its derivative goes into the band: all of it in the plane, its symmetric part in space.
    """
    d = len(axes)
    a = work.span.a[0]
    turn = work.span.b[0]
    for k in range(len(loads.moment_start)):
        start = loads.moment_start[k]
        A = 0.0
        for c in range(d):
            a[c] = 0.0
            for i in range(4):
                a[c] += loads.moment_basis[k, i] * x[start + i * d + c]
            A += a[c] * a[c]
        A = max(A, 1e-4)
        if d == 2:
            turn[0] = -loads.moment[k, 0] * a[1] / A
            turn[1] = loads.moment[k, 0] * a[0] / A
        else:
            for c in range(3):
                m1 = loads.moment[k, (c + 1) % 3]
                m2 = loads.moment[k, (c + 2) % 3]
                turn[c] = (m1 * a[(c + 2) % 3] - m2 * a[(c + 1) % 3]) / A
        for i in range(4):
            for c1 in range(d):
                work.gradient[start + i * d + c1] -= loads.moment_basis[k, i] * turn[c1]
                if not exact:
                    continue
                for j in range(i + 1):
                    weight = loads.moment_basis[k, i] * loads.moment_basis[k, j] / A
                    for c2 in range(d if j < i else c1 + 1):
                        bend = turn[c1] * a[c2] + a[c1] * turn[c2]
                        work.band[start + j * d + c2, (i - j) * d + c1 - c2] += weight * bend


@kernel
def build(axes, hose, stage, loads, scale, exact, x, work):  # type: ignore[no-untyped-def]
    """Fills work.gradient with the residual without holds, work.band with its derivative.

    Returns how many contact points touch something.
    """
    h, X, V = stage
    size = len(x)
    for k in range(size):
        work.gradient[k] = -scale * loads.force[k]
        for m in range(4 * len(axes)):
            work.band[k, m] = 0.0
    inertia = 1.0 / (h * h) + hose.drag_rate / h
    if inertia > 0.0:
        for k in range(size):
            work.rate[k] = (x[k] - X[k]) * inertia - V[k] / h
        multiply_mass(axes, hose.mass, 1.0, work.rate, work.gradient)
        add_mass(axes, hose.mass, inertia, work.band)
    for k in range(size):
        work.rate[k] = (x[k] - X[k]) / h
    assemble(
        axes,
        hose.tables,
        hose.elasticity,
        x,
        work.rate,
        h,
        exact,
        work.span,
        work.gradient,
        work.band,
    )
    if len(loads.moment_start) > 0:
        add_moments(axes, loads, exact, x, work)
    contact = loads.contact
    add_self_contact(axes, contact, x, work.rate, h, work.gradient, work.band)
    if contact.geoms.shape[0] + contact.given.shape[0] == 0:
        return 0
    return add_contact(axes, contact, x, work.rate, V, h, exact, work.gradient, work.band)


@kernel
def _add_hold_weight(axes, holds, weight, size, work):  # type: ignore[no-untyped-def]
    """Adds weight G^T G to the band and G^T (g - G x) to the right-hand side; lambda is the same.

    work.shift holds g - G x on entry.
    """
    width = 4 * len(axes)
    mean = 0.0
    for k in range(size):
        mean += abs(work.band[k, 0]) / size
    for row in range(len(holds.start)):
        start = holds.start[row]
        norm = 0.0
        for k in range(width):
            norm += holds.rows[row, k] ** 2
        factor = weight * mean / norm
        for j in range(width):
            along = factor * holds.rows[row, j]
            work.gradient[start + j] -= along * work.shift[row]
            for i in range(j, width):
                work.band[start + j, i - j] += along * holds.rows[row, i]


@kernel
def solve_with_holds(axes, holds, size, work):  # type: ignore[no-untyped-def]
    """Solves K dx - G^T lambda = -gradient, G dx = shift with the factor in work.band.

    Writes dx into work.gradient and lambda into work.multipliers; False if the rows depend on each
    other. With K = L L^T: Z = L^-1 G^T, S = Z^T Z, so each row costs one forward solve.
    """
    width = 4 * len(axes)
    m = len(holds.start)
    z = work.lower
    for row in range(m):
        for k in range(z.shape[1]):
            z[row, k] = 0.0
        for k in range(width):
            z[row, holds.start[row] + k] = holds.rows[row, k]
    for k in range(size):
        z[m, k] = -work.gradient[k]
    for k in range(size, z.shape[1]):
        z[m, k] = 0.0
    solve_lower(axes, size, work.band, z)
    for row in range(m):
        product = 0.0
        for k in range(size):
            product += z[row, k] * z[m, k]
        work.multipliers[row] = work.shift[row] - product
        for other in range(row + 1):
            product = 0.0
            for k in range(size):
                product += z[row, k] * z[other, k]
            work.schur[row, other] = product
    if not _solve_dense(work.schur, work.multipliers):
        return False
    for k in range(size):
        value = z[m, k]
        for row in range(m):
            value += work.multipliers[row] * z[row, k]
        work.gradient[k] = value
    for k in range(size, size + width):
        work.gradient[k] = 0.0
    solve_upper(axes, size, work.band, work.gradient)
    return True


@kernel
def _solve_dense(matrix, rhs):  # type: ignore[no-untyped-def]
    """Cholesky solve in place with the lower half of a small matrix; False if it is singular."""
    m = len(rhs)
    for j in range(m):
        diagonal = matrix[j, j]
        pivot = diagonal
        for k in range(j):
            pivot -= matrix[j, k] ** 2
        if not pivot > 1e-13 * diagonal:
            return False
        root = np.sqrt(pivot)
        matrix[j, j] = root
        for i in range(j + 1, m):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = value / root
    for j in range(m):
        for k in range(j):
            rhs[j] -= matrix[j, k] * rhs[k]
        rhs[j] /= matrix[j, j]
    for j in range(m - 1, -1, -1):
        for k in range(j + 1, m):
            rhs[j] -= matrix[k, j] * rhs[k]
        rhs[j] /= matrix[j, j]
    return True


@kernel
def _largest_turn(axes, tables, x, shift):  # type: ignore[no-untyped-def]
    """Largest angle (small-angle estimate) by which a shift of x turns a tangent."""
    d = len(axes)
    largest = 0.0
    for e in range(tables.first.shape[0]):
        for g in range(3):
            A = 0.0
            square = 0.0
            along = 0.0
            for c in range(d):
                a = 0.0
                move = 0.0
                for i in range(4):
                    a += tables.first[e, g, i] * x[(e + i) * d + c]
                    move += tables.first[e, g, i] * shift[(e + i) * d + c]
                A += a * a
                square += move * move
                along += a * move
            A = max(A, 1e-4)
            largest = max(largest, np.sqrt(max(square - along * along / A, 0.0) / A))
    return largest


@kernel
def newton(axes, hose, stage, holds, fraction, loads, scale, limits, x, work):  # type: ignore[no-untyped-def]
    """Newton's iteration on x in place; returns (verdict, iterations, fallbacks).

    A pivot that is not positive is answered with the Gauss-Newton matrix, counted as a fallback.
    Ten arguments: it is the one entry to all solves.

    Args:
        axes: (0.0,) * d.
        hose: constants.
        stage: (h, X, V).
        holds: rows and what they demand before and after the step.
        fraction: where in the step that demand is taken, 0 to 1.
        loads: dead loads.
        scale: what they are multiplied by.
        limits: when to stop.
        x: flat control points (n d,); the guess on entry.
        work: work arrays; multipliers on return.
    """
    size = len(x)
    fallbacks = 0
    exact = True
    shortened = 0
    factor = 0.0
    slope = 0.0
    iteration = 1
    while True:
        touching = build(axes, hose, stage, loads, scale, exact, x, work)
        # Holds not yet met come first: the line search starts from a point that meets them.
        if limits.line_search and exact and iteration > 2 and shortened < 12:
            turned = 0.0
            for k in range(size):
                turned += work.gradient[k] * work.step[k]
            if turned > 0.5 * abs(slope):
                shorter = factor * min(max(slope / (slope - turned), 0.1), 0.7)
                for k in range(size):
                    x[k] += (shorter - factor) * work.step[k]
                factor = shorter
                shortened += 1
                continue
        _prepare_holds(axes, holds, fraction, limits.hold_weight, x, work)
        if not factorize(axes, size, work.band):
            if not exact:
                return NOT_POSITIVE, iteration, fallbacks
            exact = False
            fallbacks += 1
            continue
        for k in range(size):
            work.residual[k] = work.gradient[k]
        if not solve_with_holds(axes, holds, size, work):
            return DEPENDENT_HOLDS, iteration, fallbacks
        largest = 0.0
        slope = 0.0
        for k in range(size):
            work.step[k] = work.gradient[k]
            slope += work.residual[k] * work.step[k]
            largest = max(largest, abs(work.step[k]))
        if not np.isfinite(largest):
            return NOT_FINITE, iteration, fallbacks
        factor = 1.0
        if limits.rotation_cap < np.inf:
            turn = _largest_turn(axes, hose.tables, x, work.step)
            if turn > limits.rotation_cap:
                factor = limits.rotation_cap / turn
        for k in range(size):
            x[k] += factor * work.step[k]
        tolerance = limits.tolerance
        if touching > 0:
            tolerance = min(tolerance, loads.contact.law[TOLERANCE])
        if factor == 1.0 and largest <= tolerance:
            return DONE, iteration, fallbacks
        if iteration == limits.max_iterations:
            return NOT_CONVERGED, iteration, fallbacks
        iteration += 1
        exact = True
        shortened = 0


@kernel
def _prepare_holds(axes, holds, fraction, weight, x, work):  # type: ignore[no-untyped-def]
    """Writes g - G x into work.shift and adds the holds' weight to the matrix."""
    width = 4 * len(axes)
    for row in range(len(holds.start)):
        before = holds.before[row]
        value = before + fraction * (holds.after[row] - before)
        for k in range(width):
            value -= holds.rows[row, k] * x[holds.start[row] + k]
        work.shift[row] = value
    if weight > 0.0:
        _add_hold_weight(axes, holds, weight, len(x), work)
