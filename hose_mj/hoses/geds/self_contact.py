"""A hose that touches itself: a frictionless penalty between contact points and their polyline.

Each contact point is pushed away from every other part of the hose that comes closer than two
radii, by half of k max(0, S(g) - tau S'(g) u.n) per length at the place nearest on it, where the
same force acts the other way: linear and angular momentum are exact. The other half comes from that
part's own points. Parts nearer than `REACH` radii of arc, either way round a closed loop, do not
touch.

The matrix gets only the blocks on the band: how a force here depends on a place far along the hose
is left out. Newton's iteration then converges by k (1 + tau / h) over that plus rho / h^2 at each
turn, so k is tied to the time step: 2 rho / dt^2, tau = dt / 4, a factor of .55 with BDF2 and .71
with backward Euler at worst.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.contact_law import (
    CROSSINGS,
    RADIUS,
    ROUND,
    SELF_DAMPING,
    SELF_STIFFNESS,
    WIDTH,
    make_push,
)
from hose_mj.hoses.geds.touch import evaluate
from hose_mj.jit import apart, inlined, kernel

REACH = 6.0
"""Arc between parts of a hose that may touch each other, in radii."""


@kernel
def _load_places(axes, contact, x):
    """Writes the places of the contact points, then middle and radius of each span's ball."""
    n_points = contact.points.shape[0]
    room = contact.room
    n_spans = len(contact.first) - 1
    for e in range(n_spans):
        for q in range(contact.first[e], contact.first[e + 1]):
            y = evaluate(axes, contact.points, q, e * len(axes), x)
            room[q, 0] = y[0]
            room[q, 1] = y[1]
            room[q, 2] = y[2]
    for e in range(n_spans):
        first, last = contact.first[e], min(contact.first[e + 1], n_points - 1)
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


@apart
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
    reach = room[base + e, 3] + room[base + f, 3] + 2.0 * contact.law[RADIUS]
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
    n_spans = len(contact.first) - 1
    n_segments = contact.points.shape[0] - 1
    _load_places(axes, contact, x)
    for q in range(contact.points.shape[0]):
        contact.strands[q, 0] = -1.0
    room = contact.room
    n_contacts = 0
    for e in range(n_spans):
        for f in range(n_spans):
            if _are_spans_apart(contact, e, f):
                continue
            for q in range(contact.first[e], contact.first[e + 1]):
                for j in range(contact.first[f], min(contact.first[f + 1], n_segments)):
                    gap_in_arc = max(contact.arcs[j] - contact.arcs[q], 0.0)
                    gap_in_arc = max(gap_in_arc, contact.arcs[q] - contact.arcs[j + 1])
                    far = max(
                        contact.arcs[j + 1] - contact.arcs[q], contact.arcs[q] - contact.arcs[j]
                    )
                    gap_in_arc = min(gap_in_arc, contact.law[ROUND] - far)
                    if gap_in_arc < REACH * contact.law[RADIUS]:
                        continue
                    square, t = _find_nearest(room, q, j)
                    reach = 2.0 * contact.law[RADIUS]
                    if square >= reach * reach:
                        continue
                    # Of neighbouring segments only the nearest counts, the first where they tie.
                    if j > 0 and _find_nearest(room, q, j - 1)[0] <= square:
                        continue
                    if j + 1 < n_segments and _find_nearest(room, q, j + 1)[0] < square:
                        continue
                    pair = (q, j, t, e, f)
                    _push_apart(axes, contact, pair, rate, step, gradient, band)
                    n_contacts += 1
    return n_contacts


