"""Cholesky factorization and triangular solves of a symmetric band, in O(n).

A lower band is stored by columns: `band[j, k]` is entry (j + k, j), k = 0 .. 4 d - 1 for d unknowns
per control point. Rows are 8 d wide and 4 d rows follow the last, all zero, so that every inner
loop has the fixed length 4 d. In a factor, column 0 holds the inverse diagonal.
"""

from __future__ import annotations

import numpy as np

from hose_mj.compiled import kernel


@kernel
def factorize(axes, size, band):  # type: ignore[no-untyped-def]
    """Replaces the first `size` columns by their Cholesky factor; False at a pivot not above 0."""
    width = 4 * len(axes)
    for j in range(size):
        pivot = band[j, 0]
        if not pivot > 0.0:
            return False
        inverse = 1.0 / np.sqrt(pivot)
        for k in range(width):
            band[j, k] *= inverse
        for k in range(1, width):
            factor = band[j, k]
            for m in range(width):
                band[j + k, m] -= factor * band[j, k + m]
        band[j, 0] = inverse
    return True


@kernel
def solve_lower(axes, size, band, rows):  # type: ignore[no-untyped-def]
    """Solves L y = rhs in place for every row of `rows` (m, size + 4 d), zero after `size`.

    The rows advance together, so that the processor need not wait for the end of each.
    """
    width = 4 * len(axes)
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
def solve_upper(axes, size, band, rhs):  # type: ignore[no-untyped-def]
    """Solves L^T x = rhs in place; rhs (size + 4 d) vanishes after `size`."""
    width = 4 * len(axes)
    for j in range(size - 1, -1, -1):
        value = 0.0
        for k in range(width):
            value += band[j, 1 + k] * rhs[j + 1 + k]
        rhs[j] = (rhs[j] - value) * band[j, 0]
