"""Twist of a hose that bends alike in every direction: one scalar between two clamps.

Such a hose carries one moment about its tangent from clamp to clamp, whatever its shape: its twist
is spread evenly over the compliance, and only the total angle Phi of a segment counts,
U = Phi^2 / (2 c) with c the integral of ds / GJ. Phi is the angle from the director of the first
clamp, after parallel transport along the hose (Bishop 1975), to that of the last. It is a function
of the shape and of the clamps; its whole turns are kept by continuity.

The transported director turns in every span

1. by the smallest rotation that takes the knot's tangent u to the next knot's v, and
2. about v by the integral of u.(a x b) / (A (1 + u.t)), which makes up for the way between.

The variation of Phi by the shape is the integral of kb . da / |a| (kb = a x b / A): a moment M
works on the hose like the gradient M times that. Nothing is integrated in time, so nothing drifts.
A segment that ends at a free end carries no moment and is not here.

A closed loop has two more clamps, which hold nothing: at s = 0 and at s = L, where the material has
been joined. They cut it into pieces, each as between two clamps of an open hose. Where there are
other clamps, the first piece and the last are one segment with one moment, and only the sum of
their angles counts.

A point moment m has a part m . t along the tangent. The moment that the hose carries drops by it
there; to the moment Phi / c of the segment, which is the mean, it adds a share that twist_loads.py
knows in advance, since nothing but the places of clamps and moments goes into it. It acts on the
shape like any moment of twist.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.span import (
    LEAST_A,
    LEAST_SQUARE,
    LEAST_TURN_ROOM,
    compute_derivatives,
)
from hose_mj.hoses.protocol import Array
from hose_mj.jit import inlined, kernel


class Twist(NamedTuple):
    """C clamps and the K segments between them, one piece each; see above for a closed loop.

    Piece k belongs to segment k; where there is one piece more than segments, it is of segment 0.

    Attributes:
        starts: index of the first of the unknowns that shape the hose at a clamp, (C,).
        places: where each clamp is, in spans from the start, (C,).
        slopes: dN/ds there, (C, 4).
        directors: tangent and director of each clamp at the beginning of a step, (C, 6).
        spin: turn of each clamp about its tangent within the step (rad) and its rate (rad/s),
            (C, 2).
        ends: first and last clamp of each piece, (pieces, 2).
        spans: first and last span of each piece, (pieces, 2).
        weights: Gauss weights times length, of the part of a span that is in the piece,
            (pieces, S, 3).
        compliance: integral of ds / GJ (1 / (N m)), (K,).
        angle: Phi less its rest value at the beginning of a step (rad), (K,).
        trial: the same at the present iterate, (K,).
        torque: moment at the present iterate (N m), (K,).
        frames: reference frames of a hose with theta (rod.py), at the Gauss points and then at the
            clamps, at the present iterate, (3 S + C, 10).
        accepted: the same at the beginning of a step.
        turn_rows: row of the holds that fixes theta at each clamp, (C,).
        fresh, angles, fit, change: work of `frames.reset_frames`: frames, angles between old and
            new directors (3 S,), a band (n + 4, 8) and its right-hand side (1, n + 4).
        transported: work: the tangent u, the director and the sum of item 2, (pieces, 7).
        rows: derivative of Phi by the unknowns, (K, size + padding).
        load_starts: index of the first of the unknowns that shape the hose at each of k point
            moments, (k,).
        load_slopes: dN/ds there, (k, 4).
        load_moments: (k, 3), N m, world frame.
        load_shares: moment about the tangent that one newton metre along it makes at each Gauss
            point, times the length that the point stands for, (k, S, 3), m.
        applied: work: what all point moments make there, (S, 3), N m^2; of no use where k is 0.
    """

    starts: np.ndarray
    places: Array
    slopes: Array
    directors: Array
    spin: Array
    ends: np.ndarray
    spans: np.ndarray
    weights: Array
    compliance: Array
    angle: Array
    trial: Array
    torque: Array
    frames: Array
    accepted: Array
    fresh: Array
    angles: Array
    fit: Array
    change: Array
    turn_rows: np.ndarray
    transported: Array
    rows: Array
    load_starts: np.ndarray
    load_slopes: Array
    load_moments: Array
    load_shares: Array
    applied: Array


def find_owners(twist: Twist) -> np.ndarray:
    """Returns the segment of each piece, (pieces,)."""
    return np.arange(len(twist.ends)) % max(len(twist.angle), 1)


@inlined
def compute_tangent(axes, start, slopes, row, x):
    """Unit tangent from the four control points whose first unknown is `start`."""
    d = len(axes)
    n0, n1, n2, n3 = slopes[row, 0], slopes[row, 1], slopes[row, 2], slopes[row, 3]
    t0 = n0 * x[start] + n1 * x[start + d] + n2 * x[start + 2 * d] + n3 * x[start + 3 * d]
    k = start + 1
    t1 = n0 * x[k] + n1 * x[k + d] + n2 * x[k + 2 * d] + n3 * x[k + 3 * d]
    k = start + 2
    t2 = n0 * x[k] + n1 * x[k + d] + n2 * x[k + 2 * d] + n3 * x[k + 3 * d]
    inverse = 1.0 / np.sqrt(max(t0 * t0 + t1 * t1 + t2 * t2, LEAST_SQUARE))
    return t0 * inverse, t1 * inverse, t2 * inverse


@inlined
def transport(u0, u1, u2, v0, v1, v2, d0, d1, d2):
    """The director d, normal to u, after the smallest rotation that takes u to v (unit vectors)."""
    cosine = u0 * v0 + u1 * v1 + u2 * v2
    factor = (d0 * v0 + d1 * v1 + d2 * v2) / max(1.0 + cosine, LEAST_TURN_ROOM)
    return d0 - factor * (u0 + v0), d1 - factor * (u1 + v1), d2 - factor * (u2 + v2)


@inlined
def transport_clamp(directors, clamp, t0, t1, t2):
    """The director of a clamp after the smallest rotation of its tangent to t."""
    d = directors
    u0, u1, u2 = d[clamp, 0], d[clamp, 1], d[clamp, 2]
    return transport(u0, u1, u2, t0, t1, t2, d[clamp, 3], d[clamp, 4], d[clamp, 5])


@inlined
def start_twist(twist):
    """Begins a step or a solve anew from the last accepted state."""
    for k in range(len(twist.angle)):
        twist.trial[k] = twist.angle[k]
        twist.torque[k] = twist.angle[k] / twist.compliance[k]


@inlined
def open_segments(axes, twist, x):
    """Puts the director of each piece's first clamp where the tangent now is there."""
    for k in range(len(twist.ends)):
        clamp = twist.ends[k, 0]
        u0, u1, u2 = compute_tangent(axes, twist.starts[clamp], twist.slopes, clamp, x)
        d0, d1, d2 = transport_clamp(twist.directors, clamp, u0, u1, u2)
        twist.transported[k, 0], twist.transported[k, 1], twist.transported[k, 2] = u0, u1, u2
        twist.transported[k, 3], twist.transported[k, 4], twist.transported[k, 5] = d0, d1, d2
        twist.transported[k, 6] = 0.0
    for k in range(len(twist.angle)):
        for i in range(twist.rows.shape[1]):
            twist.rows[k, i] = 0.0
    if len(twist.load_starts) > 0:
        _spread_loads(axes, twist, x)


