"""Solves of one linear system with Lagrange multipliers, by the Schur complement of the band.

    [ K  -R^T ] [ dx     ]   [ -gradient ]
    [ R   D   ] [ lambda ] = [  shift    ]

K is banded and factorized (band.py); R are the rows of the constraints and of the twist.
"""

from __future__ import annotations

from hose_mj.hoses.geds.band import solve_lower, solve_upper
from hose_mj.hoses.geds.records import DEPENDENT_CONSTRAINTS, DONE, NOT_POSITIVE
from hose_mj.jit import inlined, kernel

_ROUNDING = 1e-13
"""A pivot below this part of its diagonal is what rounding leaves of one that is zero: some hundred
times the precision of the sums that it is the difference of."""


@inlined
def multiply_row(axes, constraints, row, x, size):
    """Returns what one row of G makes of x, of which the first `size` entries count."""
    width = 4 * len(axes)
    value = 0.0
    for k in range(width):
        value += constraints.rows[row, k] * x[constraints.start[row] + k]
    for k in range(width, constraints.rows.shape[1]):
        value += constraints.rows[row, k] * x[size - 2 * width + k]
    return value


@inlined
def add_constraint_weight(axes, constraints, weight, size, work):
    """Adds weight G^T G to the band and G^T (g - G x) to the right-hand side; lambda is the same.

    work.shift holds g - G x on entry. The rows that join the ends of a loop have no place in a
    band, and no part in this: they hold back no rigid motion.
    """
    width = 4 * len(axes)
    n_local = len(constraints.start)
    if constraints.rows.shape[1] > width:
        n_local -= 2 * len(axes)
    mean = 0.0
    for k in range(size):
        mean += abs(work.band[k, 0]) / size
    for row in range(n_local):
        start = constraints.start[row]
        norm = 0.0
        for k in range(width):
            norm += constraints.rows[row, k] ** 2
        factor = weight * mean / norm
        if len(constraints.springs.rows) > 0:
            factor = min(factor, constraints.springs.weight[row])
            constraints.springs.weight[row] = factor
        for j in range(width):
            along = factor * constraints.rows[row, j]
            work.gradient[start + j] -= along * work.shift[row]
            for i in range(j, width):
                work.band[start + j, i - j] += along * constraints.rows[row, i]
    _soften(axes, constraints.springs)


@inlined
def _soften(axes, springs):
    """Takes from springs what their weight has put into the matrix: D becomes D / (1 - weight D).

    The multipliers are then less than the forces, by as much.
    """
    for p in range(len(springs.rows)):
        first, n_slopes = springs.rows[p, 0], springs.rows[p, 1]
        for k in range(3 if n_slopes > 0 else 2):
            weight = springs.weight[first + (len(axes[:3]) if k == 2 else 0)]
            springs.scale[p, k] = 1.0 / (1.0 - weight * springs.softness[p, k])
            springs.softness[p, k] *= springs.scale[p, k]


@inlined
def _scale_forces(axes, springs, multipliers):
    """Makes forces of the multipliers of springs; see `_soften`."""
    d = len(axes[:3])
    for p in range(len(springs.rows)):
        first, n_slopes = springs.rows[p, 0], springs.rows[p, 1]
        along = 0.0
        for c in range(d):
            along += springs.direction[p, c] * multipliers[first + c]
        along *= springs.scale[p, 1] - springs.scale[p, 0]
        for c in range(d):
            multipliers[first + c] *= springs.scale[p, 0]
            multipliers[first + c] += along * springs.direction[p, c]
        for row in range(first + d, first + d + n_slopes):
            multipliers[row] *= springs.scale[p, 2]


@inlined
def _add_springs(axes, springs, matrix):
    """Adds the softness of springs to the lower half of lambda's matrix."""
    d = len(axes[:3])
    for p in range(len(springs.rows)):
        first, n_slopes = springs.rows[p, 0], springs.rows[p, 1]
        across, along = springs.softness[p, 0], springs.softness[p, 1]
        for i in range(d):
            matrix[first + i, first + i] += across
            for j in range(i + 1):
                part = springs.direction[p, i] * springs.direction[p, j]
                matrix[first + i, first + j] += (along - across) * part
        for row in range(first + d, first + d + n_slopes):
            matrix[row, row] += springs.softness[p, 2]


