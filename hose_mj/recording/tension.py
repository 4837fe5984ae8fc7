"""Colours of a hose's tension: blue for pushed, pale for slack, yellow to red for pulled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hose_mj.recording.episode import Array

LOWEST = -0.25
"""Lowest tension that has a colour of its own, as a fraction of the limit."""
_FRACTIONS = np.array([LOWEST, 0.0, 0.35, 0.7, 1.0])
_COLORS = np.array(
    [[60, 120, 230], [214, 222, 230], [248, 214, 70], [244, 130, 30], [214, 30, 40]],
    dtype=np.float64,
)


def color_tension(tension: Array, limit: float) -> NDArray[np.uint8]:
    """Returns red, green, blue of tensions (...), N, shape (..., 3); `limit` (N) is red."""
    fractions = np.asarray(tension, dtype=np.float64) / limit
    parts = [np.interp(fractions, _FRACTIONS, _COLORS[:, k]) for k in range(3)]
    return np.stack(parts, axis=-1).round().astype(np.uint8)


def make_scale(limit: float, width: int = 400) -> tuple[NDArray[np.uint8], Array]:
    """Returns the colours from lowest to limit, (width, 3), and round tensions to label, N."""
    colors = color_tension(np.linspace(LOWEST * limit, limit, width), limit)
    return colors, limit * np.array([LOWEST, 0.0, 0.25, 0.5, 0.75, 1.0])
