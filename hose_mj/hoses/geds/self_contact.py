"""A hose that touches itself: contact points against the curve of its other parts, with friction.

Each contact point is pushed away from every other part of the hose that comes closer than two
radii, and rubs on it, by half of the law of contact_law.py. That is at the place nearest on its
curve, where the same force acts the other way: linear momentum is exact, angular momentum but for
the arm of friction, two radii. The other half comes from that part's own points. Between two
contact points the curve is the cubic of their places and slopes; on chords instead strands in a
knot would cog. Parts nearer than `REACH` radii of arc, either way round a closed loop, do not
touch.

How a force here depends on a place far along the hose has no room in the band of the matrix. Each
pair is a soft row beside those of the twist (kkt.py): Newton's method has its whole derivative.

A distance between curves has no sign. What was near remembers on which side it was: a point that
went through is pushed back to where it came from.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.contact_law import (
    CROSSINGS,
    DAMPING,
    DEEPEST,
    HARDENING,
    IMPACTS,
    PAIRS,
    RADIUS,
    ROUND,
    SELF_FRICTION,
    SELF_SCALE,
    SELF_WIDTH,
    SIGHT,
    STICK,
    STIFFNESS,
    make_push,
    rub,
)
from hose_mj.hoses.geds.touch import IMPACT, evaluate
from hose_mj.jit import apart, kernel

REACH = 6.0
"""Arc between parts of a hose that may touch each other, in radii."""
_NEAR = 4.0
"""Distance of centre lines within which sides are remembered, in radii: twice that of touch. What
is fast is seen from farther away."""
_THROUGH = 1.0
"""A way between two steps that comes so near (in radii) and ends on the other side went through."""
_LOOKS = 8
"""Newton steps, kept within their bracket, to the nearest place of a cubic: three are the rule."""
_MOVE = 0.5
"""Newton's steps change what is near by so many radii at most: beyond, its sides are not known."""
_HARDEST = 5.0
"""Half a radius deep, where no force that the hose bears comes to, the law hardens no more: strands
that are laid into each other are pushed apart and not flung."""
_NO_EFFECT = 1e200
"""Compliance of a row without effect (m/N)."""
MATES = 2
"""Parts of the hose whose side and friction a contact point remembers at once: those on both sides
in a coil."""
MATE_ROW = 47
"""Columns of `Contact.mates`: point, its span, span and arc of the place, signed distance, normal
(3), the five basis values of the place, tangent there (3), slot in memory, force per length (3), up
to three directions (3, 3), their stiffness per length (3), normal force per length, how far
friction is drawn (3), the direction across normal and tangent (3), by how much a turn of the normal
softens there per length, derivatives of the basis values (5), |r'| there, and how fast d.r' falls
along the place, |r'|^2 - d.r''."""
_POINT, _SPAN, _OTHER, _ARC, _DISTANCE, _NORMAL, _BASIS, _TANGENT = 0, 1, 2, 3, 4, 5, 8, 13
_SLOT, _FORCE, _WAYS, _STIFF, _PRESSED, _DRAWN = 16, 17, 20, 29, 32, 33
_BINORMAL, _TURN, _CHANGES, _STRETCH, _FALL = 36, 39, 40, 45, 46
STRAND_ROW = 8
"""Columns of `Contact.strands`: arc of the place (-1 for none), normal (3), signed distance, and
how far friction is drawn (3)."""


@kernel
def _load_places(axes, contact, x):
    """Writes places and slopes of the contact points, then middle and radius of spans' balls."""
    n_points = contact.points.shape[0]
    room = contact.room
    n_spans = len(contact.first) - 1
    for e in range(n_spans):
        for q in range(contact.first[e], contact.first[e + 1]):
            y = evaluate(axes, contact.points, q, e * len(axes), x)
            slope = evaluate(axes, contact.changes, q, e * len(axes), x)
            for c in range(3):
                room[q, c], room[q, 3 + c] = y[c], slope[c]
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


@kernel
def _find_sight(contact):
    return max(contact.found[SIGHT], _NEAR * contact.law[RADIUS])