@inlined
def solve_with_constraints(axes, constraints, compliance_factor, softness, n_negative, size, work):
    """Solves K dx - R^T lambda = -gradient, R dx + D lambda = shift with the factor in work.band.

    The rows R are those of the constraints (D = compliance of their response times
    `compliance_factor`, or the softness of their springs), the derivatives of the segments' twist
    (D = compliance times `softness`) and those in work.soft, which add R^T R / D to K. Writes dx
    into work.gradient and lambda into work.multipliers. With K = L S L^T, S the signs of the
    pivots: Z = L^-1 R^T, and Z^T S Z + D is the matrix of lambda, so each row costs one forward
    solve.

    Returns DONE; DEPENDENT_CONSTRAINTS if the rows depend on each other; NOT_POSITIVE where K with
    D is not positive definite on the null space of the constraints, which is where that matrix has
    not as many negative pivots as K, `n_negative`, and D together.
    """
    width = 4 * len(axes)
    m = len(constraints.start) + len(constraints.twist.angle) + work.soft.used[0]
    z = work.lower
    _load_right_sides(width, m, constraints, size, work)
    solve_lower(axes, size, work.band, z)
    if n_negative > 0:
        # Times S: what stands on the right of a product from here on.
        for k in range(size):
            z[m, k] *= work.signs[k]
    _make_schur(m, constraints, softness, n_negative, size, work)
    _add_springs(axes, constraints.springs, work.schur)
    wanted = n_negative + work.soft.used[1]
    if len(constraints.response.compliance) > 0:
        _add_compliance(m, compliance_factor, constraints.response.compliance, work.schur)
        n_found = wanted if _solve_general(m, work.schur, work.multipliers) else -1
    else:
        n_found = _solve_dense(m, work.schur, work.multipliers)
    if n_found != wanted:
        return DEPENDENT_CONSTRAINTS if n_found < 0 else NOT_POSITIVE
    for k in range(size):
        value = z[m, k]
        sign = work.signs[k] if n_negative > 0 else 1.0
        for row in range(m):
            value += sign * work.multipliers[row] * z[row, k]
        work.gradient[k] = value
    for k in range(size, size + width):
        work.gradient[k] = 0.0
    solve_upper(axes, size, work.band, work.gradient)
    _scale_forces(axes, constraints.springs, work.multipliers)
    return DONE


@inlined
def _load_right_sides(width, m, constraints, size, work):
    """Writes R and, as row m, minus the gradient to work.lower; soft rows ask for no shift."""
    n_constraints = len(constraints.start)
    n_own = n_constraints + len(constraints.twist.angle)
    z = work.lower
    for row in range(n_constraints):
        for k in range(z.shape[1]):
            z[row, k] = 0.0
        for k in range(width):
            z[row, constraints.start[row] + k] = constraints.rows[row, k]
        for k in range(width, constraints.rows.shape[1]):
            z[row, size - 2 * width + k] += constraints.rows[row, k]
    for row in range(n_own, m):
        work.shift[row] = 0.0
        for k in range(z.shape[1]):
            z[row, k] = work.soft.rows[row - n_own, k]
    for row in range(n_constraints, n_own):
        work.shift[row] = 0.0
        for k in range(size):
            z[row, k] = constraints.twist.rows[row - n_constraints, k]
        for k in range(size, z.shape[1]):
            z[row, k] = 0.0
    for k in range(size):
        z[m, k] = -work.gradient[k]
    for k in range(size, z.shape[1]):
        z[m, k] = 0.0


@inlined
def _make_schur(m, constraints, softness, n_negative, size, work):
    """Writes the lower half of Z^T S Z, with the twist's D, and lambda's right-hand side."""
    n_constraints = len(constraints.start)
    n_own = n_constraints + len(constraints.twist.angle)
    z = work.lower
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
        if row >= n_own:
            work.schur[row, row] += work.soft.compliance[row - n_own]
        elif row >= n_constraints:
            compliance = constraints.twist.compliance[row - n_constraints]
            work.schur[row, row] += softness * compliance


@kernel
def _add_compliance(m, factor, compliance, matrix):
    """Completes a symmetric matrix of m rows from its lower half and adds factor compliance."""
    for row in range(m):
        for other in range(row):
            matrix[other, row] = matrix[row, other]
    for row in range(len(compliance)):
        for other in range(len(compliance)):
            matrix[row, other] += factor * compliance[row, other]


@kernel
def _solve_general(m, matrix, rhs):
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
def _solve_dense(m, matrix, rhs):
    """Solves in place by L D L^T with the lower half of a small matrix of m rows.

    Returns the number of negative pivots, -1 if the matrix is singular.
    """
    n_negative = 0
    for j in range(m):
        diagonal = matrix[j, j]
        pivot = diagonal
        for k in range(j):
            pivot -= matrix[j, k] ** 2 * matrix[k, k]
        if not abs(pivot) > _ROUNDING * abs(diagonal):
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
