"""Contact of the spline with rigid shapes: a smoothed penalty and smoothed Coulomb friction.

The force per length of contact_law.py acts at contact points spread over the spans, all of it taken
at the end of the stage. In the matrix stand the parts that leave it positive semidefinite: the
slope of N along n, and for friction mu N / (h s) (1 - n n^T - (w v^T + v w^T) / 2) with
s = sqrt(u_t^2 + eps^2), v = u_t / s and w the same at the stage's base: close to the true
derivative while the hose slides or sticks, and stiff where the slip turns over within a step (the
idea of Chan, Golub, Mulet 1999). With `exact` also the curvature of the shape, which softens. Left
out is how friction grows with N: it is not symmetric.

A hose that touches itself: a frictionless penalty between contact points and the polyline that
joins them. Each is pushed away from every other part of it that comes closer than two radii, by
half of k max(0, S(g) - tau S'(g) u.n) per length at the place nearest on it, where the same force
acts the other way: linear and angular momentum are exact. The other half comes from that part's own
points. Parts nearer than `REACH` radii of arc, either way round a closed loop, do not touch.

The matrix gets only the blocks on the band: how a force here depends on a place far along the hose
is left out. Newton's iteration then converges by k (1 + tau / h) over that plus rho / h^2 at each
turn, so k is tied to the time step: 2 rho / dt^2, tau = dt / 4, a factor of .55 with BDF2 and .71
with backward Euler at worst.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.contact_law import (
    DAMPING,
    RADIUS,
    ROUND,
    SELF_DAMPING,
    SELF_STIFFNESS,
    WIDTH,
    compute_force,
    compute_gap,
    evaluate,
    is_skipped,
    is_span_near,
    make_push,
)
from hose_mj.hoses.geds.shapes import POSITION, SCALE
from hose_mj.jit import compiled, inlined, kernel

REACH = 6.0
"""Arc between parts of a hose that may touch each other, in radii."""


@kernel
def _relate(velocity, surface):
    return velocity[0] - surface[0], velocity[1] - surface[1], velocity[2] - surface[2]


@inlined
def add_contact(axes, contact, x, rate, base, step, exact, gradient, band):
    """Adds contact to the residual and its matrix; returns how many contact points touch.

    Nine arguments, as in `energy.assemble`, which it follows.

    Args:
        axes: (0.0,) * d.
        contact: what may be touched.
        x: control points, flat.
        rate: their velocity.
        base: their velocity before the stage.
        step: the stage's length (s); where it is infinite (statics) nothing rubs.
        exact: whether the curvature of shapes enters the matrix.
        gradient: added to.
        band: added to.
    """
    n_contacts = 0
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
                if is_skipped(contact, q, g):
                    continue
                gap, normal, bend, friction, surface = compute_gap(axes, contact, q, g, start, x)
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
                n_contacts += 1
                matrix = _press(normal, slope * (1.0 + contact.law[DAMPING] / step))
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
                _scatter(axes, contact.points, q, start, force, matrix, gradient, band)
    return n_contacts


@kernel
def _scale3(c, v):
    return c * v[0], c * v[1], c * v[2]


@kernel
def _scale6(c, m):
    return c * m[0], c * m[1], c * m[2], c * m[3], c * m[4], c * m[5]


@kernel
def _press(n, stiffness):
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
def _soften(m, n, bend, N):
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
def _rub(m, n, v, w, c):
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
def _scatter(axes, points, q, start, force, m, gradient, band):
    """Adds a force at contact point q and its stiffness m to the span's unknowns."""
    d = len(axes)
    n_coordinates = len(axes[:3])
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
def compute_forces(axes, contact, x, v, forces, reactions):
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
                if is_skipped(contact, q, g):
                    continue
                gap, normal, _, friction, surface = compute_gap(axes, contact, q, g, start, x)
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