@kernel
def _set_sight(axes, contact, state):
    """Sees as far as parts of the hose may come to each other in two steps like the last one."""
    d, n = len(axes), len(state.x) // len(axes)
    largest = 0.0
    for i in range(n):
        square = 0.0
        for c in range(len(axes[:3])):
            k = i * d + c
            drift = (state.x[c] - state.x_old[c] + state.x[(n - 1) * d + c]) * 0.5
            drift -= 0.5 * state.x_old[(n - 1) * d + c]
            square += (state.x[k] - state.x_old[k] - drift) ** 2
        largest = max(largest, square)
    contact.found[SIGHT] = _NEAR * contact.law[RADIUS] + 4.0 * np.sqrt(largest)


@kernel
def _are_spans_apart(contact, e, f):
    room = contact.room
    base = contact.points.shape[0]
    reach = room[base + e, 3] + room[base + f, 3] + _find_sight(contact)
    square = 0.0
    for c in range(3):
        square += (room[base + e, c] - room[base + f, c]) ** 2
    return square > reach * reach


@apart
def _find_pairs(axes, contact, x):
    """Writes into `mates` what is nearest to each contact point; returns how many pairs there are.

    More than there is room for are counted, but not written.
    """
    n_spans, n_pairs = len(contact.first) - 1, 0
    _load_places(axes, contact, x)
    for e in range(n_spans):
        for f in range(n_spans):
            if _are_spans_apart(contact, e, f):
                continue
            for q in range(contact.first[e], contact.first[e + 1]):
                n_pairs = _look_along(contact, q, e, f, n_pairs)
    contact.found[PAIRS] = n_pairs
    return min(n_pairs, contact.mates.shape[0])


@kernel
def _look_along(contact, q, e, f, n_pairs):
    """Looks for the places on span f that are nearest to point q of span e."""
    room, arcs, radius = contact.room, contact.arcs, contact.law[RADIUS]
    n_segments = contact.points.shape[0] - 1
    first, last = contact.first[f], min(contact.first[f + 1], n_segments)
    after = _measure_rise(room, q, first)
    for j in range(first, last):
        before = after
        after = _measure_rise(room, q, j + 1)
        # The distance falls into an interval and rises out of it, or ends with the hose.
        inside = before < 0.0 <= after
        tip = (j == 0 and before >= 0.0) or (j == n_segments - 1 and after < 0.0)
        if not inside and (not tip or contact.law[ROUND] < np.inf):
            continue
        gap_in_arc = max(arcs[j] - arcs[q], arcs[q] - arcs[j + 1])
        far = max(arcs[j + 1] - arcs[q], arcs[q] - arcs[j])
        gap_in_arc = min(gap_in_arc, contact.law[ROUND] - far)
        if gap_in_arc < REACH * radius:
            continue
        t = 0.0 if before >= 0.0 else 1.0
        if inside:
            t = _find_nearest(room, q, j, arcs[j + 1] - arcs[j])
        n_pairs = _note_pair(contact, (q, j, e, f), t, n_pairs)
    return n_pairs


@kernel
def _measure_rise(room, q, j):
    """How fast the squared distance from point q grows along the hose at point j, halved."""
    rise = 0.0
    for c in range(3):
        rise += (room[j, c] - room[q, c]) * room[j, 3 + c]
    return rise


@kernel
def _make_cubic(t, length):
    """Weights of place, slope, next place and next slope at t of an interval; their derivatives."""
    u = 1.0 - t
    value = (
        (1.0 + 2.0 * t) * u * u,
        length * t * u * u,
        t * t * (3.0 - 2.0 * t),
        -length * t * t * u,
    )
    slope = (-6.0 * t * u, length * u * (1.0 - 3.0 * t), 6.0 * t * u, length * t * (3.0 * t - 2.0))
    curve = (12.0 * t - 6.0, length * (6.0 * t - 4.0), 6.0 - 12.0 * t, length * (6.0 * t - 2.0))
    return value, slope, curve


@kernel
def _mix(room, j, weights, c):
    """A coordinate of a cubic between points j and j + 1."""
    along = weights[0] * room[j, c] + weights[1] * room[j, 3 + c]
    return along + weights[2] * room[j + 1, c] + weights[3] * room[j + 1, 3 + c]


