"""All margins of a world in one compiled call, but for pairs of geoms that are left to MuJoCo.

A kind of constraint (kinds.py) is measured by a kernel here, which `measure_margins` calls. `t` is
everywhere the `Tables`: margins of a kind begin at `t.starts[KIND]` and end at
`t.starts[KIND + 1]`, and things may come as near as `t.clearances[KIND]`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hose_mj.constraints.hose_distance import (
    Point,
    compute_point,
    compute_slope,
    find_nearest,
    locate,
    update_balls,
)
from hose_mj.constraints.kinds import BOUNDS, COLLISION, OBSTACLE, RUN_OVER
from hose_mj.hoses.geds.shapes import BOUND, KIND, POSITION, ROTATION, SIZE, measure
from hose_mj.hoses.protocol import Array
from hose_mj.jit import kernel

Ints = NDArray[np.int64]

OTHER_KIND = -1.0
"""In a row of hoses/geds/shapes.py: a geom of which only the bounding ball counts here."""
_GAUSS = ((0.5 - np.sqrt(0.15), 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + np.sqrt(0.15), 5.0 / 18.0))
"""Places in [0, 1] and weights of three-point Gauss quadrature."""


class Tables(NamedTuple):
    """What does not change while a monitor watches, and room to work in."""

    radius: float  # of the hose, m
    tension: float  # that breaks a segment, N
    stiffness: float  # the hose's axial stiffness, N
    lengthening: float  # that breaks a segment, as a fraction
    sight: float  # distances are measured up to this, m
    clearances: Array  # of each kind, in the order of `KINDS` (n_kinds,), m
    bounds: Array  # low and high corner (2, 3), m
    starts: Ints  # the first margin of each kind, in this order, and the end (n_kinds + 1,)
    segments: Array  # arc lengths of the attachments from the source's, (N + 1,), m
    own: Array  # arc lengths between which a robot's own hose lies (N, 2), m
    samples: Array  # arc lengths where tension is known (T,), m
    sample_segments: Ints  # the segment of each (T,)
    parts: Ints  # parts of the hose within one piece and one segment: piece, segment (P, 2)
    part_ends: Array  # where they begin and end within the piece (P, 2)
    rows: Array  # geoms of robots and obstacles, as in hoses/geds/shapes.py (G, ROW)
    ids: Ints  # their numbers in the mjModel (G,)
    robot_rows: Ints  # robot i has the rows from its entry to the next one's (N + 1,)
    upright: NDArray[np.bool_]  # whether a robot is one cylinder that stays upright (N,)
    obstacles: NDArray[np.bool_]  # whether a robot's geom may hit a geom (R, G)
    balls: Array  # of the hose's pieces (K, 5)
    hulls: Array  # centre and radius of a ball about each robot (N, 4), m
    near: Ints  # pairs of geoms left to MuJoCo: rows and margin (Q, 3)
    gaps: Array  # lower bounds on the distances of these pairs (Q,), m
    margins: Array  # (M,)
    places: Array  # (M, 3), m
    others: Ints  # segment or row that a margin is about, -1 for none (M,)


@kernel
def _put(t: Tables, m: int, margin: float, place: Point, other: int) -> None:
    """Writes margin m."""
    t.margins[m] = margin
    t.others[m] = other
    for c in range(3):
        t.places[m, c] = place[c]


@kernel
def _place_geoms(t: Tables, positions: Array, rotations: Array) -> None:
    """Copies geom_xpos and geom_xmat into the rows, and lays a ball about each robot."""
    for g in range(t.ids.shape[0]):
        for c in range(3):
            t.rows[g, POSITION + c] = positions[t.ids[g], c]
        for c in range(9):
            t.rows[g, ROTATION + c] = rotations[t.ids[g], c]
    for i in range(t.hulls.shape[0]):
        first, last = t.robot_rows[i], t.robot_rows[i + 1]
        for c in range(3):
            total = 0.0
            for g in range(first, last):
                total += t.rows[g, POSITION + c]
            t.hulls[i, c] = total / (last - first)
        t.hulls[i, 3] = 0.0
        for g in range(first, last):
            square = 0.0
            for c in range(3):
                square += (t.rows[g, POSITION + c] - t.hulls[i, c]) ** 2
            t.hulls[i, 3] = max(t.hulls[i, 3], np.sqrt(square) + t.rows[g, BOUND])


@kernel
def _measure_stretch(t: Tables, arcs: Array, coefficients: Array, tensions: Array) -> None:
    """Per segment: by its largest tension, and by its length, as a tension by Hooke's law.

    Stretch is the first kind, so margin i is segment i's. While a segment is looked at, its margin
    holds its length.
    """
    n = t.segments.shape[0] - 1
    for i in range(n):
        t.margins[i] = 0.0
        t.others[i] = -1
    for p in range(t.parts.shape[0]):
        k = t.parts[p, 0]
        low, width = t.part_ends[p, 0], t.part_ends[p, 1] - t.part_ends[p, 0]
        for place, weight in _GAUSS:
            d = compute_slope(coefficients, k, low + place * width)
            length = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            t.margins[t.parts[p, 1]] += weight * width * length
    for j in range(tensions.shape[0]):
        i = t.sample_segments[j]
        if t.others[i] < 0 or tensions[j] > tensions[t.others[i]]:
            t.others[i] = j
    for i in range(n):
        peak = t.others[i]
        strain = t.margins[i] / (t.segments[i] - t.segments[i + 1]) - 1.0
        k, u = locate(arcs, t.samples[peak])
        margin = min(t.tension - tensions[peak], t.stiffness * (t.lengthening - strain))
        _put(t, i, margin, compute_point(coefficients, k, u), i)


@kernel
def _measure_run_over(t: Tables, arcs: Array, coefficients: Array) -> None:
    """Per robot: how far its geoms are from the hose's surface, its own hose left out."""
    n = t.own.shape[0]
    line = (arcs, coefficients, t.balls)
    for i in range(n):
        best, piece, at = t.sight + t.radius, -1, 0.0
        for g in range(t.robot_rows[i], t.robot_rows[i + 1]):
            if t.rows[g, KIND] == OTHER_KIND:
                continue
            for low, high in ((arcs[0], t.own[i, 0]), (t.own[i, 1], arcs[-1])):
                best, k, u = find_nearest(t.rows, g, line, low, high, best)
                if k >= 0:
                    piece, at = k, u
        margin = best - t.radius - t.clearances[RUN_OVER]
        if piece < 0:
            _put(t, t.starts[RUN_OVER] + i, margin, t.hulls[i], -1)
            continue
        arc = arcs[piece] + at * (arcs[piece + 1] - arcs[piece])
        segment = 0
        while segment < n - 1 and arc < t.segments[segment + 1]:
            segment += 1
        _put(t, t.starts[RUN_OVER] + i, margin, compute_point(coefficients, piece, at), segment)