@apart
def _push_apart(axes, contact, pair, rate, step, gradient, band):
    """One pair: contact point q of span e and the place t on the segment from point j of f."""
    q, j, t, e, f = pair
    d = len(axes)
    room = contact.room
    points = contact.points
    n0 = room[q, 0] - (1.0 - t) * room[j, 0] - t * room[j + 1, 0]
    n1 = room[q, 1] - (1.0 - t) * room[j, 1] - t * room[j + 1, 1]
    n2 = room[q, 2] - (1.0 - t) * room[j, 2] - t * room[j + 1, 2]
    # Centre lines that meet have no normal and do not push.
    distance = max(np.sqrt(n0 * n0 + n1 * n1 + n2 * n2), 1e-9)
    normal = (n0 / distance, n1 / distance, n2 / distance)
    start_q, start_j = e * d, f * d
    start_k = (f + (j + 1 >= contact.first[f + 1])) * d
    v = evaluate(axes, points, q, start_q, rate)
    a = evaluate(axes, points, j, start_j, rate)
    b = evaluate(axes, points, j + 1, start_k, rate)
    away = 0.0
    for c in range(3):
        away += normal[c] * (v[c] - (1.0 - t) * a[c] - t * b[c])
    arc = (1.0 - t) * contact.arcs[j] + t * contact.arcs[j + 1]
    _note_strand(contact, q, arc, normal, distance)
    push, slope = make_push(contact.law[WIDTH], distance - 2.0 * contact.law[RADIUS])
    damping = contact.law[SELF_DAMPING]
    N = 0.5 * contact.law[SELF_STIFFNESS] * max(push - damping * slope * away, 0.0)
    if N == 0.0:
        return
    stiffness = 0.5 * contact.law[SELF_STIFFNESS] * slope * (1.0 + damping / step)
    length = points[q, 4]
    n, k = normal, stiffness
    across = (k * n[0] * n[0], k * n[1] * n[1], k * n[2] * n[2])
    mixed = (k * n[0] * n[1], k * n[0] * n[2], k * n[1] * n[2])
    rows = (
        (across[0], mixed[0], mixed[1]),
        (mixed[0], across[1], mixed[2]),
        (mixed[1], mixed[2], across[2]),
    )
    for at, start, share in ((q, start_q, 1.0), (j, start_j, t - 1.0), (j + 1, start_k, -t)):
        force = (length * share * N * n[0], length * share * N * n[1], length * share * N * n[2])
        _scatter(axes, points, at, start, force, (length * abs(share), rows), gradient, band)


@kernel
def _note_strand(contact, q, arc, normal, distance):
    """Remembers what is nearest to a contact point."""
    row = contact.strands
    if row[q, 0] < 0.0 or distance < row[q, 4]:
        row[q, 0], row[q, 4] = arc, distance
        for c in range(3):
            row[q, 1 + c] = normal[c]


@kernel
def accept_strands(contact):
    """Ends a step: a point that is now on the other side of what it met has passed through it."""
    row = contact.strands
    for q in range(row.shape[0]):
        near = REACH * contact.law[RADIUS]
        if row[q, 0] >= 0.0 and row[q, 5] >= 0.0 and abs(row[q, 0] - row[q, 5]) < near:
            along = 0.0
            for c in range(3):
                along += row[q, 1 + c] * row[q, 6 + c]
            if along < 0.0:
                contact.found[CROSSINGS] += 1.0
        row[q, 5] = row[q, 0]
        for c in range(3):
            row[q, 6 + c] = row[q, 1 + c]


@kernel
def _scatter(axes, points, q, start, force, stiffness, gradient, band):
    """Adds a force at contact point q and its stiffness, a factor and rows, to the unknowns."""
    d = len(axes)
    n_coordinates = len(axes[:3])
    factor, rows = stiffness
    for i in range(4):
        for c in range(n_coordinates):
            gradient[start + i * d + c] -= points[q, i] * force[c]
        for j in range(i + 1):
            weight = factor * points[q, i] * points[q, j]
            column = start + j * d
            for c1 in range(n_coordinates):
                for c2 in range(n_coordinates if j < i else c1 + 1):
                    band[column + c2, (i - j) * d + c1 - c2] += weight * rows[c1][c2]
