"""Cholesky factorization and triangular solves of a symmetric band, in O(n).

A lower band is stored by columns: `band[j, k]` is entry (j + k, j), k = 0 .. 4 d - 1 for d unknowns
per control point. Rows are 8 d wide and 4 d rows follow the last, all zero, so that inner loops
have fixed lengths. In a factor, column 0 holds the inverse diagonal.
"""

from __future__ import annotations

import numpy as np

from hose_mj.jit import inlined, kernel


@kernel
def factorize(axes, size, band):
    """Replaces the first `size` columns by their Cholesky factor; False at a pivot not above 0."""
    width = 4 * len(axes)
    for j in range(size):
        pivot = band[j, 0]
        if not pivot > 0.0:
            return False
        inverse = 1.0 / np.sqrt(pivot)
        for k in range(width):
            band[j, k] *= inverse
        _eliminate(axes, j, 1.0, band)
        band[j, 0] = inverse
    return True


@inlined
def _eliminate(axes, j, sign, band):
    """Subtracts sign times column j's outer product from the columns after it.

    Four columns at a time have inner loops of one length, four less than those before.
    """
    width = 4 * len(axes)
    _eliminate_from(j, 1, 4, width, sign, band)
    _eliminate_from(j, 4, 8, width - 4, sign, band)
    if len(axes) > 2:
        _eliminate_from(j, 8, 12, width - 8, sign, band)
    if len(axes) > 3:
        _eliminate_from(j, 12, 16, width - 12, sign, band)


@inlined
def _eliminate_from(j, first, end, length, sign, band):
    """`_eliminate` for columns j + first to j + end - 1."""
    for k in range(first, end):
        factor = sign * band[j, k]
        for m in range(length):
            band[j + k, m] -= factor * band[j, k + m]


@kernel
def factorize_indefinite(axes, size, band, signs):
    """Replaces the first `size` columns by L of L S L^T, S = diag(signs), signs 1 or -1.

    Returns the number of negative pivots, -1 at a pivot that is as good as zero or no number. There
    is no exchange of rows, so a matrix that is not positive definite may lose accuracy.
    """
    width = 4 * len(axes)
    n_negative = 0
    for j in range(size):
        pivot = band[j, 0]
        if not abs(pivot) > 1e-300:  # as good as zero
            return -1
        sign = 1.0
        if pivot < 0.0:
            sign = -1.0
            n_negative += 1
        signs[j] = sign
        inverse = 1.0 / np.sqrt(sign * pivot)
        for k in range(width):
            band[j, k] *= sign * inverse
        _eliminate(axes, j, sign, band)
        band[j, 0] = inverse
    return n_negative


@kernel
def solve_lower(axes, size, band, rows):
    """Solves L y = rhs in place for every row of `rows` (m, size + 4 d), zero after `size`.

    The rows advance together, so that the processor need not wait for the end of each.
    """
    # As long as 4 d but not known to the compiler, which would write the loop out number by number.
    width = band.shape[1] // 2
    for j in range(size):
        inverse = band[j, 0]
        for row in range(rows.shape[0]):
            value = rows[row, j]
            if value != 0.0:
                value *= inverse
                rows[row, j] = value
                for k in range(width):
                    rows[row, j + 1 + k] -= value * band[j, 1 + k]


@kernel
def solve_upper(axes, size, band, rhs):
    """Solves L^T x = rhs in place; rhs (size + 4 d) vanishes after `size`.

    The d unknowns of a control point take what is known of the rest of the hose side by side.
    """
    d = len(axes)
    for j in range(size - d, -1, -d):
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
        for k in range(4 * d):
            x = rhs[j + d + k]
            s0 += band[j, d + k] * x
            if d > 1:
                s1 += band[j + 1, d - 1 + k] * x
            if d > 2:
                s2 += band[j + 2, d - 2 + k] * x
            if d > 3:
                s3 += band[j + 3, d - 3 + k] * x
        x1, x2, x3 = 0.0, 0.0, 0.0
        if d > 3:
            x3 = (rhs[j + 3] - s3) * band[j + 3, 0]
            rhs[j + 3] = x3
        if d > 2:
            x2 = (rhs[j + 2] - s2 - band[j + 2, 1] * x3) * band[j + 2, 0]
            rhs[j + 2] = x2
        if d > 1:
            x1 = (rhs[j + 1] - s1 - band[j + 1, 1] * x2 - band[j + 1, 2] * x3) * band[j + 1, 0]
            rhs[j + 1] = x1
        s0 += band[j, 1] * x1 + band[j, 2] * x2 + band[j, 3] * x3
        rhs[j] = (rhs[j] - s0) * band[j, 0]
