"""Where the contact points of a hose are, and how near a shape: gaps, sweeps, what is near."""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.contact_law import MARGIN, RADIUS
from hose_mj.hoses.geds.shapes import (
    FRICTION,
    POSITION,
    SKIP_FROM,
    SKIP_TO,
    SPIN,
    VELOCITY,
    is_near,
    measure,
)
from hose_mj.jit import apart, kernel

_FLAT = ((0.0, 0.0), (0.0, 0.0, 0.0))
FAST = 0.25
"""Points that move less than this part of the radius in a step are not swept: what they could pass
is thinner than the lattice of points resolves."""
IMPACT = 0.05
"""A point that newly touches faster than this (m/s) ends BDF2's memory: it would bring back the
speed from before the wall, and energy with it."""
_LOOKS = 40
"""Distances asked for along a sweep at most; each goes as far as it is free to."""
_ARRIVED = 0.002
"""A sweep ends within so many radii of a surface."""
_TURNED = 0.7
"""Cosine of the angle between the normals where a point enters and where it is, below which it has
passed an edge or the middle of the body (45 degrees): then it is held by the plane of its entry."""


@kernel
def evaluate(axes, points, q, start, x):
    """sum_i N_i x_i at contact point q as three coordinates; a planar hose's last is 0."""
    d = len(axes)
    n0, n1, n2, n3 = points[q, 0], points[q, 1], points[q, 2], points[q, 3]
    y0 = n0 * x[start] + n1 * x[start + d] + n2 * x[start + 2 * d] + n3 * x[start + 3 * d]
    k = start + 1
    y1 = n0 * x[k] + n1 * x[k + d] + n2 * x[k + 2 * d] + n3 * x[k + 3 * d]
    y2 = 0.0
    if d > 2:
        k = start + 2
        y2 = n0 * x[k] + n1 * x[k + d] + n2 * x[k + 2 * d] + n3 * x[k + 3 * d]
    return y0, y1, y2


@kernel
def _compute_surface_velocity(geoms, g, point):
    """Velocity of the geom's material at a point."""
    d0 = point[0] - geoms[g, POSITION]
    d1 = point[1] - geoms[g, POSITION + 1]
    d2 = point[2] - geoms[g, POSITION + 2]
    w0, w1, w2 = geoms[g, SPIN], geoms[g, SPIN + 1], geoms[g, SPIN + 2]
    return (
        geoms[g, VELOCITY] + w1 * d2 - w2 * d1,
        geoms[g, VELOCITY + 1] + w2 * d0 - w0 * d2,
        geoms[g, VELOCITY + 2] + w0 * d1 - w1 * d0,
    )


@kernel
def find_surface_velocity(contact, q, g, point):
    """Velocity of what contact point q meets at a point; geom -1 is what was handed in."""
    if g < 0:
        row = contact.given
        return row[q, 5], row[q, 6], row[q, 7]
    return _compute_surface_velocity(contact.geoms, g, point)


@kernel
def compute_surface_move(contact, q, g, point, elapsed):
    """How far the material of geom g that is at a point now has moved in `elapsed` (m).

    To second order: on a turntable nothing may creep.
    """
    v = find_surface_velocity(contact, q, g, point)
    if g < 0:
        return v[0] * elapsed, v[1] * elapsed, v[2] * elapsed
    geoms = contact.geoms
    middle = (
        point[0] - 0.5 * elapsed * (v[0] - geoms[g, VELOCITY]),
        point[1] - 0.5 * elapsed * (v[1] - geoms[g, VELOCITY + 1]),
        point[2] - 0.5 * elapsed * (v[2] - geoms[g, VELOCITY + 2]),
    )
    v = _compute_surface_velocity(geoms, g, middle)
    return v[0] * elapsed, v[1] * elapsed, v[2] * elapsed


@kernel
def is_skipped(contact, q, g):
    """Whether contact point q is on the part of the hose that does not touch geom g."""
    if g < 0:
        return False
    return contact.geoms[g, SKIP_FROM] <= contact.arcs[q] <= contact.geoms[g, SKIP_TO]