@kernel
def _find_nearest(room, q, j, length):
    """Where between points j and j + 1 the curve is nearest to point q, 0 to 1."""
    low, high, t = 0.0, 1.0, 0.5
    for _ in range(_LOOKS):
        value, slope, curve = _make_cubic(t, length)
        rise, bend = 0.0, 0.0
        for c in range(3):
            away, along = _mix(room, j, value, c) - room[q, c], _mix(room, j, slope, c)
            rise += away * along
            bend += along * along + away * _mix(room, j, curve, c)
        if rise < 0.0:
            low = t
        else:
            high = t
        step = rise / bend if bend > 0.0 else np.inf
        if abs(step) < 1e-12:  # of the interval: rounding
            break
        t -= step
        if not low < t < high:
            t = 0.5 * (low + high)
    return t


@kernel
def _note_pair(contact, names, t, n_pairs):
    """Writes one pair where it is near; returns how many there are now."""
    q, j, e, f = names
    room = contact.room
    length = contact.arcs[j + 1] - contact.arcs[j]
    value, slope, curve = _make_cubic(t, length)
    d0 = room[q, 0] - _mix(room, j, value, 0)
    d1 = room[q, 1] - _mix(room, j, value, 1)
    d2 = room[q, 2] - _mix(room, j, value, 2)
    # Centre lines that meet have no normal and do not push.
    distance = max(np.sqrt(d0 * d0 + d1 * d1 + d2 * d2), 1e-9)
    if distance >= _find_sight(contact):
        return n_pairs
    if n_pairs >= contact.mates.shape[0]:
        return n_pairs + 1
    row = contact.mates[n_pairs]
    row[_POINT], row[_SPAN], row[_OTHER] = q, e, f
    row[_ARC] = contact.arcs[j] + t * length
    row[_SLOT] = _find_slot(contact, q, row[_ARC])
    side = _find_side(contact, q, int(row[_SLOT]), (d0, d1, d2))
    row[_DISTANCE], scale = side * distance, side / distance
    row[_NORMAL], row[_NORMAL + 1], row[_NORMAL + 2] = scale * d0, scale * d1, scale * d2
    stretch, bend = 0.0, 0.0
    for c in range(3):
        row[_TANGENT + c] = _mix(room, j, slope, c) / length
        stretch += row[_TANGENT + c] ** 2
        bend += row[_NORMAL + c] * _mix(room, j, curve, c) / (length * length)
    row[_STRETCH], row[_FALL] = np.sqrt(max(stretch, 1e-300)), stretch - row[_DISTANCE] * bend
    later = 1 if j + 1 >= contact.first[f + 1] else 0
    for c in range(5):
        row[_BASIS + c] = row[_CHANGES + c] = 0.0
    for c in range(3):
        row[_TANGENT + c] /= row[_STRETCH]
    for c in range(4):
        here, there = contact.points[j, c], contact.points[j + 1, c]
        turn, next_turn = contact.changes[j, c], contact.changes[j + 1, c]
        row[_BASIS + c] += value[0] * here + value[1] * turn
        row[_BASIS + later + c] += value[2] * there + value[3] * next_turn
        row[_CHANGES + c] += (slope[0] * here + slope[1] * turn) / length
        row[_CHANGES + later + c] += (slope[2] * there + slope[3] * next_turn) / length
    return n_pairs + 1


@kernel
def _find_slot(contact, q, arc):
    """Where point q remembers the part of the hose at an arc length; -1 for nowhere."""
    for slot in range(MATES):
        known = contact.strands[q, slot, 0]
        if known >= 0.0 and abs(known - arc) < REACH * contact.law[RADIUS]:
            return slot
    return -1


@kernel
def _find_side(contact, q, slot, away):
    """-1.0 where a point has come through the part that it is away from, else 1.0."""
    if slot < 0:
        return 1.0
    row = contact.strands[q, slot]
    along, way, back = 0.0, 0.0, 0.0
    for c in range(3):
        start = row[1 + c] * row[4]
        along += row[1 + c] * away[c]
        way += (away[c] - start) ** 2
        back -= (away[c] - start) * start
    if along >= 0.0:
        return 1.0
    if row[4] < 0.0:
        return -1.0
    t = min(max(back / max(way, 1e-300), 0.0), 1.0)
    square = 0.0
    for c in range(3):
        start = row[1 + c] * row[4]
        square += (start + t * (away[c] - start)) ** 2
    return -1.0 if square < (_THROUGH * contact.law[RADIUS]) ** 2 else 1.0


