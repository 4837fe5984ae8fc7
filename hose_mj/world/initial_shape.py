"""How a hose lies when a scene starts: at rest between its attachments, round what is there."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec

N_POINTS = 257  # points of a start shape
_DRAG = 4.0  # drag over linear density while the hose comes to rest (1/s)
_NEAR = 4  # points on either side of an attachment that may be near each other
_STEP, _DURATION = 0.004, 4.0
_MOST_WAVES = 6  # half waves between neighbours at most


def count_control_points(n_robots: int) -> int:
    """Control points of a hose with N robots: five spans between neighbours, at least 13 in all."""
    return 3 + max(13, 5 * n_robots)


def relax_initial_shape(
    spec: HoseSpec,
    places: Array,
    arc_lengths: Array,
    obstacles: Sequence[Obstacle],
    gravity: Array,
    control_points: int | None = None,
) -> GedsHose:
    """Returns a hose at rest that is held at its attachments and lies on what is below it.

    Between neighbours it starts as an arc of a circle or as waves to the side, or hanging: the
    first of these that is clear of obstacles and does not cross what is there of the hose. Then it
    moves through a viscous medium, without friction, until it has found its place. All hose
    models start from this shape.

    Args:
        spec: the hose.
        places: of the attachments, from the tip to the source, (N + 1, 3), m.
        arc_lengths: theirs, falling to 0, (N + 1,), m.
        obstacles: what is in the way, at rest; robots among them.
        gravity: (3,), m/s^2.
        control_points: of the hose; None for five spans between neighbours.
    """
    n = count_control_points(len(places) - 1) if control_points is None else control_points
    hose = GedsHose(
        replace(spec, drag=_DRAG * spec.linear_density, damping_time=max(spec.damping_time, 0.02)),
        timestep=_STEP,
        gravity=gravity,
        control_points=n,
        obstacles=[replace(one, friction=0.0) for one in obstacles],
        scheme="backward-euler",
    )
    with hose.unwatched():  # a guess may be strained: what comes of it is at rest
        hose.reset(_draw_guess(hose, places[::-1], arc_lengths[::-1]))
        for s, place in zip(arc_lengths, places, strict=True):
            hose.attach(float(s), place)
        hose.step(round(_DURATION / _STEP))
    return hose


def _draw_guess(hose: GedsHose, places: Array, arc_lengths: Array) -> Array:
    """The first shape, from the source to the tip; a free end goes straight on. (257, 3), m."""
    even = np.linspace(0.0, hose.spec.length, N_POINTS)
    points = np.zeros((N_POINTS, 3))
    last = np.array([1.0, 0.0, 0.0])
    for (s, place), (end, target) in pairwise(zip(arc_lengths, places, strict=True)):
        mine = (even >= s) & (even <= end)
        parts = (even[mine] - s) / (end - s)
        chord = target - place
        direction = chord / max(float(np.linalg.norm(chord)), 1e-12)
        if not np.hypot(direction[0], direction[1]) > 1e-9:
            direction = last
        side = np.cross([0.0, 0.0, 1.0], direction)
        side /= np.linalg.norm(side)
        down = np.array([0.0, 0.0, -1.0])
        choices = [_draw_arc(place, chord, end - s, parts, bulge) for bulge in (side, -side)]
        choices += [
            _draw_waves(place, chord, end - s, parts, bulge, count)
            for count in range(2, _MOST_WAVES + 1)
            for bulge in (side, -side)
        ]
        choices += [_draw_arc(place, chord, end - s, parts, bulge) for bulge in (down, -down)]
        earlier = points[even < s]
        costs = [_judge(hose, even[mine], choice, earlier) for choice in choices]
        points[mine] = choices[int(np.argmin(costs))]
        last = direction
    beyond = even > arc_lengths[-1]
    points[beyond] = places[-1] + (even[beyond] - arc_lengths[-1])[:, None] * last
    return points


def _judge(hose: GedsHose, arc_lengths: Array, points: Array, earlier: Array) -> float:
    """Rates how little points (k, 3), m, suit as the next part of a hose after others (j, 3).

    What it would stand in counts, then whether it would cross itself.
    """
    radius = hose.spec.outer_radius
    cost = 1e3 * (0.99 * radius - _compute_clearance(hose, arc_lengths, points)) / radius
    apart = np.linalg.norm(points[None, _NEAR:] - earlier[:-_NEAR, None], axis=2)
    if apart.min(initial=np.inf) < 2.0 * radius:
        cost += 10.0
    return cost


def _compute_clearance(hose: GedsHose, arc_lengths: Array, points: Array) -> float:
    """Least distance of points (k, 3) of the hose from obstacles, nearly a radius at most (m)."""
    distances = hose.contacts.measure_obstacles(points)
    for row, obstacle in zip(distances, hose.contacts.obstacles, strict=True):
        low, high = obstacle.skips
        row[(arc_lengths >= low) & (arc_lengths <= high)] = np.inf
    return float(distances.min(initial=0.99 * hose.spec.outer_radius))


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


def _draw_waves(
    start: Array, chord: Array, length: float, parts: Array, bulge: Array, count: int
) -> Array:
    """Points at parts (k,) of so many half waves of this length along a chord, (k, 3)."""
    t = np.linspace(0.0, 1.0, 400)
    wave = np.sin(count * np.pi * t)
    low, high = 0.0, length
    for _ in range(60):
        middle = 0.5 * (low + high)
        line = t[:, None] * chord + middle * wave[:, None] * bulge
        arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        low, high = (middle, high) if arcs[-1] < length else (low, middle)
    at = np.interp(parts, arcs / arcs[-1], t)
    return np.asarray(
        start + at[:, None] * chord + low * np.sin(count * np.pi * at)[:, None] * bulge
    )