@kernel
def _measure_discs(t: Tables, i: int, j: int, m: int) -> None:
    """Two upright cylinders: across, above one another, or from rim to rim."""
    a, b = t.robot_rows[i], t.robot_rows[j]
    d0 = t.rows[b, POSITION] - t.rows[a, POSITION]
    d1 = t.rows[b, POSITION + 1] - t.rows[a, POSITION + 1]
    d2 = t.rows[b, POSITION + 2] - t.rows[a, POSITION + 2]
    apart = np.sqrt(d0 * d0 + d1 * d1)
    across = apart - t.rows[a, SIZE] - t.rows[b, SIZE]
    above = abs(d2) - t.rows[a, SIZE + 1] - t.rows[b, SIZE + 1]
    if across > 0.0 and above > 0.0:
        distance = np.sqrt(across * across + above * above)
    else:
        distance = max(across, above)
    part = (t.rows[a, SIZE] + 0.5 * across) / max(apart, 1e-12)
    place = (
        t.rows[a, POSITION] + part * d0,
        t.rows[a, POSITION + 1] + part * d1,
        t.rows[a, POSITION + 2] + 0.5 * d2,
    )
    _put(t, m, min(distance, t.sight) - t.clearances[COLLISION], place, j)


@kernel
def _compute_gap(rows: Array, center: Point, reach: float, g: int) -> float:
    """Lower bound on the distance from geom g to anything in a ball."""
    if rows[g, KIND] == OTHER_KIND:
        d0 = center[0] - rows[g, POSITION]
        d1 = center[1] - rows[g, POSITION + 1]
        d2 = center[2] - rows[g, POSITION + 2]
        apart: float = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2) - reach - rows[g, BOUND]
        return apart
    distance, _, _, _ = measure(rows, g, center)
    gap: float = distance - reach
    return gap


