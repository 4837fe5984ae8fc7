"""How a hose lies when a scene starts: at rest between its attachments, round what is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from hose_mj.hoses.geds.model import GedsHose
from hose_mj.hoses.model import Array
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.spec import HoseSpec

N_POINTS = 257
"""Points of a start shape."""
_DRAG = 4.0
"""Drag over linear density while the hose comes to rest (1/s)."""
_STEP, _DURATION = 0.004, 4.0


def count_control_points(n_robots: int) -> int:
    """Control points of a hose with N robots: five spans between neighbours, at least 13 in all."""
    return 3 + max(13, 5 * n_robots)


def lay_hose(
    spec: HoseSpec,
    places: Array,
    arc_lengths: Array,
    obstacles: Sequence[Obstacle],
    gravity: Array,
) -> Array:
    """Returns a hose at rest that is held at its attachments and lies on what is below it.

    Between neighbours it starts as an arc of a circle to the side, or hanging where there is room
    for that, whichever is clearest of obstacles, and then moves through a viscous medium until it
    has found its place. The same for all hose models.

    Args:
        spec: the hose.
        places: of the attachments, from the tip to the source, (N + 1, 3), m.
        arc_lengths: theirs, falling to 0, (N + 1,), m.
        obstacles: what is in the way, at rest.
        gravity: (3,), m/s^2.

    Returns:
        points spread evenly from arc length 0 to L, (257, 3), m.
    """
    hose = GedsHose(
        replace(spec, drag=_DRAG * spec.linear_density, damping_time=max(spec.damping_time, 0.02)),
        timestep=_STEP,
        gravity=gravity,
        control_points=count_control_points(len(places) - 1),
        obstacles=obstacles,
        scheme="backward-euler",
    )
    even = np.linspace(0.0, spec.length, N_POINTS)
    first = _draw_arcs(hose, places[::-1], arc_lengths[::-1])
    hose.reset(first)
    for s, place in zip(arc_lengths, places, strict=True):
        hose.attach(float(s), place)
    hose.step(round(_DURATION / _STEP))
    return hose.position(even)


def _draw_arcs(hose: GedsHose, places: Array, arc_lengths: Array) -> Array:
    """Arcs of circles from the source to the tip; a free end goes straight on. (257, 3), m."""
    even = np.linspace(0.0, hose.spec.length, N_POINTS)
    points = np.zeros((N_POINTS, 3))
    last = np.array([1.0, 0.0, 0.0])
    for (s, place), (end, target) in pairwise(zip(arc_lengths, places, strict=True)):
        mine = (even >= s) & (even <= end)
        parts = (even[mine] - s) / (end - s)
        chord = target - place
        direction = chord / max(float(np.linalg.norm(chord)), 1e-12)
        side = np.cross([0.0, 0.0, 1.0], direction)
        if not np.linalg.norm(side) > 1e-9:
            direction, side = last, np.cross([0.0, 0.0, 1.0], last)
        side /= np.linalg.norm(side)
        choices = [
            _draw_arc(place, chord, end - s, parts, bulge)
            for bulge in (side, -side, np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]))
        ]
        clear = [hose.measure_obstacles(c).min(initial=hose.spec.radius) for c in choices]
        points[mine] = choices[int(np.argmax(np.minimum(clear, hose.spec.radius)))]
        last = direction
    beyond = even > arc_lengths[-1]
    points[beyond] = places[-1] + (even[beyond] - arc_lengths[-1])[:, None] * last
    return points


def _draw_arc(start: Array, chord: Array, length: float, parts: Array, bulge: Array) -> Array:
    """Points at parts (k,) of an arc of this length over a chord, bulging to one side, (k, 3)."""
    distance = float(np.linalg.norm(chord))
    ratio = min(distance / length, 1.0)
    if ratio > 1.0 - 1e-9:
        return np.asarray(start + parts[:, None] * chord)
    low, high = 0.0, np.pi  # half of the arc's angle: sin(x) / x = ratio
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.sin(middle) > ratio * middle else (low, middle)
    radius = 0.5 * length / low
    angles = low * (2.0 * parts - 1.0)
    along = chord / distance if distance > 1e-12 else np.cross(bulge, [0.0, 0.0, 1.0])
    x = radius * (np.sin(angles) + np.sin(low))
    y = radius * (np.cos(angles) - np.cos(low))
    return np.asarray(start + x[:, None] * along + y[:, None] * bulge)