@kernel
def _spread_loads(axes, twist, x):
    """Writes to twist.applied what the point moments' parts along the tangent make."""
    for e in range(twist.applied.shape[0]):
        for g in range(3):
            twist.applied[e, g] = 0.0
    for k in range(len(twist.load_starts)):
        t0, t1, t2 = compute_tangent(axes, twist.load_starts[k], twist.load_slopes, k, x)
        moment = twist.load_moments
        along = moment[k, 0] * t0 + moment[k, 1] * t1 + moment[k, 2] * t2
        for e in range(twist.applied.shape[0]):
            for g in range(3):
                twist.applied[e, g] += along * twist.load_shares[k, e, g]


@inlined
def _measure_bend(g, p):
    """Returns kb, the tangent t, 1 / A and 1 / |a| at Gauss point g."""
    a0, a1, a2 = p.a[g, 0], p.a[g, 1], p.a[g, 2]
    b0, b1, b2 = p.b[g, 0], p.b[g, 1], p.b[g, 2]
    inverse = 1.0 / max(a0 * a0 + a1 * a1 + a2 * a2, LEAST_A)
    root = np.sqrt(inverse)
    k0 = (a1 * b2 - a2 * b1) * inverse
    k1 = (a2 * b0 - a0 * b2) * inverse
    k2 = (a0 * b1 - a1 * b0) * inverse
    return (k0, k1, k2), (a0 * root, a1 * root, a2 * root), inverse, root


