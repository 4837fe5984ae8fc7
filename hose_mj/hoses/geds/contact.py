"""Contact of the spline with rigid shapes: forces, their matrix, and what friction remembers.

The force per length of contact_law.py acts at contact points that stand at most a radius apart, all
of it taken at the end of the stage. In the matrix stand the parts that leave it positive
semidefinite: the slope of N along n, and for friction kt across n where a point sticks,
mu N / |z| across n and the slide where it slides. With `exact` also the curvature of the shape,
which softens. Left out is how friction grows with N: it is not symmetric.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.contact_law import (
    DAMPING,
    DEEPEST,
    IMPACTS,
    MARGIN,
    OBSTACLES,
    RADIUS,
    SLOTS,
    STAGE,
    STICK,
    TIMESTEP,
    TOUCHED,
    Motion,
    press,
    rub,
)
from hose_mj.hoses.geds.shapes import POSITION, SCALE
from hose_mj.hoses.geds.touch import (
    FAST,
    IMPACT,
    compute_gap,
    compute_surface_move,
    evaluate,
    find_next,
    find_span,
    find_surface_velocity,
    is_skipped,
    is_span_near,
)
from hose_mj.jit import apart, compiled, inlined, kernel


@kernel
def _find_slot(memory, q, g):
    """Where friction remembers geom g at contact point q, -1 for nowhere."""
    for slot in range(SLOTS):
        if memory[q, slot, 0] == g + 2.0:
            return slot
    return -1


@apart
def _compute_force(axes, contact, q, g, start, touch, motion, trial):
    """Force per length at a point and what makes its matrix.

    In a trial, one of Newton's (1.0, else 0.0: numba compiles once for each truth value), a point
    that slid one way and now would slide back is taken to stick, whatever that takes: the next
    trial tells whether it can.

    Returns force (3,), N, its slope, what of z is left (3,), direction of the slide (3,) and the
    stiffness across it.
    """
    gap, normal, _, friction, point = touch
    friction *= contact.points[q, 5]
    zero = (0.0, 0.0, 0.0)
    scale = 1.0 if g < 0 else contact.geoms[g, SCALE]
    surface = find_surface_velocity(contact, q, g, point)
    away = 0.0
    if motion.step < np.inf:
        v = evaluate(axes, contact.points, q, start, motion.rate)
        for c in range(3):
            away += normal[c] * (v[c] - surface[c])
    N, slope = press(contact.law, scale, gap, away)
    force = (N * normal[0], N * normal[1], N * normal[2])
    if N == 0.0 or friction == 0.0 or motion.step == np.inf:
        return force, N, slope, zero, zero, 0.0
    before = evaluate(axes, contact.points, q, start, motion.start)
    move = compute_surface_move(contact, q, g, point, motion.elapsed)
    z = (
        point[0] - before[0] - move[0],
        point[1] - before[1] - move[1],
        point[2] - before[2] - move[2],
    )
    slot = _find_slot(contact.memory, q, g)
    if slot >= 0:
        m = contact.memory
        z = (z[0] + m[q, slot, 1], z[1] + m[q, slot, 2], z[2] + m[q, slot, 3])
    up = z[0] * normal[0] + z[1] * normal[1] + z[2] * normal[2]
    z = (z[0] - up * normal[0], z[1] - up * normal[1], z[2] - up * normal[2])
    stick, limit = scale * contact.law[STICK], friction * N
    held, left, slide, stiffness = rub(stick, limit, z)
    if trial > 0.0 and _turns_back(contact, q, g, slide):
        held, left, slide, stiffness = rub(stick, np.inf, z)
    force = (force[0] + held[0], force[1] + held[1], force[2] + held[2])
    return force, N, slope, left, slide, stiffness


@kernel
def _turns_back(contact, q, g, slide):
    """Whether a point slides against where it slid at the stage's build before; remembers it."""
    slides, stage = contact.slides, contact.found[STAGE]
    if slide[0] == 0.0 and slide[1] == 0.0 and slide[2] == 0.0:
        return False
    free = -1
    for slot in range(SLOTS):
        if slides[q, slot, 1] != stage:
            free = slot
        elif slides[q, slot, 0] == g + 2.0:
            along = 0.0
            for c in range(3):
                along += slides[q, slot, 2 + c] * slide[c]
            back = along < 0.0
            for c in range(3):
                slides[q, slot, 2 + c] = 0.0 if back else slide[c]
            return back
    if free >= 0:
        slides[q, free, 0], slides[q, free, 1] = g + 2.0, stage
        for c in range(3):
            slides[q, free, 2 + c] = slide[c]
    return False


