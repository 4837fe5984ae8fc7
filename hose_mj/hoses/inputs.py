"""Checks of what a user hands to a hose: each answers with an `InputError` or clean arrays."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.protocol import Array, Curve
from hose_mj.toml_table import LARGEST_NUMBER

_LARGEST_COUNT = 2**31 - 1
"""MuJoCo counts steps in 32 bits."""
_ODD = (TypeError, ValueError, OverflowError)
"""What numpy raises for values that are no numbers, or numbers that no float holds."""
Kind = TypeVar("Kind")


def read_numbers(name: str, value: object, valid: str, largest: float = LARGEST_NUMBER) -> Array:
    """Returns real numbers as a float array of any shape, of which some may not be finite.

    Raises:
        InputError: anything else (text, complex numbers, truth values, a ragged list), or a finite
            number beyond `largest`, which no hose meets; its powers would overflow.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iufO":
            raise TypeError
        numbers = array.astype(np.float64, copy=False)
    except _ODD:
        raise InputError(name, value, valid) from None
    # What is not finite is left to the caller, who can say where it is.
    if not (np.abs(numbers) <= largest).all() and np.isfinite(numbers).all():
        raise InputError(name, value, f"{valid}, each at most {largest:g}")
    return numbers


def check_records(name: str, values: object, kind: type[Kind]) -> tuple[Kind, ...]:
    """Returns a list or tuple of records of one class; raises `InputError` for anything else."""
    if not isinstance(values, (list, tuple)):
        raise InputError(name, values, f"a list of records of the class {kind.__name__}")
    for value in values:
        if not isinstance(value, kind):
            raise InputError(name, value, f"records of the class {kind.__name__}")
    return tuple(values)


def check_count(name: str, value: object, least: int, most: int | None = None) -> int:
    """Returns a whole number from `least` to `most`; raises `InputError` for anything else."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    count = int(value) if whole else least - 1  # type: ignore[call-overload]
    if most is None and count > _LARGEST_COUNT:
        most = _LARGEST_COUNT
    if count < least or (most is not None and count > most):
        end = f"at or above {least}" if most is None else f"from {least} to {most}"
        raise InputError(name, value, f"a whole number {end}")
    return count


def check_arc_lengths(arc_length: ArrayLike, length: float, what: str = "arc_length") -> Array:
    """Returns arc lengths as a float array (k,); raises `InputError` for one off the hose."""
    valid = f"numbers on the hose, 0 to {length} m"
    values = np.atleast_1d(read_numbers(what, arc_length, valid, np.inf))
    if values.ndim != 1 or not np.all((values >= 0.0) & (values <= length)):
        raise InputError(what, arc_length, valid)
    return values


def check_place(arc_length: ArrayLike, length: float) -> float:
    """Returns one arc length; raises `InputError` unless it is one number on the hose."""
    places = check_arc_lengths(arc_length, length)
    if len(places) != 1:
        raise InputError("arc_length", arc_length, f"one number, 0 to {length} m")
    return float(places[0])


def check_vector(name: str, value: ArrayLike) -> Array:
    """Returns a finite vector of shape (3,); raises `InputError` otherwise."""
    vector = read_numbers(name, value, "three finite numbers")
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise InputError(name, value, "three finite numbers")
    return vector


def check_rows(name: str, value: ArrayLike, count: int) -> Array:
    """Returns finite numbers of shape (count, 3); raises `InputError` otherwise."""
    valid = f"finite numbers, shape ({count}, 3)"
    rows = read_numbers(name, value, valid)
    if rows.shape != (count, 3) or not np.all(np.isfinite(rows)):
        raise InputError(f"shape of {name}", rows.shape, valid)
    return rows


def sample_curve(curve: Curve, length: float, arc_lengths: Array) -> Array:
    """Returns the positions (k, 3) of a curve at rest arc lengths (k,).

    A polyline is sampled evenly by its own length (thesis A.3): its strain is the same everywhere.

    Raises:
        InputError: not finite, fewer than two points, a point repeated, or a length outside 0.5 to
            2 times the hose's.
    """
    if callable(curve):
        points = read_numbers("curve(arc_lengths)", curve(arc_lengths), "finite numbers (m)")
        if points.shape != (len(arc_lengths), 3):
            raise InputError("curve(arc_lengths)", points.shape, f"shape ({len(arc_lengths)}, 3)")
        check_curve_points(points)
        return points
    points = read_numbers("curve", curve, "finite numbers (m), or a function that returns them")
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2:
        raise InputError("curve", points.shape, "an array of shape (k, 3) with k >= 2")
    check_curve_points(points)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    if not 0.5 * length <= along[-1] <= 2.0 * length:
        raise InputError(
            "length of the curve (m)", along[-1], f"0.5 to 2 times the hose's, {length}"
        )
    fraction = arc_lengths / length * along[-1]
    return np.stack([np.interp(fraction, along, points[:, c]) for c in range(3)], axis=1)


def check_curve_points(points: Array) -> None:
    """Raises `InputError` for points that are not finite or repeat their neighbour."""
    if not np.all(np.isfinite(points)):
        bad = int(np.argmin(np.all(np.isfinite(points), axis=1)))
        raise InputError(f"curve[{bad}]", points[bad].tolist(), "finite coordinates (m)")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if np.any(steps == 0.0):
        bad = int(np.argmin(steps)) + 1
        raise InputError(
            f"curve[{bad}]", points[bad].tolist(), "a point apart from the one before it"
        )


def sample_velocity(velocity: Curve, length: float, arc_lengths: Array) -> Array:
    """Returns velocities (k, 3) at rest arc lengths (k,).

    Args:
        velocity: one for all (3,), rows (m, 3) spread evenly over the hose, or a function of arc
            lengths (k,).
        length: of the hose (m).
        arc_lengths: where they are wanted.

    Raises:
        InputError: a wrong shape, or a number that is not finite.
    """
    valid = "finite numbers (m/s), shape (3,), or (m, 3) with m >= 2"
    values = velocity(arc_lengths) if callable(velocity) else velocity
    rows = read_numbers("velocity", values, valid)
    if callable(velocity) and rows.shape != (len(arc_lengths), 3):
        raise InputError("velocity(arc_lengths)", rows.shape, f"shape ({len(arc_lengths)}, 3)")
    if rows.shape == (3,):
        rows = np.stack([rows, rows])
    if rows.ndim != 2 or rows.shape[1] != 3 or len(rows) < 2:
        raise InputError("shape of velocity", rows.shape, valid)
    if not np.all(np.isfinite(rows)):
        bad = int(np.argmin(np.all(np.isfinite(rows), axis=1)))
        raise InputError(f"velocity[{bad}]", rows[bad].tolist(), "finite numbers (m/s)")
    if callable(velocity):
        return rows
    even = np.linspace(0.0, length, len(rows))
    return np.stack([np.interp(arc_lengths, even, rows[:, c]) for c in range(3)], axis=1)
