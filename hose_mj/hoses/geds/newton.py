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

from hose_mj.hoses.geds.band import (
    factorize,
    factorize_indefinite,
    solve_lower,
    solve_upper,
)
from hose_mj.hoses.geds.basis import Tables
from hose_mj.hoses.geds.contact import add_contact
from hose_mj.hoses.geds.contact_law import TOLERANCE, Contact
from hose_mj.hoses.geds.energy import assemble
from hose_mj.hoses.geds.frames import shift_clamps
from hose_mj.hoses.geds.self_contact import add_self_contact
from hose_mj.hoses.geds.span import Elasticity, Span, make_span
from hose_mj.hoses.geds.twist import Twist, predict_twist
from hose_mj.hoses.protocol import Array
from hose_mj.jit import choose_by_unknowns, compiled, inlined, kernel, merged

DONE, NOT_CONVERGED, NOT_FINITE, NOT_POSITIVE, DEPENDENT_HOLDS = range(5)
VERDICTS = (
    "done",
    "Newton's iteration did not converge",
    "numbers left the finite range",
    "no positive definite stiffness was found",
    "two holds ask for the same thing, or more than the spline can follow there",
)


class Hose(NamedTuple):
    """Constants of one hose.

    Attributes:
        tables: quadrature.
        elasticity: material.
        mass: per coordinate, band (n, 4).
        gyration: rotational inertia about the tangent over mass (m^2), for theta.
        drag_rate: drag per mass c (1/s).
    """

    tables: Tables
    elasticity: Elasticity
    mass: Array
    gyration: float
    drag_rate: float


class Response(NamedTuple):
    """How far the bodies that hold a hose give way to it within a step.

    With F the mean force of the holds on the hose over a step, what holds demand at its end is
    after - compliance F. A stage knows F as base + share lambda, where lambda are its multipliers.

    Attributes:
        compliance: (m, m) over all rows, m/N, not always symmetric; (0, 0) where nothing gives way.
        base: (m,), N, written.
        share: (1,), written.
        gathered: sum of the multipliers of the stages, or parts of a step, before, (m,), written.
        force: F of the last step, (m,), N, written.
    """

    compliance: Array
    base: Array
    share: Array
    gathered: Array
    force: Array


def make_response(n_rows: int) -> Response:
    """Returns the response of m = n_rows rows, all compliances zero."""
    base, gathered, force = np.zeros((3, n_rows))
    return Response(np.zeros((n_rows, n_rows)), base, np.ones(1), gathered, force)


class Holds(NamedTuple):
    """m rows of G x = g.

    Attributes:
        start: index of the first of the 4 d unknowns that a row reads, (m,).
        rows: their coefficients, (m, 4 d). In a closed loop (m, 8 d): the last 2 d rows, which join
            its ends (loops.py), also read the last 4 d unknowns.
        before: g at the beginning of a step, (m,).
        after: g at its end, (m,).
        multipliers: lambda at the end of the last step, (m,), written.
        twist: clamps and the twist between them.
        response: how far what holds the hose gives way.
    """

    start: np.ndarray
    rows: Array
    before: Array
    after: Array
    multipliers: Array
    twist: Twist
    response: Response