@inlined
def add_contact(axes, contact, x, motion, exact, gradient, band):
    """Adds contact to the residual and its matrix; returns how many contact points touch.

    Args:
        axes: (0.0,) * d.
        contact: what may be touched; the linear model of each force goes into its `pairs`.
        x: control points, flat.
        motion: how they got there.
        exact: whether the curvature of shapes enters the matrix.
        gradient: added to.
        band: added to.
    """
    law = contact.law
    n_contacts, n_pairs = 0, 0
    first = -1 if contact.given.shape[0] > 0 else 0
    for e in range(len(contact.first) - 1):
        start, n_before = e * len(axes), n_contacts
        ball = find_span(axes, contact, e, x, motion.before)
        is_fast = ball[2] > FAST * law[RADIUS]
        for g in range(first, contact.geoms.shape[0]):
            if not is_span_near(contact, g, ball):
                continue
            q, end = contact.first[e], contact.first[e + 1]
            while q < end:
                at = q
                if is_skipped(contact, at, g):
                    q += 1
                    continue
                touch = compute_gap(axes, contact, at, g, start, x, motion, is_fast)
                q = q + 1 if is_fast else find_next(contact, at, end, touch[0], ball[3])
                if touch[0] >= law[MARGIN]:
                    continue
                answer = _compute_force(axes, contact, at, g, start, touch, motion, 1.0)
                force, N = answer[0], answer[1]
                matrix = _make_matrix(contact, touch, answer, motion.step, exact)
                n_pairs = _keep_pair(contact, n_pairs, (at, g, e), force, matrix, touch[4])
                if N == 0.0:
                    continue
                if n_contacts == n_before:
                    contact.block[:, :] = 0.0
                n_contacts += 1
                gather(axes, contact.points, contact.block, at, start, force, matrix, gradient)
        if n_contacts > n_before:
            scatter_block(axes, contact.block, start, band)
    contact.found[TOUCHED] = n_pairs
    return n_contacts


@kernel
def _keep_pair(contact, k, names, force, matrix, point):
    """Remembers the linear model of one point's force; returns how many there are now."""
    pairs = contact.pairs
    if k < pairs.shape[0]:
        pairs[k, 0], pairs[k, 1], pairs[k, 14] = names[0], names[1], names[2]
        for c in range(3):
            pairs[k, 2 + c] = force[c]
            pairs[k, 11 + c] = point[c]
        for c in range(6):
            pairs[k, 5 + c] = matrix[c]
    return k + 1


@apart
def _make_matrix(contact, touch, answer, step, exact):
    """Stiffness per length of one point as (00, 11, 22, 01, 02, 12)."""
    _, n, (bend, a), _, _ = touch
    _, N, slope, _, e, across = answer
    if N == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    along = slope * (1.0 + contact.law[DAMPING] / step) - across
    flat = across
    if exact:
        # Less N times the Hessian of the distance.
        flat -= N * bend[0]
        along += N * bend[0]
        r = N * (bend[1] - bend[0])
    else:
        r = 0.0
    return (
        flat + along * n[0] * n[0] - across * e[0] * e[0] - r * a[0] * a[0],
        flat + along * n[1] * n[1] - across * e[1] * e[1] - r * a[1] * a[1],
        flat + along * n[2] * n[2] - across * e[2] * e[2] - r * a[2] * a[2],
        along * n[0] * n[1] - across * e[0] * e[1] - r * a[0] * a[1],
        along * n[0] * n[2] - across * e[0] * e[2] - r * a[0] * a[2],
        along * n[1] * n[2] - across * e[1] * e[2] - r * a[1] * a[2],
    )