@inlined
def _add_stiffness(g, moment, bend, tangent, inverse, p):
    """Adds the geometric stiffness of a moment times a length (N m^2) at Gauss point g.

    By (a, a): -3/2 (t kb^T + kb t^T) / A; by (a, b): [t]x / (2 A).
    """
    k0, k1, k2 = bend
    t0, t1, t2 = tangent
    aa = -1.5 * moment * inverse
    ab = 0.5 * moment * inverse
    q = p.stiffness
    q[0, 0, g] += 2.0 * aa * t0 * k0
    q[1, 0, g] += aa * (t1 * k0 + k1 * t0)
    q[1, 1, g] += 2.0 * aa * t1 * k1
    q[2, 0, g] += aa * (t2 * k0 + k2 * t0)
    q[2, 1, g] += aa * (t2 * k1 + k2 * t1)
    q[2, 2, g] += 2.0 * aa * t2 * k2
    q[1, 0, 3 + g] += ab * t2
    q[2, 0, 3 + g] -= ab * t1
    q[2, 1, 3 + g] += ab * t0
    q[1, 0, 6 + g] -= ab * t2
    q[2, 0, 6 + g] += ab * t1
    q[2, 1, 6 + g] -= ab * t0


@kernel
def _add_applied(twist, e, exact, p):
    """Adds force and geometric stiffness of what the point moments make in span e."""
    for g in range(3):
        moment = twist.applied[e, g]
        bend, tangent, inverse, root = _measure_bend(g, p)
        for c in range(3):
            p.force[g, 0, c] += moment * root * bend[c]
        _add_stiffness(g, exact * moment, bend, tangent, inverse, p)


@inlined
def add_twist(axes, tables, twist, e, exact, x, p):
    """Carries the directors through span e and adds what twist does there.

    The derivative of Phi goes to twist.rows, the moment's geometric stiffness (scaled by `exact`,
    with the moment of the last iterate) to p.stiffness; the force follows in `close_segments`. What
    point moments make is known already.
    """
    if len(twist.load_starts) > 0:
        _add_applied(twist, e, exact, p)
    for k in range(len(twist.ends)):
        if e < twist.spans[k, 0] or e > twist.spans[k, 1]:
            continue
        owner = k if k < len(twist.angle) else 0
        u0, u1, u2 = twist.transported[k, 0], twist.transported[k, 1], twist.transported[k, 2]
        moment = exact * twist.torque[owner]
        total = 0.0
        for g in range(3):
            weight = twist.weights[k, e, g]
            bend, tangent, inverse, root = _measure_bend(g, p)
            k0, k1, k2 = bend
            t0, t1, t2 = tangent
            cosine = u0 * t0 + u1 * t1 + u2 * t2
            total += weight * (u0 * k0 + u1 * k1 + u2 * k2) / max(1.0 + cosine, LEAST_TURN_ROOM)
            scale = weight * root
            s0, s1, s2 = scale * k0, scale * k1, scale * k2
            for i in range(4):
                slope = tables.first[e, g, i]
                at = 3 * (e + i)
                twist.rows[owner, at] += slope * s0
                twist.rows[owner, at + 1] += slope * s1
                twist.rows[owner, at + 2] += slope * s2
            _add_stiffness(g, moment * weight, bend, tangent, inverse, p)
        if e == twist.spans[k, 1]:
            clamp = twist.ends[k, 1]
            v0, v1, v2 = compute_tangent(axes, twist.starts[clamp], twist.slopes, clamp, x)
        else:
            v0, v1, v2 = compute_tangent(axes, 3 * e, tables.ends, e, x)
        d0, d1, d2 = twist.transported[k, 3], twist.transported[k, 4], twist.transported[k, 5]
        d0, d1, d2 = transport(u0, u1, u2, v0, v1, v2, d0, d1, d2)
        twist.transported[k, 0], twist.transported[k, 1], twist.transported[k, 2] = v0, v1, v2
        twist.transported[k, 3], twist.transported[k, 4], twist.transported[k, 5] = d0, d1, d2
        twist.transported[k, 6] += total


