"""A hose that touches itself: a frictionless penalty between contact points and the polyline.

The contact points are joined to a polyline. Each is pushed away from every other stretch of it
that comes closer than two radii, by half of k max(0, S(g) - tau S'(g) u.n) per length at the place
nearest on it, where the same force acts the other way: linear and angular momentum are exact. The
other half comes from the other stretch's own points. Stretches nearer than `REACH` radii of arc,
either way round a closed loop, do not touch.

The matrix gets only the blocks on the band: how a force here depends on a place far along the hose
is left out. Newton's iteration then converges by k (1 + tau / h) over that plus rho / h^2 at each
turn, so k is tied to the time step: 2 rho / dt^2, tau = dt / 4, a factor of .55 with BDF2 and .71
with backward Euler at worst.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.contact import press, scatter
from hose_mj.hoses.geds.contact_law import (
    RADIUS,
    ROUND,
    SELF_DAMPING,
    SELF_STIFFNESS,
    WIDTH,
    evaluate,
    make_push,
)
from hose_mj.jit import inlined, kernel

REACH = 6.0
"""Arc between stretches that may touch, in radii."""


@kernel
def _load_places(axes, contact, per_span, x):  # type: ignore[no-untyped-def]
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
def _find_nearest(room, q, j):  # type: ignore[no-untyped-def]
    """Squared distance of contact point q from the segment from point j to j + 1; where on it."""
    square = 0.0
    along = 0.0
    for c in range(3):
        side = room[j + 1, c] - room[j, c]
        square += side * side
        along += side * (room[q, c] - room[j, c])
    t = min(max(along / max(square, 1e-300), 0.0), 1.0)
    distance = 0.0
    for c in range(3):
        near = room[j, c] + t * (room[j + 1, c] - room[j, c])
        distance += (room[q, c] - near) ** 2
    return distance, t


@kernel
def _are_spans_apart(contact, e, f):  # type: ignore[no-untyped-def]
    room = contact.room
    base = contact.points.shape[0]
    reach = room[base + e, 3] + room[base + f, 3] + 2.0 * contact.law[RADIUS] + contact.law[WIDTH]
    square = 0.0
    for c in range(3):
        square += (room[base + e, c] - room[base + f, c]) ** 2
    return square > reach * reach


@inlined
def add_self_contact(axes, contact, x, rate, step, gradient, band):  # type: ignore[no-untyped-def]
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
    touching = 0
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
                    touching += 1
    return touching


@kernel
def _push_apart(axes, contact, pair, rate, step, gradient, band):  # type: ignore[no-untyped-def]
    """One pair: contact point q and the place t on the segment from point j."""
    q, j, t, per_span = pair
    d = len(axes)
    room = contact.room
    points = contact.points
    n0 = room[q, 0] - (1.0 - t) * room[j, 0] - t * room[j + 1, 0]
    n1 = room[q, 1] - (1.0 - t) * room[j, 1] - t * room[j + 1, 1]
    n2 = room[q, 2] - (1.0 - t) * room[j, 2] - t * room[j + 1, 2]
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
        matrix = press(normal, length * abs(share) * stiffness)
        scatter(axes, points, at, start, force, matrix, gradient, band)