@kernel
def gather(axes, points, block, q, start, force, matrix, gradient):
    """Adds a point's force to the residual and its matrix to the span's block."""
    d, share = len(axes), points[q, 4]
    row = 0
    for i in range(4):
        weight = share * points[q, i]
        for c in range(len(axes[:3])):
            gradient[start + i * d + c] -= weight * force[c]
        for j in range(i + 1):
            product = weight * points[q, j]
            for c in range(6):
                block[row, c] += product * matrix[c]
            row += 1


@kernel
def scatter_block(axes, block, start, band):
    """Adds the block of a span to the band."""
    d = len(axes)
    n_coordinates = len(axes[:3])
    order = ((0, 3, 4), (3, 1, 5), (4, 5, 2))
    row = 0
    for i in range(4):
        for j in range(i + 1):
            column = start + j * d
            for c1 in range(n_coordinates):
                for c2 in range(n_coordinates if j < i else c1 + 1):
                    band[column + c2, (i - j) * d + c1 - c2] += block[row, order[c1][c2]]
            row += 1


@kernel
def measure_contact_left(axes, contact, x, motion):
    """Sum over the pairs of the last build of |force at x - its linear model|, N.

    It is what a Newton step to x leaves of the contact's residual; infinite where pairs were lost.
    """
    n_pairs = int(contact.found[TOUCHED])
    pairs = contact.pairs
    if n_pairs > pairs.shape[0]:
        return np.inf
    left = 0.0
    for k in range(n_pairs):
        q, g, e = int(pairs[k, 0]), int(pairs[k, 1]), int(pairs[k, 14])
        start = e * len(axes)
        moved = 0.0
        now = evaluate(axes, contact.points, q, start, x)
        before = evaluate(axes, contact.points, q, start, motion.before)
        for c in range(3):
            moved = max(moved, abs(now[c] - before[c]))
        is_fast = moved > 0.5 * FAST * contact.law[RADIUS]
        touch = compute_gap(axes, contact, q, g, start, x, motion, is_fast)
        force = _compute_force(axes, contact, q, g, start, touch, motion, 0.0)[0]
        d0, d1, d2 = now[0] - pairs[k, 11], now[1] - pairs[k, 12], now[2] - pairs[k, 13]
        m = pairs[k]
        r0 = force[0] - m[2] + m[5] * d0 + m[8] * d1 + m[9] * d2
        r1 = force[1] - m[3] + m[8] * d0 + m[6] * d1 + m[10] * d2
        r2 = force[2] - m[4] + m[9] * d0 + m[10] * d1 + m[7] * d2
        left += contact.points[q, 4] * np.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
    return left


@kernel
def accept_contact(axes, contact, state):
    """Makes friction remember a step that is done; counts impacts and keeps the greatest depth."""
    law = contact.law
    motion = Motion(state.v, state.x_old, state.x_old, law[TIMESTEP], law[TIMESTEP], 0.0)
    first = -1 if contact.given.shape[0] > 0 else 0
    for e in range(len(contact.first) - 1):
        start = e * len(axes)
        ball = find_span(axes, contact, e, state.x, state.x_old)
        is_fast = ball[2] > FAST * law[RADIUS]
        for q in range(contact.first[e], contact.first[e + 1]):
            for slot in range(SLOTS):
                # Below zero: of the step before.
                contact.memory[q, slot, 0] = -contact.memory[q, slot, 0]
        for g in range(first, contact.geoms.shape[0]):
            if not is_span_near(contact, g, ball):
                continue
            q, end = contact.first[e], contact.first[e + 1]
            while q < end:
                at = q
                if is_skipped(contact, at, g):
                    q += 1
                    continue
                touch = compute_gap(axes, contact, at, g, start, state.x, motion, is_fast)
                q = q + 1 if is_fast else find_next(contact, at, end, touch[0], ball[3])
                if touch[0] < law[MARGIN]:
                    _remember(axes, contact, at, g, start, touch, motion, state)
        for q in range(contact.first[e], contact.first[e + 1]):
            for slot in range(SLOTS):
                if contact.memory[q, slot, 0] <= 0.0:
                    for c in range(4):
                        contact.memory[q, slot, c] = 0.0


