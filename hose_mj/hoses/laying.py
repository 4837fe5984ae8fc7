"""Curves that a hose is laid along: any function is followed at an even pace."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from hose_mj.errors import InputError
from hose_mj.hoses.inputs import read_numbers
from hose_mj.hoses.protocol import Array, Curve

_VALID = "finite numbers, shape (k, 3), m"
_CHORDS = 1024
_EVEN = 1e-3
"""Of the mean pace: a function whose pace varies by less is taken as it is."""


def even_out(curve: Curve, length: float) -> Curve:
    """Returns a curve that goes as far in every metre of the hose.

    Rows of points are followed by their own length anyway. What is wrong with the points of a curve
    is left to `inputs.sample_curve` to say.

    Raises:
        InputError: what is neither numbers nor gives any; a function whose length is outside 0.5 to
            2 times the hose's.
    """
    if not callable(curve):
        return read_numbers("curve", curve, _VALID)
    follow = curve
    at = np.linspace(0.0, length, _CHORDS + 1)
    points = read_numbers("curve(arc_lengths)", follow(at), _VALID)
    if points.shape != (len(at), 3) or not np.all(np.isfinite(points)):
        return curve
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    total = float(chords.sum())
    if not 0.5 * length <= total <= 2.0 * length:
        raise InputError("length of the curve (m)", total, f"0.5 to 2 times the hose's, {length}")
    if np.any(chords == 0.0) or np.ptp(chords) < 2.0 * _EVEN * total / _CHORDS:
        return curve
    gone = np.concatenate([[0.0], np.cumsum(chords)])
    gone *= length / gone[-1]
    find_parameter = PchipInterpolator(gone, at)

    def evenly(s: Array) -> Array:
        return np.asarray(follow(np.clip(find_parameter(s), 0.0, length)), dtype=np.float64)

    return evenly
