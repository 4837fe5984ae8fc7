"""Contact of the spline with rigid shapes: a smoothed penalty and smoothed Coulomb friction.

At contact points spread over the spans, with gap g = distance - radius, n the outward normal and
u the velocity of the hose relative to the surface, the force per length on the hose is

    N n - mu N u_t / sqrt(u_t^2 + eps^2),   N = k max(0, S(g) - tau S'(g) u.n),

S the C1 ramp of `ContactLaw` over k. All of it is taken at the end of the stage. In the matrix
stand the parts that leave it positive semidefinite: the slope of N along n, and for friction
mu N / (h s) (1 - n n^T - (w v^T + v w^T) / 2), s = sqrt(u_t^2 + eps^2), v = u_t / s and w the same
at the stage's base: close to the true derivative while the hose slides or sticks, and stiff where
the slip turns over within a step (the idea of Chan, Golub, Mulet 1999). With `exact` also the
curvature of the shape, which softens. Left out is how friction grows with N: it is not symmetric.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.compiled import compiled, kernel
from hose_mj.hoses.geds.shapes import FRICTION, POSITION, SCALE, SPIN, VELOCITY, is_near, measure
from hose_mj.hoses.model import Array

STIFFNESS, WIDTH, DAMPING, SLIP, RADIUS, TOLERANCE, SELF_STIFFNESS, SELF_DAMPING = range(8)
"""Places in `Contact.law`."""
GIVEN = 11
"""Columns of a distance handed in: distance, normal (3), friction, surface velocity (3) and the
place (3) of the contact point that it was measured at."""
_FLAT = ((0.0, 0.0), (0.0, 0.0, 0.0))


class Contact(NamedTuple):
    """What one hose may touch; coordinates of the hose come first, minus its plane's offset.

    Attributes:
        points: the four basis functions at each contact point and its share of arc length (m),
            (Q, 5), span after span, equally many in each.
        geoms: one row a shape, see shapes.py, (G, 25).
        given: distances handed in, one row a contact point, (Q, 11); (0, 11) for none.
        law: numbers of the contact law, (8,); no self-contact where its stiffness is 0.
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
def evaluate(axes, points, q, start, x):  # type: ignore[no-untyped-def]
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
def _find_surface_velocity(geoms, g, point):  # type: ignore[no-untyped-def]
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
def make_push(width, gap):  # type: ignore[no-untyped-def]
    """The ramp S of a gap (m) and its slope by the depth."""
    depth = max(width - gap, 0.0)
    if depth < 2.0 * width:
        return depth * depth / (4.0 * width), depth / (2.0 * width)
    return depth - width, 1.0


@kernel
def compute_force(law, scale, gap, normal, friction, velocity):  # type: ignore[no-untyped-def]
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
def find_gap(axes, contact, q, g, start, x):  # type: ignore[no-untyped-def]
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
    surface = _find_surface_velocity(geoms, g, foot)
    gap = distance - contact.law[RADIUS]
    return gap, normal, (bend, axis), geoms[g, FRICTION], surface


@kernel
def is_span_near(axes, contact, e, g, x):  # type: ignore[no-untyped-def]
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


@kernel
def _relate(velocity, surface):  # type: ignore[no-untyped-def]
    return velocity[0] - surface[0], velocity[1] - surface[1], velocity[2] - surface[2]


@kernel
def add_contact(axes, contact, x, rate, base, step, exact, gradient, band):  # type: ignore[no-untyped-def]
    """Adds contact to the residual and its matrix; returns how many contact points touch.

    Nine arguments, as in `energy.assemble`, which it follows.

    Args:
        axes: (0.0,) * d.
        contact: what may be touched.
        x: control points, flat; rate: their velocity; base: their velocity before the stage.
        step: the stage's length (s); where it is infinite (statics) nothing rubs.
        exact: whether the curvature of shapes enters the matrix.
        gradient, band: added to.
    """
    touching = 0
    d = len(axes)
    n_spans = len(x) // d - 3
    per_span = contact.points.shape[0] // n_spans
    first = -1 if contact.given.shape[0] > 0 else 0
    for e in range(n_spans):
        start = e * d
        for g in range(first, contact.geoms.shape[0]):
            if not is_span_near(axes, contact, e, g, x):
                continue
            for q in range(e * per_span, (e + 1) * per_span):
                gap, normal, bend, friction, surface = find_gap(axes, contact, q, g, start, x)
                if gap >= contact.law[WIDTH]:
                    continue
                velocity = evaluate(axes, contact.points, q, start, rate)
                if step == np.inf:
                    velocity = surface
                relative = _relate(velocity, surface)
                scale = contact.geoms[g, SCALE] if g >= 0 else 1.0
                force, N, slope, slip, s = compute_force(
                    contact.law, scale, gap, normal, friction, relative
                )
                if N == 0.0:
                    continue
                touching += 1
                matrix = press(normal, slope * (1.0 + contact.law[DAMPING] / step))
                if exact:
                    matrix = _soften(matrix, normal, bend, N)
                if friction > 0.0 and step < np.inf:
                    before = _relate(evaluate(axes, contact.points, q, start, base), surface)
                    _, _, _, usual, _ = compute_force(
                        contact.law, scale, gap, normal, friction, before
                    )
                    matrix = _rub(matrix, normal, slip, usual, friction * N / (step * s))
                share = contact.points[q, 4]
                force, matrix = _scale3(share, force), _scale6(share, matrix)
                scatter(axes, contact.points, q, start, force, matrix, gradient, band)
    return touching