@kernel
def _differ(axes, contact, k, x):
    """What the point of pair k has more of a field x, flat, than the place that it is near."""
    d = len(axes)
    row = contact.mates[k]
    q, start = int(row[_POINT]), int(row[_OTHER]) * d
    here = evaluate(axes, contact.points, q, int(row[_SPAN]) * d, x)
    there = (0.0, 0.0, 0.0)
    last = 5 if row[_BASIS + 4] != 0.0 else 4
    for i in range(last):
        weight, at = row[_BASIS + i], start + i * d
        z = weight * x[at + 2] if d > 2 else 0.0
        there = (there[0] + weight * x[at], there[1] + weight * x[at + 1], there[2] + z)
    return here[0] - there[0], here[1] - there[1], here[2] - there[2]


@apart
def _compute_pair(contact, k, distance, n, moved, away, step):
    """Force of a pair per length, at half the law.

    Args:
        contact: with the pair.
        k: its number.
        distance: of the centre lines, signed (m).
        n: normal (3,).
        moved: since the beginning of the step (3,), m.
        away: speed at which they part (m/s).
        step: length of the stage (s).

    Returns:
        force (3,), normal force, its slope, what of z is left (3,), direction of the slide (3,) and
        the stiffness across it.
    """
    law = contact.law
    push, slope = make_push(law[SELF_WIDTH], distance - 2.0 * law[RADIUS])
    harder = push / law[HARDENING]
    stiffness = 0.5 * law[SELF_SCALE] * law[STIFFNESS]
    if harder < _HARDEST:
        slope *= stiffness * (1.0 + 3.0 * harder * harder)
    else:
        harder = _HARDEST
        slope *= stiffness * (1.0 + harder * harder)
    N = stiffness * push * (1.0 + harder * harder) - law[DAMPING] * slope * away
    zero = (0.0, 0.0, 0.0)
    if N <= 0.0:
        return zero, 0.0, 0.0, zero, zero, 0.0
    force = (N * n[0], N * n[1], N * n[2])
    if law[SELF_FRICTION] == 0.0 or step == np.inf:
        return force, N, slope, zero, zero, 0.0
    z, slot = moved, int(contact.mates[k, _SLOT])
    if slot >= 0:
        m = contact.strands[int(contact.mates[k, _POINT]), slot]
        z = (z[0] + m[5], z[1] + m[6], z[2] + m[7])
    up = z[0] * n[0] + z[1] * n[1] + z[2] * n[2]
    z = (z[0] - up * n[0], z[1] - up * n[1], z[2] - up * n[2])
    stick = 0.5 * law[SELF_SCALE] * law[STICK]
    held, left, slide, across = rub(stick, law[SELF_FRICTION] * N, z)
    force = (force[0] + held[0], force[1] + held[1], force[2] + held[2])
    return force, N, slope, left, slide, across


@kernel
def _evaluate_pair(axes, contact, k, rate, x, start, step):
    """`_compute_pair` at the places where the pairs were looked for."""
    row = contact.mates[k]
    n = (row[_NORMAL], row[_NORMAL + 1], row[_NORMAL + 2])
    v, now = _differ(axes, contact, k, rate), _differ(axes, contact, k, x)
    was = _differ(axes, contact, k, start)
    away = v[0] * n[0] + v[1] * n[1] + v[2] * n[2] if step < np.inf else 0.0
    moved = (now[0] - was[0], now[1] - was[1], now[2] - was[2])
    return _compute_pair(contact, k, row[_DISTANCE], n, moved, away, step)


