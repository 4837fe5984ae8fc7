"""Lattice geometry of the line-segment hose, exact in integers, and the tables built from it."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Integers

Bytes = npt.NDArray[np.uint8]

UP, DOWN, LEFT, RIGHT, NONE = range(5)
N_DIRECTIONS = 8
LARGEST_REACH = 8
"""Longest segment along an axis that a cover table is made for; it has 127,449 entries then."""
MARGIN = 2
"""How much farther than its limit one joint move can stretch a segment, in cells along an axis."""


@jitable
def covers(ax: Any, ay: Any, bx: Any, by: Any, x: Any, y: Any) -> Any:
    """Whether the segment from a to b meets the open unit square centred on the cell (x, y).

    They are apart exactly if an axis separates them: x, y, or the segment's normal, along which the
    segment is one number and the square reaches (|dx| + |dy|) / 2 to both sides of its centre.
    """
    dx, dy = bx - ax, by - ay
    reach = abs(dx) + abs(dy)
    return (
        (abs(2 * x - ax - bx) <= abs(dx))
        & (abs(2 * y - ay - by) <= abs(dy))
        & (2 * abs(dx * (y - ay) - dy * (x - ax)) < reach + (reach == 0))
    )


@jitable
def compute_covered(ax: Any, ay: Any, bx: Any, by: Any, x: Any, y: Any) -> Any:
    """Returns which of the cells that the actions lead to from (x, y) a segment covers.

    Bit a is the cell of action a; bit NONE is (x, y) itself. Whole arrays will do as well.
    """
    return (
        covers(ax, ay, bx, by, x, y + 1) << UP
        | covers(ax, ay, bx, by, x, y - 1) << DOWN
        | covers(ax, ay, bx, by, x - 1, y) << LEFT
        | covers(ax, ay, bx, by, x + 1, y) << RIGHT
        | covers(ax, ay, bx, by, x, y) << NONE
    )


def make_cover_table(reach: int) -> Bytes:
    """Makes the table of what `compute_covered` returns for short segments, from a to b.

    With m = reach, the longest segment in it in cells along an axis, it is ((2 m + 1)^2, (2 m +
    5)^2), by b - a and by the cell's place relative to a: row dx (2 m + 1) + dy and column x (2 m +
    5) + y, counted from their middles. What lies beyond the columns is covered no more than the
    outermost ones, which are zero.
    """
    m = reach
    dx, dy, x, y = np.ogrid[-m : m + 1, -m : m + 1, -m - 2 : m + 3, -m - 2 : m + 3]
    covered = compute_covered(0, 0, dx, dy, x, y).astype(np.uint8)
    return np.ascontiguousarray(covered.reshape((2 * m + 1) ** 2, (2 * m + 5) ** 2))


def list_offsets(largest_square: int) -> Integers:
    """Lists the lattice points at most sqrt(largest_square) from the origin (k, 2)."""
    radius = math.isqrt(largest_square)
    span = range(-radius, radius + 1)
    return np.array(
        [(x, y) for x in span for y in span if x * x + y * y <= largest_square], np.int64
    )


def make_offset_table(offsets: Integers) -> Integers:
    """Makes the table from an offset between neighbours to its number among those allowed (k, 2).

    It is (2 m + 1, 2 m + 1), the offset (0, 0) in the middle, with m = largest coordinate +
    `MARGIN`. An offset beyond the limit has the number of the nearest one within.
    """
    m = int(offsets.max()) + MARGIN
    span = np.arange(-m, m + 1)
    x, y = span[:, None, None], span[None, :, None]
    squares = (x - offsets[:, 0]) ** 2 + (y - offsets[:, 1]) ** 2
    return np.asarray(squares.argmin(axis=2), np.int64)


def make_distance_table(reach: int, levels: int, squared: bool) -> Integers:
    """Makes the table of distances, rounded down, or their squares, capped at levels - 1.

    It is (2 reach + 1, 2 reach + 1), the offset (0, 0) in the middle.
    """
    span = range(-reach, reach + 1)
    squares = [[x * x + y * y for y in span] for x in span]
    values = squares if squared else [[math.isqrt(s) for s in row] for row in squares]
    return np.minimum(np.array(values, np.int64), levels - 1)


def make_direction_table(reach: int) -> Integers:
    """Makes the table of directions 0 .. 7 (right is 0, then counter-clockwise), 0 at the origin.

    The eighths of the circle are centred on the axes and the diagonals.
    """
    span = np.arange(-reach, reach + 1)
    angles = np.arctan2(span[None, :], span[:, None])
    return np.floor((angles + np.pi / 8) / (np.pi / 4)).astype(np.int64) % N_DIRECTIONS