@kernel
def _remember(axes, contact, q, g, start, touch, motion, state):
    """Writes what friction remembers of one point and geom."""
    memory, found = contact.memory, contact.found
    found[DEEPEST] = max(found[DEEPEST], -touch[0] / contact.law[RADIUS])
    slot = -1
    for k in range(SLOTS):
        if memory[q, k, 0] == -(g + 2.0):
            slot = k
            memory[q, k, 0] = g + 2.0
    answer = _compute_force(axes, contact, q, g, start, touch, motion, 0.0)
    if answer[1] == 0.0:
        if slot >= 0:
            memory[q, slot, 0] = 0.0
        return
    if slot < 0:
        v = evaluate(axes, contact.points, q, start, state.v_old)
        surface = find_surface_velocity(contact, q, g, touch[4])
        closing = 0.0
        for c in range(3):
            closing -= (v[c] - surface[c]) * touch[1][c]
        # Two hoses keep their momentum only where both go on by the same rule.
        if closing > IMPACT and g < contact.law[OBSTACLES]:
            found[IMPACTS] += 1.0
        for k in range(SLOTS):
            if memory[q, k, 0] == 0.0 and slot < 0:
                slot = k
    if slot >= 0:
        memory[q, slot, 0] = g + 2.0
        for c in range(3):
            memory[q, slot, 1 + c] = answer[3][c]


@compiled
def compute_forces(axes, contact, x, v, forces, reactions):
    """Contact forces at the state (x, v), flat.

    Writes the force on the hose at each contact point (Q, 3), N, and what the hose does to each
    geom, (G, 6): force (N) and moment about the geom's position (N m), of forces that act at the
    hose's centre line. In the hose's coordinates.
    """
    # Nothing moves any more: friction is what it remembers.
    motion = Motion(v, x, x, contact.law[TIMESTEP], 0.0, 0.0)
    first = -1 if contact.given.shape[0] > 0 else 0
    forces[:, :] = 0.0
    reactions[:, :] = 0.0
    for e in range(len(contact.first) - 1):
        start = e * len(axes)
        ball = find_span(axes, contact, e, x, x)
        for g in range(first, contact.geoms.shape[0]):
            if not is_span_near(contact, g, ball):
                continue
            q, end = contact.first[e], contact.first[e + 1]
            while q < end:
                at = q
                if is_skipped(contact, at, g):
                    q += 1
                    continue
                touch = compute_gap(axes, contact, at, g, start, x, motion, ball[2] < 0.0)
                q = find_next(contact, at, end, touch[0], ball[3])
                if touch[0] < contact.law[MARGIN]:
                    answer = _compute_force(axes, contact, at, g, start, touch, motion, 0.0)
                    _add_reaction(contact, at, g, answer[0], touch[4], forces, reactions)


@kernel
def _add_reaction(contact, q, g, force, point, forces, reactions):
    weight = contact.points[q, 4]
    for c in range(3):
        forces[q, c] += weight * force[c]
    if g < 0:
        return
    for c in range(3):
        c1, c2 = (c + 1) % 3, (c + 2) % 3
        arm1 = point[c1] - contact.geoms[g, POSITION + c1]
        arm2 = point[c2] - contact.geoms[g, POSITION + c2]
        reactions[g, c] -= weight * force[c]
        reactions[g, 3 + c] -= weight * (arm1 * force[c2] - arm2 * force[c1])
