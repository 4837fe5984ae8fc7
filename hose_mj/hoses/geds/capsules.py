"""`Capsules`: another hose as a row of moving capsules, for the contact between hoses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds import shapes
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import check_number


@dataclass(frozen=True)
class Capsules:
    """m capsules joined at their ends.

    Attributes:
        points: their ends (m + 1, 3), m.
        velocities: of the ends (m + 1, 3), m/s.
        radius: m.
        friction: Coulomb's coefficient.
        stiffness: of the contact (N/m^2).
    """

    points: Array
    velocities: Array
    radius: float
    friction: float
    stiffness: float

    def make_rows(self, order: list[int], offset: Array, scale: float) -> Array:
        """Returns a row of shapes.py for each, the world's axes taken in this order."""
        ends, speeds = (self.points - offset)[:, order], self.velocities[:, order]
        chords = np.diff(ends, axis=0)
        lengths = np.maximum(np.linalg.norm(chords, axis=1, keepdims=True), 1e-12)
        axes = chords / lengths
        away = np.eye(3)[np.argmin(np.abs(axes), axis=1)]
        first = np.cross(axes, away)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        rows = np.zeros((len(chords), shapes.ROW))
        rows[:, shapes.KIND] = shapes.CAPSULE
        rows[:, shapes.FRICTION] = self.friction
        rows[:, shapes.SIZE] = self.radius
        rows[:, shapes.SIZE + 1] = 0.5 * lengths[:, 0]
        rows[:, shapes.BOUND] = self.radius + 0.5 * lengths[:, 0]
        rows[:, shapes.POSITION : shapes.POSITION + 3] = 0.5 * (ends[1:] + ends[:-1])
        for column, axis in enumerate((first, np.cross(axes, first), axes)):
            rows[:, shapes.ROTATION + column : shapes.ROTATION + 9 : 3] = axis
        rows[:, shapes.VELOCITY : shapes.VELOCITY + 3] = 0.5 * (speeds[1:] + speeds[:-1])
        turn = np.cross(axes, np.diff(speeds, axis=0)) / lengths
        rows[:, shapes.SPIN : shapes.SPIN + 3] = turn
        rows[:, shapes.SCALE] = scale
        rows[:, shapes.SKIP_FROM], rows[:, shapes.SKIP_TO] = np.inf, -np.inf
        return rows


def check_capsules(
    points: ArrayLike, velocities: ArrayLike, radius: float, friction: float, stiffness: float
) -> Capsules:
    """Returns capsules; raises `InputError` for wrong shapes or numbers out of range."""
    places = np.asarray(points, dtype=np.float64)
    speeds = np.asarray(velocities, dtype=np.float64)
    if places.ndim != 2 or places.shape[1:] != (3,) or len(places) < 2:
        raise InputError("shape of the neighbour", places.shape, "(m + 1, 3) with m >= 1")
    if speeds.shape != places.shape:
        raise InputError("shape of the neighbour's velocities", speeds.shape, str(places.shape))
    if not np.all(np.isfinite(places)) or not np.all(np.isfinite(speeds)):
        raise InputError("neighbour", places, "finite places and velocities")
    check_number("radius", radius)
    check_number("friction", friction, may_be_zero=True)
    check_number("stiffness", stiffness)
    return Capsules(places, speeds, radius, friction, stiffness)