@apart
def add_self_contact(axes, contact, x, step, exact, work):
    """Adds the forces of a hose on itself to work.gradient and their derivative to work.soft.

    Args:
        axes: (0.0,) * d.
        contact: its law and contact points; `mates` is written.
        x: control points, flat; their velocity is in work.rate.
        step: length of the stage (s).
        exact: whether what softens enters the matrix.
        work: work arrays.
    """
    soft = work.soft
    soft.used[0] = soft.used[1] = 0
    n_pairs = _find_pairs(axes, contact, x)
    for k in range(n_pairs):
        row = contact.mates[k]
        answer = _evaluate_pair(axes, contact, k, work.rate, x, work.start, step)
        force, N, slope, left, slide, across = answer
        for c in range(3):
            row[_STIFF + c], row[_FORCE + c], row[_DRAWN + c] = 0.0, force[c], left[c]
            row[_WAYS + c] = row[_NORMAL + c]
        row[_PRESSED], row[_TURN] = N, 0.0
        if N == 0.0:
            continue
        row[_STIFF] = slope * (1.0 + contact.law[DAMPING] / step)
        if across > 0.0:
            _set_sideways(row, slide, across)
        share = contact.points[int(row[_POINT]), 4]
        _scatter(axes, contact, row, share, (force[0], force[1], force[2]), work.gradient)
        for way in range(3):
            if row[_STIFF + way] > 0.0:
                _add_row(axes, contact, row, way, share, work)
        # Statics go on without: a knot without friction slides along its rope, and nothing but the
        # lattice decides where it stops.
        if exact and step < np.inf and soft.used[0] + 3 <= soft.rows.shape[0]:
            _add_turn(axes, contact, row, share, work)
    if step == np.inf:
        # No steps tell where strands come from: each iteration goes on from the one before.
        _remember_all(contact, n_pairs)


@kernel
def _set_sideways(row, slide, across):
    """Writes the directions in which friction is stiff: along the surface, but for a slide's."""
    n0, n1, n2 = row[_NORMAL], row[_NORMAL + 1], row[_NORMAL + 2]
    e0, e1, e2 = slide
    row[_STIFF + 1] = across
    if e0 == 0.0 and e1 == 0.0 and e2 == 0.0:
        # Along the other strand and across it.
        e0, e1, e2 = row[_TANGENT], row[_TANGENT + 1], row[_TANGENT + 2]
        up = n0 * e0 + n1 * e1 + n2 * e2
        e0, e1, e2 = e0 - up * n0, e1 - up * n1, e2 - up * n2
        size = np.sqrt(max(e0 * e0 + e1 * e1 + e2 * e2, 1e-300))
        e0, e1, e2 = e0 / size, e1 / size, e2 / size
        row[_STIFF + 2] = across
        row[_WAYS + 6], row[_WAYS + 7], row[_WAYS + 8] = e0, e1, e2
    row[_WAYS + 3] = n1 * e2 - n2 * e1
    row[_WAYS + 4] = n2 * e0 - n0 * e2
    row[_WAYS + 5] = n0 * e1 - n1 * e0


@kernel
def _scatter(axes, contact, row, share, way, target):
    """Subtracts a vector (3,) at a pair's point, less the same at its place, from a field."""
    d = len(axes)
    q = int(row[_POINT])
    first, second = int(row[_SPAN]) * d, int(row[_OTHER]) * d
    for c in range(len(axes[:3])):
        for i in range(4):
            target[first + i * d + c] -= share * contact.points[q, i] * way[c]
        for i in range(5):
            weight = share * row[_BASIS + i] * way[c]
            if weight != 0.0:
                target[second + i * d + c] += weight


@kernel
def _add_row(axes, contact, row, way, share, work):
    """Adds one direction of a pair to the matrix: as a soft row, or more where there is no room.

    What two masses on a spring add to their matrix is at most twice what they would if the other
    one stood still.
    """
    soft = work.soft
    k, at = soft.used[0], _WAYS + 3 * way
    direction = (row[at], row[at + 1], row[at + 2])
    stiffness = share * row[_STIFF + way]
    if k < soft.rows.shape[0]:
        _add_soft(axes, contact, row, direction, stiffness, work)
        return
    points, q = contact.points, int(row[_POINT])
    for i in range(5):
        for j in range(i + 1):
            if i < 4:
                own = 2.0 * stiffness * points[q, i] * points[q, j]
                _add_block(axes, work.band, int(row[_SPAN]), (i, j), direction, own)
            other = 2.0 * stiffness * row[_BASIS + i] * row[_BASIS + j]
            if i - j < 4 and other != 0.0:
                _add_block(axes, work.band, int(row[_OTHER]), (i, j), direction, other)