@kernel
def _load_places(axes, contact, per_span, x):
    """Writes the places of the contact points, then middle and radius of each span's ball."""
    d = len(axes)
    n_points = contact.points.shape[0]
    room = contact.room
    for q in range(n_points):
        y = evaluate(axes, contact.points, q, (q // per_span) * d, x)
        room[q, 0] = y[0]
        room[q, 1] = y[1]
        room[q, 2] = y[2]
    for e in range(n_points // per_span):
        first, last = e * per_span, min((e + 1) * per_span, n_points - 1)
        square = 0.0
        for c in range(3):
            middle = 0.5 * (room[first, c] + room[last, c])
            room[n_points + e, c] = middle
        for q in range(first, last + 1):
            away = 0.0
            for c in range(3):
                away += (room[q, c] - room[n_points + e, c]) ** 2
            square = max(square, away)
        room[n_points + e, 3] = np.sqrt(square)


@kernel
def _find_nearest(room, q, j):
    """Squared distance of contact point q from the segment from point j to j + 1; where on it."""
    square = 0.0
    along = 0.0
    for c in range(3):
        side = room[j + 1, c] - room[j, c]
        square += side * side
        along += side * (room[q, c] - room[j, c])
    # A segment without length is nearest at its start.
    t = min(max(along / max(square, 1e-300), 0.0), 1.0)
    distance = 0.0
    for c in range(3):
        near = room[j, c] + t * (room[j + 1, c] - room[j, c])
        distance += (room[q, c] - near) ** 2
    return distance, t


@kernel
def _are_spans_apart(contact, e, f):
    room = contact.room
    base = contact.points.shape[0]
    reach = room[base + e, 3] + room[base + f, 3] + 2.0 * contact.law[RADIUS] + contact.law[WIDTH]
    square = 0.0
    for c in range(3):
        square += (room[base + e, c] - room[base + f, c]) ** 2
    return square > reach * reach


@inlined
def add_self_contact(axes, contact, x, rate, step, gradient, band):
    """Adds the forces of a hose on itself to the residual and what is on the band to the matrix.

    Returns how many pairs touch. The cost grows with the square of the number of spans, and with
    that of the contact points where spans are near each other. Statics know no self-contact.
    """
    if contact.law[SELF_STIFFNESS] == 0.0 or step == np.inf:
        return 0
    n_spans = len(x) // len(axes) - 3
    per_span = contact.points.shape[0] // n_spans
    n_segments = contact.points.shape[0] - 1
    _load_places(axes, contact, per_span, x)
    room = contact.room
    n_contacts = 0
    for e in range(n_spans):
        for f in range(n_spans):
            if _are_spans_apart(contact, e, f):
                continue
            for q in range(e * per_span, (e + 1) * per_span):
                for j in range(f * per_span, min((f + 1) * per_span, n_segments)):
                    gap_in_arc = max(contact.arcs[j] - contact.arcs[q], 0.0)
                    gap_in_arc = max(gap_in_arc, contact.arcs[q] - contact.arcs[j + 1])
                    far = max(
                        contact.arcs[j + 1] - contact.arcs[q], contact.arcs[q] - contact.arcs[j]
                    )
                    gap_in_arc = min(gap_in_arc, contact.law[ROUND] - far)
                    if gap_in_arc < REACH * contact.law[RADIUS]:
                        continue
                    square, t = _find_nearest(room, q, j)
                    reach = 2.0 * contact.law[RADIUS] + contact.law[WIDTH]
                    if square >= reach * reach:
                        continue
                    # Of neighbouring segments only the nearest counts, the first where they tie.
                    if j > 0 and _find_nearest(room, q, j - 1)[0] <= square:
                        continue
                    if j + 1 < n_segments and _find_nearest(room, q, j + 1)[0] < square:
                        continue
                    _push_apart(axes, contact, (q, j, t, per_span), rate, step, gradient, band)
                    n_contacts += 1
    return n_contacts


@kernel
def _push_apart(axes, contact, pair, rate, step, gradient, band):
    """One pair: contact point q and the place t on the segment from point j."""
    q, j, t, per_span = pair
    d = len(axes)
    room = contact.room
    points = contact.points
    n0 = room[q, 0] - (1.0 - t) * room[j, 0] - t * room[j + 1, 0]
    n1 = room[q, 1] - (1.0 - t) * room[j, 1] - t * room[j + 1, 1]
    n2 = room[q, 2] - (1.0 - t) * room[j, 2] - t * room[j + 1, 2]
    # Centre lines that meet have no normal and do not push.
    distance = max(np.sqrt(n0 * n0 + n1 * n1 + n2 * n2), 1e-9)
    normal = (n0 / distance, n1 / distance, n2 / distance)
    start_q, start_j = (q // per_span) * d, (j // per_span) * d
    start_k = ((j + 1) // per_span) * d
    v = evaluate(axes, points, q, start_q, rate)
    a = evaluate(axes, points, j, start_j, rate)
    b = evaluate(axes, points, j + 1, start_k, rate)
    away = 0.0
    for c in range(3):
        away += normal[c] * (v[c] - (1.0 - t) * a[c] - t * b[c])
    push, slope = make_push(contact.law[WIDTH], distance - 2.0 * contact.law[RADIUS])
    damping = contact.law[SELF_DAMPING]
    N = 0.5 * contact.law[SELF_STIFFNESS] * max(push - damping * slope * away, 0.0)
    if N == 0.0:
        return
    stiffness = 0.5 * contact.law[SELF_STIFFNESS] * slope * (1.0 + damping / step)
    length = points[q, 4]
    for at, start, share in ((q, start_q, 1.0), (j, start_j, t - 1.0), (j + 1, start_k, -t)):
        weight = length * share
        force = (weight * N * normal[0], weight * N * normal[1], weight * N * normal[2])
        matrix = _press(normal, length * abs(share) * stiffness)
        _scatter(axes, points, at, start, force, matrix, gradient, band)