@inlined
def _measure_piece(twist, k):
    """The angle of piece k, whose director has come to the last clamp, but for whole turns."""
    last = twist.ends[k, 1]
    t0, t1, t2 = twist.transported[k, 0], twist.transported[k, 1], twist.transported[k, 2]
    d0, d1, d2 = twist.transported[k, 3], twist.transported[k, 4], twist.transported[k, 5]
    e0, e1, e2 = transport_clamp(twist.directors, last, t0, t1, t2)
    across = t0 * (d1 * e2 - d2 * e1) + t1 * (d2 * e0 - d0 * e2) + t2 * (d0 * e1 - d1 * e0)
    return np.arctan2(across, d0 * e0 + d1 * e1 + d2 * e2) - twist.transported[k, 6]


@inlined
def _compute_spin(twist, k, column):
    """What the clamps' spins, or rates of spin (column 1), add to the angle of segment k."""
    spin = twist.spin[twist.ends[k, 1], column] - twist.spin[twist.ends[k, 0], column]
    if k == 0:
        for piece in range(len(twist.angle), len(twist.ends)):
            spin += (
                twist.spin[twist.ends[piece, 1], column] - twist.spin[twist.ends[piece, 0], column]
            )
    return spin


@inlined
def compute_angle(twist, k, near):
    """Sets twist.trial of segment k, whose directors have come to the last clamps.

    Of all angles that differ by whole turns it is the one closest to `near`.
    """
    angle = _measure_piece(twist, k)
    if k == 0:
        for piece in range(len(twist.angle), len(twist.ends)):
            angle += _measure_piece(twist, piece)
    turn = 2.0 * np.pi
    twist.trial[k] = angle + turn * np.round((near - angle) / turn)


@inlined
def close_segments(twist, in_statics, fraction, tau, rate, gradient):
    """Finds Phi and the moment of each segment, and adds the moment's force to the gradient.

    A time step changes Phi by less than half a turn, however its iterates stray. A static solve may
    go far, but its iterates are capped: there Phi is foreseen from the one before.

    Args:
        twist: after `add_twist` of all spans.
        in_statics: True in a static solve.
        fraction: of the clamps' spin that is done.
        tau: Kelvin-Voigt relaxation time (s).
        rate: velocity of the unknowns; read only where tau is not 0.
        gradient: added to.
    """
    for k in range(len(twist.angle)):
        compute_angle(twist, k, twist.trial[k] if in_statics else twist.angle[k])
        angle = twist.trial[k] + fraction * _compute_spin(twist, k, 0)
        if tau != 0.0:
            speed = _compute_spin(twist, k, 1)
            for i in range(twist.rows.shape[1]):
                speed += twist.rows[k, i] * rate[i]
            angle += tau * speed
        twist.torque[k] = angle / twist.compliance[k]
        for i in range(twist.rows.shape[1]):
            gradient[i] += twist.torque[k] * twist.rows[k, i]


@inlined
def predict_twist(twist, factor, step):
    """Foresees Phi after the shape has moved by factor times step."""
    for k in range(len(twist.angle)):
        for i in range(len(step)):
            twist.trial[k] += factor * twist.rows[k, i] * step[i]


@inlined
def accept_twist(axes, twist, x):
    """Ends a step: Phi becomes the last iterate's, the clamps' directors go along with the hose."""
    for k in range(len(twist.angle)):
        twist.angle[k] = twist.trial[k] + _compute_spin(twist, k, 0)
    for clamp in range(len(twist.starts)):
        t0, t1, t2 = compute_tangent(axes, twist.starts[clamp], twist.slopes, clamp, x)
        d0, d1, d2 = transport_clamp(twist.directors, clamp, t0, t1, t2)
        d = twist.directors
        cosine, sine = np.cos(twist.spin[clamp, 0]), np.sin(twist.spin[clamp, 0])
        d[clamp, 0], d[clamp, 1], d[clamp, 2] = t0, t1, t2
        d[clamp, 3] = cosine * d0 + sine * (t1 * d2 - t2 * d1)
        d[clamp, 4] = cosine * d1 + sine * (t2 * d0 - t0 * d2)
        d[clamp, 5] = cosine * d2 + sine * (t0 * d1 - t1 * d0)
        twist.spin[clamp, 0] = twist.spin[clamp, 1] = 0.0


@kernel
def measure_twist(axes, tables, twist, x, p):
    """Sets twist.trial to Phi at the shape x, in the turn that is closest to the trial before."""
    open_segments(axes, twist, x)
    for e in range(tables.first.shape[0]):
        for g in range(3):
            compute_derivatives(axes, tables, e, g, x, p.a, p.b)
        add_twist(axes, tables, twist, e, 0.0, x, p)
    for k in range(len(twist.angle)):
        compute_angle(twist, k, twist.trial[k])