@kernel
def _add_turn(axes, contact, row, share, work):
    """Adds what comes of the turn of a push with its normal: -N times the distance's Hessian.

    With d from place to point, D = |d|, t the place's tangent, b = n x t and u the difference of
    the displacements of point and place, that Hessian is [(b.u)^2 + (t.u)^2] / D - [n.r' + |r'| t.u
    / D]^2 D / (|r'|^2 - d.r''): the nearest place goes along.
    """
    n = (row[_NORMAL], row[_NORMAL + 1], row[_NORMAL + 2])
    t = (row[_TANGENT], row[_TANGENT + 1], row[_TANGENT + 2])
    b = (n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0])
    row[_BINORMAL], row[_BINORMAL + 1], row[_BINORMAL + 2] = b
    # Near the middle of the other strand the normal turns by any angle.
    distance = max(row[_DISTANCE], contact.law[RADIUS])
    row[_TURN] = -row[_PRESSED] / distance
    _add_soft(axes, contact, row, b, share * row[_TURN], work)
    _add_soft(axes, contact, row, t, share * row[_TURN], work)
    part = row[_STRETCH] / distance
    # Below, the strand bends round the point, or is crushed to nothing.
    fall = max(row[_FALL], 0.1 * max(row[_STRETCH], 0.1) ** 2)
    stiffness = share * row[_PRESSED] * distance / fall
    way = (part * t[0], part * t[1], part * t[2])
    soft, d = work.soft, len(axes)
    k = soft.used[0]
    _add_soft(axes, contact, row, way, stiffness, work)
    for i in range(5):
        for c in range(len(axes[:3])):
            if row[_CHANGES + i] != 0.0:
                soft.rows[k, (int(row[_OTHER]) + i) * d + c] -= row[_CHANGES + i] * n[c]


@kernel
def drop_softening(soft):
    """Leaves rows with D < 0 out of the matrix."""
    for k in range(soft.used[0]):
        if soft.compliance[k] < 0.0:
            soft.compliance[k] = _NO_EFFECT
    soft.used[1] = 0


@kernel
def _add_soft(axes, contact, row, direction, stiffness, work):
    """Adds a soft row: what a pair's point moves more than its place along a direction."""
    soft, k = work.soft, work.soft.used[0]
    soft.rows[k, :] = 0.0
    _scatter(axes, contact, row, 1.0, direction, soft.rows[k])
    soft.compliance[k] = 1.0 / stiffness
    soft.used[0] += 1
    if stiffness < 0.0:
        soft.used[1] += 1


@kernel
def _add_block(axes, band, e, places, direction, weight):
    """Adds weight n n^T between two control points to a band's lower half."""
    d = len(axes)
    i, j = places
    n_coordinates = len(axes[:3])
    for c1 in range(n_coordinates):
        for c2 in range(n_coordinates if j < i else c1 + 1):
            entry = weight * direction[c1] * direction[c2]
            band[(e + j) * d + c2, (i - j) * d + c1 - c2] += entry


@apart
def limit_move(axes, contact, step):
    """The factor, 1 at most, at which no pair of the last build moves too far by a Newton step."""
    largest = 0.0
    for k in range(min(int(contact.found[PAIRS]), contact.mates.shape[0])):
        move = _differ(axes, contact, k, step)
        largest = max(largest, move[0] * move[0] + move[1] * move[1] + move[2] * move[2])
    return min(1.0, _MOVE * contact.law[RADIUS] / max(np.sqrt(largest), 1e-300))


