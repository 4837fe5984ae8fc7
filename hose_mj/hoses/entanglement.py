"""How a centre line lies to itself: its writhe, and the least distance between two parts of it."""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.protocol import Array

_FINE = np.linspace(-1.0, 1.0, 41)
"""Places about a pair of points, in pauses between points, where their distance is looked at."""


def compute_writhe(points: Array) -> float:
    """Writhe of a polyline (k, 3), open or with its last point in its first (turns).

    Method 1a of Klenin and Langowski, Biopolymers 54, 307 (2000): the solid angles under which
    pairs of edges see each other, over 2 pi. With its twist it makes the linking number of a closed
    line, which changes by 2 wherever the line passes through itself.
    """
    start, end = points[:-1], points[1:]
    i, j = np.triu_indices(len(start), 2)
    ends = (start[j] - start[i], end[j] - start[i], end[j] - end[i], start[j] - end[i])
    normals = [np.cross(a, b) for a, b in zip(ends, (*ends[1:], ends[0]), strict=True)]
    units = [n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300) for n in normals]
    angle = np.zeros(len(i))
    for one, other in zip(units, (*units[1:], units[0]), strict=True):
        angle += np.arcsin(np.clip(np.sum(one * other, axis=1), -1.0, 1.0))
    side = np.sum(np.cross((end - start)[j], (end - start)[i]) * ends[0], axis=1)
    return float(np.sum(angle * np.sign(side)) / (2.0 * np.pi))


def compute_least_distance(points: Array, length: float, apart: float, is_closed: bool) -> float:
    """Least distance (m) between parts of a line that are more than `apart` of arc from each other.

    Args:
        points: of the line, evenly along it, ends included, (k, 3), m.
        length: of the line (m).
        apart: least arc between them (m).
        is_closed: whether arc goes on from the last point to the first.

    Returns:
        infinity for a line that is shorter than that.
    """
    pause, along = length / (len(points) - 1), np.arange(1.0 * len(points))

    def measure(one: Array, other: Array) -> Array:
        """Distances between places, in pauses from the start, infinite where arc is short."""
        parts = [np.stack([np.interp(k, along, c) for c in points.T], axis=1) for k in (one, other)]
        between = np.abs(np.subtract.outer(one, other)) * pause
        if is_closed:
            between = np.minimum(between, length - between)
        found = np.linalg.norm(parts[0][:, None] - parts[1][None], axis=2)
        return np.where(between > apart, found, np.inf)

    coarse = measure(along, along)
    nearest = np.unravel_index(np.argmin(coarse), coarse.shape)
    return float(measure(*(np.clip(k + _FINE, 0.0, along[-1]) for k in nearest)).min())