@kernel
def _queue_pairs(t: Tables, kind: int, i: int, g: int, m: int, queued: int) -> int:
    """Leaves robot i's geoms that may be the nearest to geom g to MuJoCo; returns how many are.

    The margin comes down to what it can be at most: the middle of a geom is within the geom.
    """
    clearance = t.clearances[kind]
    hull = (t.hulls[i, 0], t.hulls[i, 1], t.hulls[i, 2])
    if _compute_gap(t.rows, hull, t.hulls[i, 3], g) >= t.margins[m] + clearance:
        return queued
    for a in range(t.robot_rows[i], t.robot_rows[i + 1]):
        if kind == OBSTACLE and not t.obstacles[a, g]:
            continue
        center = (t.rows[a, POSITION], t.rows[a, POSITION + 1], t.rows[a, POSITION + 2])
        gap = _compute_gap(t.rows, center, t.rows[a, BOUND], g)
        if gap < t.margins[m] + clearance:
            t.near[queued, 0], t.near[queued, 1], t.near[queued, 2] = a, g, m
            t.gaps[queued] = gap
            queued += 1
            if t.rows[g, KIND] != OTHER_KIND:
                t.margins[m] = min(t.margins[m], gap + t.rows[a, BOUND] - clearance)
    return queued


@kernel
def _measure_bodies(t: Tables) -> int:
    """Collisions and obstacles; returns how many pairs of geoms are left to MuJoCo."""
    n, queued, m = t.own.shape[0], 0, t.starts[COLLISION]
    for i in range(n):
        for j in range(i + 1, n):
            if t.upright[i] and t.upright[j]:
                _measure_discs(t, i, j, m)
            else:
                _put(t, m, t.sight - t.clearances[COLLISION], t.hulls[i], j)
                for g in range(t.robot_rows[j], t.robot_rows[j + 1]):
                    queued = _queue_pairs(t, COLLISION, i, g, m, queued)
            m += 1
    for i in range(t.starts[OBSTACLE + 1] - t.starts[OBSTACLE]):
        m = t.starts[OBSTACLE] + i
        _put(t, m, t.sight - t.clearances[OBSTACLE], t.hulls[i], -1)
        for g in range(t.robot_rows[n], t.rows.shape[0]):
            queued = _queue_pairs(t, OBSTACLE, i, g, m, queued)
    return queued


@kernel
def _measure_bounds(t: Tables, sites: Array) -> None:
    """Per robot: how far its site is inside the bounds, negative outside."""
    for i in range(t.starts[BOUNDS + 1] - t.starts[BOUNDS]):
        inside, square = np.inf, 0.0
        for c in range(3):
            gap = min(sites[i, c] - t.bounds[0, c], t.bounds[1, c] - sites[i, c])
            inside = min(inside, gap)
            square += min(gap, 0.0) ** 2
        distance = inside if inside >= 0.0 else -np.sqrt(square)
        _put(t, t.starts[BOUNDS] + i, distance - t.clearances[BOUNDS], sites[i], -1)


@kernel
def measure_margins(t, line, tensions, sites, poses):
    """Writes all margins with their places.

    Args:
        t: `rows` and everything after `obstacles` in it is written.
        line: arc lengths (K + 1,), m, and coefficients (K, 4, 3), m, of the centre line.
        tensions: at `samples` (T,), N.
        sites: where robots and source hold the hose (N + 1, 3), m.
        poses: MuJoCo's geom_xpos and geom_xmat, m.

    Returns:
        how many pairs of geoms are left to MuJoCo; their margins stand at the most they can be.
    """
    arcs, coefficients = line
    _place_geoms(t, poses[0], poses[1])
    update_balls(coefficients, t.balls)
    _measure_stretch(t, arcs, coefficients, tensions)
    _measure_run_over(t, arcs, coefficients)
    _measure_bounds(t, sites)
    return _measure_bodies(t)