@kernel
def _scale3(c, v):  # type: ignore[no-untyped-def]
    return c * v[0], c * v[1], c * v[2]


@kernel
def _scale6(c, m):  # type: ignore[no-untyped-def]
    return c * m[0], c * m[1], c * m[2], c * m[3], c * m[4], c * m[5]


@kernel
def press(n, stiffness):  # type: ignore[no-untyped-def]
    """stiffness n n^T as (00, 11, 22, 01, 02, 12)."""
    return (
        stiffness * n[0] * n[0],
        stiffness * n[1] * n[1],
        stiffness * n[2] * n[2],
        stiffness * n[0] * n[1],
        stiffness * n[0] * n[2],
        stiffness * n[1] * n[2],
    )


@kernel
def _soften(m, n, bend, N):  # type: ignore[no-untyped-def]
    """Subtracts N times the Hessian of the distance."""
    (across, along), a = bend
    c = N * across
    r = N * (along - across)
    return (
        m[0] - c * (1.0 - n[0] * n[0]) - r * a[0] * a[0],
        m[1] - c * (1.0 - n[1] * n[1]) - r * a[1] * a[1],
        m[2] - c * (1.0 - n[2] * n[2]) - r * a[2] * a[2],
        m[3] + c * n[0] * n[1] - r * a[0] * a[1],
        m[4] + c * n[0] * n[2] - r * a[0] * a[2],
        m[5] + c * n[1] * n[2] - r * a[1] * a[2],
    )


@kernel
def _rub(m, n, v, w, c):  # type: ignore[no-untyped-def]
    """Adds c (1 - n n^T - (v w^T + w v^T) / 2)."""
    return (
        m[0] + c * (1.0 - n[0] * n[0] - v[0] * w[0]),
        m[1] + c * (1.0 - n[1] * n[1] - v[1] * w[1]),
        m[2] + c * (1.0 - n[2] * n[2] - v[2] * w[2]),
        m[3] - c * (n[0] * n[1] + 0.5 * (v[0] * w[1] + v[1] * w[0])),
        m[4] - c * (n[0] * n[2] + 0.5 * (v[0] * w[2] + v[2] * w[0])),
        m[5] - c * (n[1] * n[2] + 0.5 * (v[1] * w[2] + v[2] * w[1])),
    )


@kernel
def scatter(axes, points, q, start, force, m, gradient, band):  # type: ignore[no-untyped-def]
    """Adds a force at contact point q and its stiffness m to the span's unknowns."""
    d = len(axes)
    n_coordinates = min(d, 3)
    rows = ((m[0], m[3], m[4]), (m[3], m[1], m[5]), (m[4], m[5], m[2]))
    for i in range(4):
        for c in range(n_coordinates):
            gradient[start + i * d + c] -= points[q, i] * force[c]
        for j in range(i + 1):
            weight = points[q, i] * points[q, j]
            column = start + j * d
            for c1 in range(n_coordinates):
                for c2 in range(n_coordinates if j < i else c1 + 1):
                    band[column + c2, (i - j) * d + c1 - c2] += weight * rows[c1][c2]


@compiled
def compute_forces(axes, contact, x, v, forces, reactions):  # type: ignore[no-untyped-def]
    """Contact forces at the state (x, v), flat.

    Writes the force on the hose at each contact point (Q, 3), N, and what the hose does to each
    geom, (G, 6): force (N) and moment about the geom's position (N m), of forces that act at the
    hose's centre line. In the hose's coordinates.
    """
    d = len(axes)
    n_spans = len(x) // d - 3
    per_span = contact.points.shape[0] // n_spans
    first = -1 if contact.given.shape[0] > 0 else 0
    forces[:, :] = 0.0
    reactions[:, :] = 0.0
    for g in range(first, contact.geoms.shape[0]):
        for e in range(n_spans):
            start = e * d
            if not is_span_near(axes, contact, e, g, x):
                continue
            for q in range(e * per_span, (e + 1) * per_span):
                gap, normal, _, friction, surface = find_gap(axes, contact, q, g, start, x)
                velocity = evaluate(axes, contact.points, q, start, v)
                relative = _relate(velocity, surface)
                scale = contact.geoms[g, SCALE] if g >= 0 else 1.0
                force = compute_force(contact.law, scale, gap, normal, friction, relative)[0]
                weight = contact.points[q, 4]
                for c in range(3):
                    forces[q, c] += weight * force[c]
                if g < 0:
                    continue
                point = evaluate(axes, contact.points, q, start, x)
                for c in range(3):
                    c1, c2 = (c + 1) % 3, (c + 2) % 3
                    arm1 = point[c1] - contact.geoms[g, POSITION + c1]
                    arm2 = point[c2] - contact.geoms[g, POSITION + c2]
                    reactions[g, c] -= weight * force[c]
                    reactions[g, 3 + c] -= weight * (arm1 * force[c2] - arm2 * force[c1])