@apart
def measure_self_left(axes, contact, x, step, work):
    """Sum over the pairs of the last build of |force at x - its linear model|, N.

    Infinite where there were more pairs than room for them.
    """
    if contact.found[PAIRS] > contact.mates.shape[0]:
        return np.inf
    left = 0.0
    for k in range(int(contact.found[PAIRS])):
        row = contact.mates[k]
        now, v = _differ(axes, contact, k, x), _differ(axes, contact, k, work.rate)
        was = _differ(axes, contact, k, work.start)
        # The nearest place goes along with what moves along the curve.
        along = now[0] * row[_TANGENT] + now[1] * row[_TANGENT + 1] + now[2] * row[_TANGENT + 2]
        n = (
            now[0] - along * row[_TANGENT],
            now[1] - along * row[_TANGENT + 1],
            now[2] - along * row[_TANGENT + 2],
        )
        distance = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        up = n[0] * row[_NORMAL] + n[1] * row[_NORMAL + 1] + n[2] * row[_NORMAL + 2]
        distance = max(distance, 1e-9) if up >= 0.0 else -max(distance, 1e-9)
        n = (n[0] / distance, n[1] / distance, n[2] / distance)
        away = v[0] * n[0] + v[1] * n[1] + v[2] * n[2] if step < np.inf else 0.0
        moved = (now[0] - was[0], now[1] - was[1], now[2] - was[2])
        force = _compute_pair(contact, k, distance, n, moved, away, step)[0]
        # Within a pair's row: the linear model about where it was found.
        d0 = now[0] - row[_DISTANCE] * row[_NORMAL]
        d1 = now[1] - row[_DISTANCE] * row[_NORMAL + 1]
        d2 = now[2] - row[_DISTANCE] * row[_NORMAL + 2]
        r = (force[0] - row[_FORCE], force[1] - row[_FORCE + 1], force[2] - row[_FORCE + 2])
        for way in range(3):
            at, k_way = _WAYS + 3 * way, row[_STIFF + way]
            if k_way > 0.0:
                f = k_way * (row[at] * d0 + row[at + 1] * d1 + row[at + 2] * d2)
                r = (r[0] + f * row[at], r[1] + f * row[at + 1], r[2] + f * row[at + 2])
        if row[_TURN] < 0.0:
            at = _BINORMAL
            f = row[_TURN] * (row[at] * d0 + row[at + 1] * d1 + row[at + 2] * d2)
            r = (r[0] + f * row[at], r[1] + f * row[at + 1], r[2] + f * row[at + 2])
        share = contact.points[int(row[_POINT]), 4]
        left += share * np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    return left


@apart
def accept_self_contact(axes, contact, state, step):
    """Ends a step of `step` (s): remembers sides and friction, counts impacts and crossings."""
    law, found = contact.law, contact.found
    if step < np.inf:
        _set_sight(axes, contact, state)
    n_pairs = _find_pairs(axes, contact, state.x)
    for k in range(n_pairs):
        row = contact.mates[k]
        answer = _evaluate_pair(axes, contact, k, state.v, state.x, state.x_old, step)
        left = answer[3]
        for c in range(3):
            row[_DRAWN + c] = left[c]
        found[DEEPEST] = max(found[DEEPEST], 2.0 - row[_DISTANCE] / law[RADIUS])
        if row[_DISTANCE] < 0.0:
            found[CROSSINGS] += 1.0
        if answer[1] > 0.0 and not _has_touched(contact, row):
            v = _differ(axes, contact, k, state.v_old)
            closing = 0.0
            for c in range(3):
                closing -= v[c] * row[_NORMAL + c]
            if closing > IMPACT:
                found[IMPACTS] += 1.0
    _remember_all(contact, n_pairs)


@kernel
def _has_touched(contact, row):
    """Whether a pair touched at the end of the step before."""
    slot = int(row[_SLOT])
    radius = contact.law[RADIUS]
    return slot >= 0 and contact.strands[int(row[_POINT]), slot, 4] < 2.0 * radius


@kernel
def _remember_all(contact, n_pairs):
    """Replaces what points remember by the pairs of now."""
    contact.strands[:, :, 0] = -1.0
    for k in range(n_pairs):
        _remember(contact, contact.mates[k])


@kernel
def _remember(contact, row):
    """Keeps one pair of a point, in place of its farthest where there is no room."""
    strands = contact.strands[int(row[_POINT])]
    slot, farthest = -1, row[_DISTANCE]
    for k in range(MATES):
        if strands[k, 0] < 0.0:
            slot = k
            break
        if strands[k, 4] > farthest:
            slot, farthest = k, strands[k, 4]
    if slot < 0:
        return
    strands[slot, 0], strands[slot, 4] = row[_ARC], row[_DISTANCE]
    for c in range(3):
        strands[slot, 1 + c] = row[_NORMAL + c]
        strands[slot, 5 + c] = row[_DRAWN + c]
