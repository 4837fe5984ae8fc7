"""Finds the least distance between a geom and a part of a hose's centre line, to rounding.

f(u) is the geom's signed distance at r(u) on one cubic piece. A piece is left out when a ball about
it is farther away than what was found before. On the others f is looked at in five places; between
two of them it is left out again when even the straight way between them could not come near enough
(f changes by no more than the way), and otherwise each of its minima is bracketed and found by
Newton's method on f', falling back to halving where f' jumps.
"""

import numpy as np

from hose_mj.hoses.geds.shapes import measure
from hose_mj.hoses.protocol import Array
from hose_mj.jit import kernel

Point = tuple[float, float, float]
Line = tuple[Array, Array, Array]
"""Arc lengths (K + 1,), m, coefficients (K, 4, 3), m, and balls (K, 5) of a line's pieces."""

_PARTS = 4  # parts of a piece between which f is looked at
_TURNS = 60  # steps of Newton's method at most: halving alone would need 34 to `_FINE`
_FINE = 1e-10
"""Width in u at which a minimum is found; a kink of f is then missed by no more than this times the
piece's length."""
BALL = 5  # columns of a piece's ball: centre (3), radius, largest |dr/du|


@kernel
def update_balls(coefficients: Array, balls: Array) -> None:
    """Writes a ball (K, 5) about each cubic piece (K, 4, 3).

    With v = u - 1/2 a piece is its middle + d1 v + d2 v^2 + d3 v^3, |v| <= 1/2.
    """
    for k in range(coefficients.shape[0]):
        first = second = third = 0.0
        for c in range(3):
            c1, c2, c3 = coefficients[k, 1, c], coefficients[k, 2, c], coefficients[k, 3, c]
            balls[k, c] = coefficients[k, 0, c] + 0.5 * c1 + 0.25 * c2 + 0.125 * c3
            first += (c1 + c2 + 0.75 * c3) ** 2
            second += (c2 + 1.5 * c3) ** 2
            third += c3 * c3
        d1, d2, d3 = np.sqrt(first), np.sqrt(second), np.sqrt(third)
        balls[k, 3] = 0.5 * d1 + 0.25 * d2 + 0.125 * d3
        balls[k, 4] = d1 + d2 + 0.75 * d3


@kernel
def locate(arcs: Array, arc: float) -> tuple[int, float]:
    """Finds the piece (number, u) that an arc length lies on."""
    k = min(max(np.searchsorted(arcs, arc, side="right") - 1, 0), arcs.shape[0] - 2)
    return k, (arc - arcs[k]) / (arcs[k + 1] - arcs[k])


@kernel
def compute_point(coefficients: Array, k: int, u: float) -> Point:
    """Computes r(u) on piece k."""
    c = coefficients
    return (
        c[k, 0, 0] + u * (c[k, 1, 0] + u * (c[k, 2, 0] + u * c[k, 3, 0])),
        c[k, 0, 1] + u * (c[k, 1, 1] + u * (c[k, 2, 1] + u * c[k, 3, 1])),
        c[k, 0, 2] + u * (c[k, 1, 2] + u * (c[k, 2, 2] + u * c[k, 3, 2])),
    )


@kernel
def compute_slope(coefficients: Array, k: int, u: float) -> Point:
    """Computes dr/du on piece k."""
    c = coefficients
    return (
        c[k, 1, 0] + u * (2.0 * c[k, 2, 0] + 3.0 * u * c[k, 3, 0]),
        c[k, 1, 1] + u * (2.0 * c[k, 2, 1] + 3.0 * u * c[k, 3, 1]),
        c[k, 1, 2] + u * (2.0 * c[k, 2, 2] + 3.0 * u * c[k, 3, 2]),
    )


@kernel
def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _look(rows: Array, g: int, c: Array, k: int, u: float) -> tuple[float, float, float]:
    """Computes f, f' and f'' at u."""
    distance, normal, bend, axis = measure(rows, g, compute_point(c, k, u))
    slope = compute_slope(c, k, u)
    turn = (
        2.0 * c[k, 2, 0] + 6.0 * u * c[k, 3, 0],
        2.0 * c[k, 2, 1] + 6.0 * u * c[k, 3, 1],
        2.0 * c[k, 2, 2] + 6.0 * u * c[k, 3, 2],
    )
    out, along = _dot(normal, slope), _dot(axis, slope)
    across = _dot(slope, slope) - out * out - along * along
    return distance, out, bend[0] * across + bend[1] * along * along + _dot(normal, turn)


@kernel
def _find_minimum(rows: Array, g: int, c: Array, k: int, low: float, high: float) -> float:
    """Finds u of a minimum between low, where f falls, and high, where it rises."""
    u = 0.5 * (low + high)
    for _ in range(_TURNS):
        _, slope, bend = _look(rows, g, c, k, u)
        if slope < 0.0:
            low = u
        else:
            high = u
        step = -slope / bend if bend > 0.0 else 2.0
        if not low < u + step < high:
            step = 0.5 * (low + high) - u
        u += step
        if abs(step) < _FINE:
            break
    return u


@kernel
def _search_piece(
    rows: Array, g: int, c: Array, k: int, ends: tuple[float, float], speed: float, best: float
) -> tuple[float, float]:
    """Finds the least f on a part of piece k where it is below `best`: (f, u), else (best, -1)."""
    width = (ends[1] - ends[0]) / _PARTS
    at = -1.0
    left, falls, _ = _look(rows, g, c, k, ends[0])
    if left < best:
        best, at = left, ends[0]
    for j in range(_PARTS):
        u = ends[0] + (j + 1) * width
        right, rises, _ = _look(rows, g, c, k, u)
        if right < best:
            best, at = right, u
        if falls < 0.0 < rises and 0.5 * (left + right - speed * width) < best:
            found = _find_minimum(rows, g, c, k, u - width, u)
            least, _, _ = _look(rows, g, c, k, found)
            if least < best:
                best, at = least, found
        left, falls = right, rises
    return best, at


@kernel
def find_nearest(
    rows: Array, g: int, line: Line, low: float, high: float, best: float
) -> tuple[float, int, float]:
    """Finds the point of the centre line nearest to geom g, among arc lengths from low to high.

    Args:
        rows: geoms, as in hoses/geds/shapes.py.
        g: the geom's row.
        line: arc lengths (K + 1,), coefficients (K, 4, 3) and balls (K, 5) of the pieces.
        low: arc length, m.
        high: arc length, m.
        best: only distances below this are looked for, m.

    Returns:
        distance, piece, u: the distance is `best` and the piece -1 where there is none.
    """
    arcs, coefficients, balls = line
    piece, at = -1, 0.0
    for k in range(coefficients.shape[0]):
        if arcs[k + 1] <= low or arcs[k] >= high:
            continue
        middle, _, _, _ = measure(rows, g, (balls[k, 0], balls[k, 1], balls[k, 2]))
        if middle - balls[k, 3] >= best:
            continue
        length = arcs[k + 1] - arcs[k]
        ends = (max(low - arcs[k], 0.0) / length, min((high - arcs[k]) / length, 1.0))
        best, u = _search_piece(rows, g, coefficients, k, ends, balls[k, 4], best)
        if u >= 0.0:
            piece, at = k, u
    return best, piece, at