@apart
def find_span(axes, contact, e, x, start):
    """Middle (3,) and radius (m) of a ball about span e, how far its control points have moved.

    The ball holds four control points, in whose hull the curve lies, and where they came from. The
    move (m) is that since the beginning of the step; last comes the greatest |r'| there may be.
    """
    d = len(axes)
    n_coordinates = len(axes[:3])
    first = e * d
    middle = (0.0, 0.0, 0.0)
    square, moved, stretch = 0.0, 0.0, 0.0
    for i in range(4):
        k = first + i * d
        z = x[k + 2] if d > 2 else 0.0
        middle = (middle[0] + 0.25 * x[k], middle[1] + 0.25 * x[k + 1], middle[2] + 0.25 * z)
    for i in range(4):
        k = first + i * d
        z = x[k + 2] if d > 2 else 0.0
        away = (x[k] - middle[0]) ** 2 + (x[k + 1] - middle[1]) ** 2 + (z - middle[2]) ** 2
        square = max(square, away)
        move, slope = 0.0, 0.0
        for c in range(n_coordinates):
            move += (x[k + c] - start[k + c]) ** 2
            if i < 3:
                slope += (x[k + d + c] - x[k + c]) ** 2
        moved = max(moved, move)
        if i < 3:
            stretch = max(stretch, slope * contact.slopes[e + i] ** 2)
    moved = np.sqrt(moved)
    return middle, np.sqrt(square) + moved, moved, np.sqrt(stretch)


@kernel
def is_span_near(contact, g, ball):
    """Whether a span within a ball (`find_span`) may touch geom g."""
    if g < 0:
        return True
    return is_near(contact.geoms, g, ball[0], ball[1] + contact.law[RADIUS] + contact.law[MARGIN])


@kernel
def find_next(contact, q, end, gap, stretch):
    """The next contact point before `end` that may touch where point q has this gap."""
    reach = (gap - contact.law[MARGIN]) / max(stretch, 1e-300)
    after = q + 1
    while after < end and contact.arcs[after] - contact.arcs[q] < reach:
        after += 1
    return after


@apart
def compute_gap(axes, contact, q, g, start, x, motion, is_fast):
    """Gap, normal, curvature, friction and place of contact point q against geom g.

    Geom -1 stands for the distances handed in: planes through the points nearest then. Where points
    are fast each is swept from where it was: what it hits on the way holds it.
    """
    point = evaluate(axes, contact.points, q, start, x)
    if g < 0:
        row = contact.given
        normal = (row[q, 1], row[q, 2], row[q, 3])
        gap = row[q, 0] - contact.law[RADIUS]
        for c in range(3):
            gap += normal[c] * (point[c] - row[q, 8 + c])
        return gap, normal, _FLAT, row[q, 4], point
    at = point
    if motion.ahead > 0.0:
        # Where the shape stands at the end of the step, seen from it, this point will be there.
        move = compute_surface_move(contact, q, g, point, motion.ahead)
        at = (point[0] + move[0], point[1] + move[1], point[2] + move[2])
    distance, normal, bend, axis = measure(contact.geoms, g, at)
    gap, curvature = distance - contact.law[RADIUS], (bend, axis)
    if is_fast:
        before = evaluate(axes, contact.points, q, start, motion.before)
        # Since then no more has gone by: one and a half stages of BDF2 make a step.
        elapsed = min(motion.elapsed, 1.5 * motion.step) + motion.ahead
        here = gap, normal, curvature
        gap, normal, curvature = _sweep(contact, q, g, before, at, elapsed, here)
    return gap, normal, curvature, contact.geoms[g, FRICTION], point


@kernel
def _sweep(contact, q, g, before, point, elapsed, here):
    """What holds a point that comes from `before`: the surface where it is, or where it entered.

    In the frame of the body, which has moved with its surface.
    """
    radius = contact.law[RADIUS]
    move = compute_surface_move(contact, q, g, before, elapsed)
    at = (before[0] + move[0], before[1] + move[1], before[2] + move[2])
    way = (point[0] - at[0], point[1] - at[1], point[2] - at[2])
    chord = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    distance, normal, _, _ = measure(contact.geoms, g, at)
    gap = distance - radius
    if chord <= max(gap, FAST * radius):
        return here
    t = 0.0
    for _ in range(_LOOKS):
        if gap < _ARRIVED * radius:
            break
        t += gap / chord
        if t >= 1.0:
            return here
        place = (at[0] + t * way[0], at[1] + t * way[1], at[2] + t * way[2])
        distance, normal, _, _ = measure(contact.geoms, g, place)
        gap = distance - radius
    if normal[0] * here[1][0] + normal[1] * here[1][1] + normal[2] * here[1][2] > _TURNED:
        return here
    left = 1.0 - t
    for c in range(3):
        gap += left * way[c] * normal[c]
    return gap, normal, _FLAT