class Loads(NamedTuple):
    """Dead loads, and what may be touched.

    Attributes:
        force: generalised force on the control points, gravity included, flat (n d,).
        moment_start: index of the first of the 4 d unknowns at each point moment, (k,).
        moment_basis: N and dN/ds there, (k, 2, 4).
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
        turn_length: what a change of theta is multiplied by to compare with that (m).
        max_iterations: Newton iterations at most.
        rotation_cap: largest turn of a tangent in one iteration (rad).
        line_search: True to shorten steps that run past the lowest point along them.
        hold_weight: weight of G^T G in the matrix, relative to its mean diagonal; above 0 where
            the hose alone has rigid motions (statics). The matrix may be indefinite then, as long
            as the twist's rank-one terms and the holds make up for it.
    """

    tolerance: float
    turn_length: float
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
    signs: Array
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
    """Returns work arrays for n control points of d unknowns each and m rows.

    The rows are those of the holds and one for each stretch that has twist.
    """
    size = n_control_points * dimension
    padded = size + 4 * dimension
    return Work(
        make_span(),
        np.zeros(padded),
        np.zeros(padded),
        np.zeros((padded, 8 * dimension)),
        np.ones(size),
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


@inlined
def multiply_mass(axes, hose, factor, x, out):  # type: ignore[no-untyped-def]
    """Adds factor M x to out; x and out flat, the first n d entries count."""
    d = len(axes)
    mass = hose.mass
    n = mass.shape[0]
    for j in range(n):
        for c in range(d):
            scale = factor * (hose.gyration if c == 3 else 1.0)
            out[j * d + c] += scale * mass[j, 0] * x[j * d + c]
        for k in range(1, min(4, n - j)):
            weight = factor * mass[j, k]
            for c in range(d):
                scale = weight * (hose.gyration if c == 3 else 1.0)
                out[(j + k) * d + c] += scale * x[j * d + c]
                out[j * d + c] += scale * x[(j + k) * d + c]


@inlined
def add_mass(axes, hose, factor, band):  # type: ignore[no-untyped-def]
    """Adds factor M to a band."""
    d = len(axes)
    for j in range(hose.mass.shape[0]):
        for c in range(d):
            scale = factor * (hose.gyration if c == 3 else 1.0)
            for k in range(4):
                band[j * d + c, k * d] += scale * hose.mass[j, k]


@inlined
def add_moments(axes, loads, exact, x, work):  # type: ignore[no-untyped-def]
    """Subtracts the generalised force of the point moments, M x a / A on a = r', from the gradient.

    Its derivative goes into the band: all of it in the plane, its symmetric part in space. What
    lies along the tangent acts on theta where there is one.
    """
    d = len(axes)
    n_places = len(axes[:3])
    a = work.span.a[0]
    turn = work.span.b[0]
    for k in range(len(loads.moment_start)):
        start = loads.moment_start[k]
        A = 0.0
        for c in range(n_places):
            a[c] = 0.0
            for i in range(4):
                a[c] += loads.moment_basis[k, 1, i] * x[start + i * d + c]
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
        if d == 4:
            along = 0.0
            for c in range(3):
                along += loads.moment[k, c] * a[c] / np.sqrt(A)
            for i in range(4):
                work.gradient[start + 4 * i + 3] -= loads.moment_basis[k, 0, i] * along
        for i in range(4):
            for c1 in range(n_places):
                work.gradient[start + i * d + c1] -= loads.moment_basis[k, 1, i] * turn[c1]
                if not exact:
                    continue
                for j in range(i + 1):
                    weight = loads.moment_basis[k, 1, i] * loads.moment_basis[k, 1, j] / A
                    for c2 in range(n_places if j < i else c1 + 1):
                        bend = turn[c1] * a[c2] + a[c1] * turn[c2]
                        work.band[start + j * d + c2, (i - j) * d + c1 - c2] += weight * bend


@merged
def build(axes, hose, stage, twist, progress, loads, scale, exact, x, work):  # type: ignore[no-untyped-def]
    """Fills work.gradient with the residual without holds, work.band with its derivative.

    The twist's rank-one terms are not in the band: `solve_with_holds` adds them. Returns how many
    contact points touch something.
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
        multiply_mass(axes, hose, 1.0, work.rate, work.gradient)
        add_mass(axes, hose, inertia, work.band)
    for k in range(size):
        work.rate[k] = (x[k] - X[k]) / h
    assemble(
        axes,
        hose,
        twist,
        progress,
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


@inlined
def multiply_row(axes, holds, row, x, size):  # type: ignore[no-untyped-def]
    """Returns what one row of G makes of x, of which the first `size` entries count."""
    width = 4 * len(axes)
    value = 0.0
    for k in range(width):
        value += holds.rows[row, k] * x[holds.start[row] + k]
    for k in range(width, holds.rows.shape[1]):
        value += holds.rows[row, k] * x[size - 2 * width + k]
    return value


@inlined
def _add_hold_weight(axes, holds, weight, size, work):  # type: ignore[no-untyped-def]
    """Adds weight G^T G to the band and G^T (g - G x) to the right-hand side; lambda is the same.

    work.shift holds g - G x on entry. The rows that join the ends of a loop have no place in a
    band, and no part in this: they hold back no rigid motion.
    """
    width = 4 * len(axes)
    n_local = len(holds.start)
    if holds.rows.shape[1] > width:
        n_local -= 2 * len(axes)
    mean = 0.0
    for k in range(size):
        mean += abs(work.band[k, 0]) / size
    for row in range(n_local):
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


@inlined
def solve_with_holds(axes, holds, give, softness, n_negative, size, work):  # type: ignore[no-untyped-def]
    """Solves K dx - R^T lambda = -gradient, R dx + D lambda = shift with the factor in work.band.

    The rows R are those of the holds (D = compliance of their response times `give`) and the
    derivatives of the stretches' twist (D = compliance times `softness`), which adds R^T R / D to
    K. Writes dx into work.gradient and
    lambda into work.multipliers. With K = L S L^T, S the signs of the pivots: Z = L^-1 R^T, and
    Z^T S Z + D is the matrix of lambda, so each row costs one forward solve.

    Returns DONE; DEPENDENT_HOLDS if the rows depend on each other; NOT_POSITIVE where K with D is
    not positive definite on the null space of the holds, which is where that matrix has not as
    many negative pivots as K, `n_negative`.
    """
    width = 4 * len(axes)
    n_holds = len(holds.start)
    twist = holds.twist
    m = n_holds + len(twist.angle)
    z = work.lower
    for row in range(n_holds):
        for k in range(z.shape[1]):
            z[row, k] = 0.0
        for k in range(width):
            z[row, holds.start[row] + k] = holds.rows[row, k]
        for k in range(width, holds.rows.shape[1]):
            z[row, size - 2 * width + k] += holds.rows[row, k]
    for row in range(n_holds, m):
        work.shift[row] = 0.0
        for k in range(size):
            z[row, k] = twist.rows[row - n_holds, k]
        for k in range(size, z.shape[1]):
            z[row, k] = 0.0
    for k in range(size):
        z[m, k] = -work.gradient[k]
    for k in range(size, z.shape[1]):
        z[m, k] = 0.0
    solve_lower(axes, size, work.band, z)
    if n_negative > 0:
        # Times S: what stands on the right of a product from here on.
        for k in range(size):
            z[m, k] *= work.signs[k]
    for row in range(m):
        product = 0.0
        for k in range(size):
            product += z[row, k] * z[m, k]
        work.multipliers[row] = work.shift[row] - product
        for other in range(row + 1):
            product = 0.0
            if n_negative > 0:
                for k in range(size):
                    product += work.signs[k] * z[row, k] * z[other, k]
            else:
                for k in range(size):
                    product += z[row, k] * z[other, k]
            work.schur[row, other] = product
        if row >= n_holds:
            work.schur[row, row] += softness * twist.compliance[row - n_holds]
    if len(holds.response.compliance) > 0:
        _add_compliance(m, give, holds.response.compliance, work.schur)
        n_found = n_negative if _solve_general(m, work.schur, work.multipliers) else -1
    else:
        n_found = _solve_dense(m, work.schur, work.multipliers)
    if n_found != n_negative:
        return DEPENDENT_HOLDS if n_found < 0 else NOT_POSITIVE
    for k in range(size):
        value = z[m, k]
        sign = work.signs[k] if n_negative > 0 else 1.0
        for row in range(m):
            value += sign * work.multipliers[row] * z[row, k]
        work.gradient[k] = value
    for k in range(size, size + width):
        work.gradient[k] = 0.0
    solve_upper(axes, size, work.band, work.gradient)
    return DONE


@kernel
def _add_compliance(m, give, compliance, matrix):  # type: ignore[no-untyped-def]
    """Completes a symmetric matrix of m rows from its lower half and adds `give` compliance."""
    for row in range(m):
        for other in range(row):
            matrix[other, row] = matrix[row, other]
    for row in range(len(compliance)):
        for other in range(len(compliance)):
            matrix[row, other] += give * compliance[row, other]


@kernel
def _solve_general(m, matrix, rhs):  # type: ignore[no-untyped-def]
    """Solves in place by L U without exchanges, as a matrix with a positive symmetric part allows.

    Returns whether it could.
    """
    for j in range(m):
        pivot = matrix[j, j]
        if not abs(pivot) > 0.0:
            return False
        for i in range(j + 1, m):
            factor = matrix[i, j] / pivot
            for k in range(j + 1, m):
                matrix[i, k] -= factor * matrix[j, k]
            rhs[i] -= factor * rhs[j]
    for j in range(m - 1, -1, -1):
        for k in range(j + 1, m):
            rhs[j] -= matrix[j, k] * rhs[k]
        rhs[j] /= matrix[j, j]
    return True


@kernel
def _solve_dense(m, matrix, rhs):  # type: ignore[no-untyped-def]
    """Solves in place by L D L^T with the lower half of a small matrix of m rows.

    Returns the number of negative pivots, -1 if the matrix is singular.
    """
    n_negative = 0
    for j in range(m):
        diagonal = matrix[j, j]
        pivot = diagonal
        for k in range(j):
            pivot -= matrix[j, k] ** 2 * matrix[k, k]
        if not abs(pivot) > 1e-13 * abs(diagonal):
            return -1
        if pivot < 0.0:
            n_negative += 1
        matrix[j, j] = pivot
        for i in range(j + 1, m):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k] * matrix[k, k]
            matrix[i, j] = value / pivot
    for j in range(m):
        for k in range(j):
            rhs[j] -= matrix[j, k] * rhs[k]
    for j in range(m - 1, -1, -1):
        rhs[j] /= matrix[j, j]
        for k in range(j + 1, m):
            rhs[j] -= matrix[k, j] * rhs[k]
    return n_negative


@inlined
def _largest_turn(axes, tables, x, shift):  # type: ignore[no-untyped-def]
    """Largest angle (small-angle estimate) by which a shift of x turns a tangent."""
    d = len(axes)
    largest = 0.0
    for e in range(tables.first.shape[0]):
        for g in range(3):
            A = 0.0
            square = 0.0
            along = 0.0
            for c in range(len(axes[:3])):
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


@merged
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
    in_statics = limits.hold_weight > 0.0
    softness = 1.0 / (1.0 + hose.elasticity.damping_time / stage[0])
    while True:
        touching = build(axes, hose, stage, holds.twist, fraction, loads, scale, exact, x, work)
        # Holds not yet met come first: the line search starts from a point that meets them.
        if limits.line_search and exact and iteration > 2 and shortened < 12:
            turned = 0.0
            for k in range(size):
                turned += work.gradient[k] * work.step[k]
            if turned > 0.5 * abs(slope):
                shorter = factor * min(max(slope / (slope - turned), 0.1), 0.7)
                for k in range(size):
                    x[k] += (shorter - factor) * work.step[k]
                predict_twist(holds.twist, shorter - factor, work.step)
                factor = shorter
                shortened += 1
                continue
        _prepare_holds(axes, holds, fraction, limits.hold_weight, x, work)
        n_negative = 0
        if in_statics and exact:
            n_negative = factorize_indefinite(axes, size, work.band, work.signs)
        elif not factorize(axes, size, work.band):
            n_negative = -1
        verdict = NOT_POSITIVE
        if n_negative >= 0:
            for k in range(size):
                work.residual[k] = work.gradient[k]
            give = fraction * holds.response.share[0]
            verdict = solve_with_holds(axes, holds, give, softness, n_negative, size, work)
        if verdict == NOT_POSITIVE and exact:
            exact = False
            fallbacks += 1
            continue
        if verdict != DONE:
            return verdict, iteration, fallbacks
        largest = 0.0
        slope = 0.0
        for k in range(size):
            work.step[k] = work.gradient[k]
            slope += work.residual[k] * work.step[k]
            size_of = limits.turn_length if len(axes) == 4 and k % 4 == 3 else 1.0
            largest = max(largest, abs(work.step[k]) * size_of)
        if not np.isfinite(largest):
            return NOT_FINITE, iteration, fallbacks
        factor = 1.0
        if limits.rotation_cap < np.inf:
            turn = _largest_turn(axes, hose.tables, x, work.step)
            if turn > limits.rotation_cap:
                factor = limits.rotation_cap / turn
        for k in range(size):
            x[k] += factor * work.step[k]
        predict_twist(holds.twist, factor, work.step)
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


@inlined
def _shift(axes, twist, fraction, shift):  # type: ignore[no-untyped-def]
    shift_clamps(twist, fraction, shift)


_shift_clamps = choose_by_unknowns({4: _shift})


@inlined
def _prepare_holds(axes, holds, fraction, weight, x, work):  # type: ignore[no-untyped-def]
    """Writes g - G x into work.shift and adds the holds' weight to the matrix."""
    for row in range(len(holds.start)):
        before = holds.before[row]
        wanted = before + fraction * (holds.after[row] - before)
        response = holds.response
        for other in range(len(response.compliance)):
            wanted -= fraction * response.compliance[row, other] * response.base[other]
        work.shift[row] = wanted - multiply_row(axes, holds, row, x, len(x))
    _shift_clamps(axes, holds.twist, fraction, work.shift)
    if weight > 0.0:
        _add_hold_weight(axes, holds, weight, len(x), work)
