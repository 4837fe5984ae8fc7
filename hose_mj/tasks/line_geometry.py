"""Lattice geometry of the line-segment hose, exact in integers, and the tables built from it."""

from __future__ import annotations

import math

import numpy as np

from hose_mj.compiled import jitable
from hose_mj.tasks.kernels import Integers

N_DIRECTIONS = 8
MARGIN = 2
"""How much farther than its limit one joint move can stretch a segment, in cells along an axis."""


@jitable
def covers(ax, ay, bx, by, x, y):  # type: ignore[no-untyped-def]
    """Whether the segment from a to b meets the open unit square centred on the cell (x, y).

    They are apart exactly if an axis separates them: x, y, or the segment's normal, along which the
    segment is one number and the square reaches (|dx| + |dy|) / 2 to both sides of its centre.
    """
    if x < min(ax, bx) or x > max(ax, bx) or y < min(ay, by) or y > max(ay, by):
        return False
    dx, dy = bx - ax, by - ay
    reach = abs(dx) + abs(dy)
    return reach == 0 or 2 * abs(dx * (y - ay) - dy * (x - ax)) < reach


def list_offsets(largest_square: int) -> Integers:
    """Lists the lattice points at most sqrt(largest_square) from the origin (k, 2)."""
    radius = math.isqrt(largest_square)
    span = range(-radius, radius + 1)
    return np.array(
        [(x, y) for x in span for y in span if x * x + y * y <= largest_square], np.int64
    )


def make_offset_table(offsets: Integers) -> Integers:
    """Makes the table from an offset between neighbours to its number.

    Args:
        offsets: the offsets that the hose allows (k, 2).

    Returns:
        (2 m + 1, 2 m + 1), the offset (0, 0) in the middle, with m = largest coordinate + `MARGIN`.
        An offset beyond the limit has the number of the nearest one within.
    """
    m = int(offsets.max()) + MARGIN
    span = np.arange(-m, m + 1)
    x, y = span[:, None, None], span[None, :, None]
    squares = (x - offsets[:, 0]) ** 2 + (y - offsets[:, 1]) ** 2
    return np.asarray(squares.argmin(axis=2), np.int64)


def make_distance_table(reach: int, levels: int, squared: bool) -> Integers:
    """Makes the table of distances, rounded down, or their squares, capped at levels - 1.

    Args:
        reach: largest coordinate of an offset.
        levels: number of different values.
        squared: whether the squares are wanted.

    Returns:
        (2 reach + 1, 2 reach + 1), the offset (0, 0) in the middle.
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
