"""Where a hose touches a shape, and with what force per length: the law of contact.py.

With gap g = distance - radius, n the outward normal and u the velocity of the hose relative to the
surface, the force per length on the hose is

    N n - mu N u_t / sqrt(u_t^2 + eps^2),   N = k max(0, S(g) - tau S'(g) u.n),

S the ramp of `ContactLaw` over k, whose slope is continuous.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
from hose_mj.hoses.protocol import Array
from hose_mj.jit import kernel

STIFFNESS, WIDTH, DAMPING, SLIP, RADIUS, TOLERANCE, SELF_STIFFNESS, SELF_DAMPING, ROUND = range(9)
"""Places in `Contact.law`; ROUND is the way round a closed loop (m), infinite in an open hose."""
GIVEN = 11
"""Columns of a distance handed in: distance, normal (3), friction, surface velocity (3) and the
place (3) of the contact point that it was measured at."""
_FLAT = ((0.0, 0.0), (0.0, 0.0, 0.0))


class Contact(NamedTuple):
    """What one hose may touch; coordinates of the hose come first, minus its plane's offset.

    Attributes:
        points: the four basis functions at each contact point and its share of arc length (m),
            (Q, 5), span after span, equally many in each.
        geoms: one row a shape, see shapes.py, (G, ROW).
        given: distances handed in, one row a contact point, (Q, 11); (0, 11) for none.
        law: numbers of the contact law, (9,); no self-contact where its stiffness is 0.
        arcs: rest arc lengths of the contact points, (Q,), m.
        room: work space, (Q + S, 4).
    """

    points: Array
    geoms: Array
    given: Array
    law: Array
    arcs: Array
    room: Array


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
def make_push(width, gap):
    """The ramp S of a gap (m) and its slope by the depth."""
    depth = max(width - gap, 0.0)
    if depth < 2.0 * width:
        return depth * depth / (4.0 * width), depth / (2.0 * width)
    return depth - width, 1.0


@kernel
def compute_force(law, scale, gap, normal, friction, velocity):
    """Force per length on the hose.

    Args:
        law: numbers of the contact law.
        scale: factor on its stiffness.
        gap: distance of the surfaces (m).
        normal: outward unit normal (3,).
        friction: Coulomb's coefficient.
        velocity: of the hose relative to the surface (3,).

    Returns:
        force (3,), normal force N, its slope by the depth at rest (N/m^2), slip v = u_t / s (3,)
        and s (m/s).
    """
    push, slope = make_push(law[WIDTH], gap)
    u = velocity
    away = u[0] * normal[0] + u[1] * normal[1] + u[2] * normal[2]
    stiffness = scale * law[STIFFNESS]
    N = stiffness * max(push - law[DAMPING] * slope * away, 0.0)
    t0 = u[0] - away * normal[0]
    t1 = u[1] - away * normal[1]
    t2 = u[2] - away * normal[2]
    s = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2 + law[SLIP] * law[SLIP])
    slip = (t0 / s, t1 / s, t2 / s)
    drag = friction * N
    force = (
        N * normal[0] - drag * slip[0],
        N * normal[1] - drag * slip[1],
        N * normal[2] - drag * slip[2],
    )
    return force, N, stiffness * slope, slip, s


@kernel
def compute_gap(axes, contact, q, g, start, x):
    """Gap, normal, curvature, friction and surface velocity at contact point q and geom g.

    Geom -1 stands for the distances handed in: planes through the points nearest then.
    """
    point = evaluate(axes, contact.points, q, start, x)
    if g < 0:
        row = contact.given
        normal = (row[q, 1], row[q, 2], row[q, 3])
        surface = (row[q, 5], row[q, 6], row[q, 7])
        gap = row[q, 0] - contact.law[RADIUS]
        for c in range(3):
            gap += normal[c] * (point[c] - row[q, 8 + c])
        return gap, normal, _FLAT, row[q, 4], surface
    geoms = contact.geoms
    distance, normal, bend, axis = measure(geoms, g, point)
    foot = (
        point[0] - distance * normal[0],
        point[1] - distance * normal[1],
        point[2] - distance * normal[2],
    )
    surface = _compute_surface_velocity(geoms, g, foot)
    gap = distance - contact.law[RADIUS]
    return gap, normal, (bend, axis), geoms[g, FRICTION], surface


@kernel
def is_skipped(contact, q, g):
    """Whether contact point q is on the part of the hose that does not touch geom g."""
    if g < 0:
        return False
    return contact.geoms[g, SKIP_FROM] <= contact.arcs[q] <= contact.geoms[g, SKIP_TO]


@kernel
def is_span_near(axes, contact, e, g, x):
    """Whether span e may touch geom g: its curve lies within the hull of four control points."""
    if g < 0:
        return True
    d = len(axes)
    start = e * d
    c0, c1, c2 = 0.0, 0.0, 0.0
    for i in range(4):
        c0 += 0.25 * x[start + i * d]
        c1 += 0.25 * x[start + i * d + 1]
        if d > 2:
            c2 += 0.25 * x[start + i * d + 2]
    square = 0.0
    for i in range(4):
        away = (x[start + i * d] - c0) ** 2 + (x[start + i * d + 1] - c1) ** 2
        if d > 2:
            away += (x[start + i * d + 2] - c2) ** 2
        square = max(square, away)
    reach = np.sqrt(square) + contact.law[RADIUS] + contact.law[WIDTH]
    return is_near(contact.geoms, g, (c0, c1, c2), reach)
