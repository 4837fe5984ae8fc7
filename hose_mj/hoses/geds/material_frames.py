"""Where the material of a spline hose points: its tangent and directors, from what clamps hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds.records import Hose
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.geds.twist import Twist
from hose_mj.hoses.geds.twist_segments import transport_director
from hose_mj.hoses.protocol import Array

_STEPS_PER_SPAN = 12


def turn_about(tangents: Array, directors: Array, angles: Array) -> Array:
    """Returns directors (k, 3) turned about unit tangents (k, 3), right-handed, by angles (k,)."""
    across = np.cross(tangents, directors)
    return np.asarray(np.cos(angles)[:, None] * directors + np.sin(angles)[:, None] * across)


def transport_along(
    spline: Spline, x: Array, start: float, director: Array, places: Array
) -> Array:
    """Returns a director (3,) at arc length `start` carried along the hose without twist, (k, 3).

    By two reflections a step (Wang et al. 2008), whose error falls with the fourth power of it.
    """
    n_steps = _STEPS_PER_SPAN * (spline.n_control_points - 3)
    grid = np.unique(
        np.concatenate([[start], np.linspace(0.0, spline.length, n_steps + 1), places])
    )
    found = _reflect(spline, x, grid[grid >= start], director)
    found |= _reflect(spline, x, grid[grid <= start][::-1], director)
    return np.array([found[float(s)] for s in places]).reshape(-1, 3)


def _reflect(spline: Spline, x: Array, grid: Array, director: Array) -> dict[float, Array]:
    """Carries a director from the first arc length of a grid to the others."""
    points, slopes = spline.evaluate(grid, x), spline.evaluate(grid, x, 1)
    tangents = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-12)
    found = {float(grid[0]): director}
    for k in range(1, len(grid)):
        chord = points[k] - points[k - 1]
        square = float(chord @ chord)
        if square > 0.0:
            director = director - (2.0 / square) * (chord @ director) * chord
            image = tangents[k - 1] - (2.0 / square) * (chord @ tangents[k - 1]) * chord
            normal = tangents[k] - image
            square = float(normal @ normal)
            if square > 0.0:
                director = director - (2.0 / square) * (normal @ director) * normal
        found[float(grid[k])] = director
    return found


def interpolate_directors(
    spline: Spline, hose: Hose, twist: Twist, s: Array, x: Array, tangents: Array
) -> Array:
    """Returns m1 (k, 3) of a hose with theta at arc lengths (k,) with unit tangents (k, 3).

    Between the reference directors of two Gauss points, both carried to the tangent there.
    """
    n_frames = 3 * len(hose.tables.first)
    nodes = np.cumsum(np.tile(hose.tables.gaps, len(hose.tables.first))) * hose.tables.span_length
    nodes -= nodes[0] - 0.5 * hose.tables.gaps[0] * hose.tables.span_length
    before = np.clip(np.searchsorted(nodes, s) - 1, 0, n_frames - 2)
    share = (s - nodes[before]) / (nodes[before + 1] - nodes[before])
    near, far = (
        np.array(
            [
                transport_director(twist.accepted[row, :3], tangent, twist.accepted[row, 6:9])
                for row, tangent in zip(rows, tangents, strict=True)
            ]
        )
        for rows in (before, before + 1)
    )
    across = np.sum(tangents * np.cross(near, far), axis=1)
    angles = share * np.arctan2(across, np.sum(near * far, axis=1))
    return turn_about(tangents, near, angles + spline.evaluate_theta(s, x))


def make_matrices(tangents: Array, directors: Array) -> Array:
    """Returns rotation matrices (k, 3, 3) with columns t, m1 and m2 = t x m1."""
    firsts = directors - np.sum(directors * tangents, axis=1)[:, None] * tangents
    firsts /= np.linalg.norm(firsts, axis=1, keepdims=True)
    return np.stack([tangents, firsts, np.cross(tangents, firsts)], axis=2)


def check_rotation(name: str, value: ArrayLike) -> Array:
    """Returns a rotation matrix (3, 3); raises `InputError` for anything else."""
    try:
        matrix = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(name, value, "a rotation matrix (3, 3)") from None
    fits = matrix.shape == (3, 3) and bool(np.all(np.isfinite(matrix)))
    if not fits or np.abs(matrix.T @ matrix - np.eye(3)).max() > 1e-6 or np.linalg.det(matrix) < 0:
        valid = "a rotation matrix (3, 3): orthogonal and right-handed"
        raise InputError(name, matrix.tolist(), valid)
    return matrix
