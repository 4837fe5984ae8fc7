"""The reference frames of a hose with theta: how they are set, taken along and reset.

Frames that go along with the tangent in time (rod.py) gather, little by little, an angle along the
hose that the spline theta cannot follow: their own twist rate m. Before m gets large they are reset
to parallel transport along the hose (m = 0), and theta takes over what they had gathered. The
material directors stay where they were, exactly so at the clamps.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.band import factorize, solve_lower, solve_upper
from hose_mj.hoses.geds.rod import move_frame
from hose_mj.hoses.geds.span import LEAST_SQUARE, LEAST_TURN_ROOM, compute_derivatives
from hose_mj.hoses.geds.twist import compute_tangent, transport
from hose_mj.jit import inlined, kernel

LARGEST_GATHERED = 0.01
"""Twist rate of the frames times a span's length (rad) above which they are reset.

What theta cannot follow of it is twist that no motion relaxes: at 0.1 a hose let go after half a
turn keeps up to 0.2 rad/m for good.
"""
_GAUSS = np.sqrt(0.6)
_STIFF = 1e8
"""Weight of a clamp's theta in the fit, relative to a Gauss point's."""


@kernel
def move_frames(axes, tables, twist, x, p):
    """Takes all frames along to the shape x."""
    n_spans = tables.first.shape[0]
    for e in range(n_spans):
        for g in range(3):
            compute_derivatives(axes, tables, e, g, x, p.a, p.b)
            a0, a1, a2 = p.a[g, 0], p.a[g, 1], p.a[g, 2]
            move_frame(twist.frames, 3 * e + g, a0, a1, a2, p.b[g, 0], p.b[g, 1], p.b[g, 2])
    move_clamp_frames(axes, twist, x)


@kernel
def move_clamp_frames(axes, twist, x):
    """Takes the frames at the clamps along to the shape x."""
    f = twist.frames
    first = f.shape[0] - len(twist.starts)
    for clamp in range(len(twist.starts)):
        row = first + clamp
        t0, t1, t2 = compute_tangent(axes, twist.starts[clamp], twist.slopes, clamp, x)
        u0, u1, u2 = f[row, 0], f[row, 1], f[row, 2]
        d0, d1, d2 = transport(u0, u1, u2, t0, t1, t2, f[row, 6], f[row, 7], f[row, 8])
        f[row, 0], f[row, 1], f[row, 2] = t0, t1, t2
        f[row, 6], f[row, 7], f[row, 8] = d0, d1, d2


@kernel
def restore_frames(twist):
    """Returns to the frames of the last accepted state."""
    for f in range(twist.frames.shape[0]):
        for k in range(10):
            twist.frames[f, k] = twist.accepted[f, k]


@kernel
def _save_frames(twist):
    """Accepts the frames as they are."""
    for f in range(twist.frames.shape[0]):
        for k in range(10):
            twist.accepted[f, k] = twist.frames[f, k]


@kernel
def shift_clamps(twist, progress, shift):
    """Adds to each clamp's wanted change of theta its spin and what its frame went astray.

    The frame at a clamp has gone from iterate to iterate, the clamp in one smallest rotation.
    """
    f = twist.frames
    k = twist.accepted
    first = f.shape[0] - len(twist.starts)
    for clamp in range(len(twist.starts)):
        row = first + clamp
        t0, t1, t2 = f[row, 0], f[row, 1], f[row, 2]
        u0, u1, u2 = k[row, 0], k[row, 1], k[row, 2]
        d0, d1, d2 = transport(u0, u1, u2, t0, t1, t2, k[row, 6], k[row, 7], k[row, 8])
        angle = _compute_angle(t0, t1, t2, f[row, 6], f[row, 7], f[row, 8], d0, d1, d2)
        shift[twist.turn_rows[clamp]] += progress * twist.spin[clamp, 0] + angle


@inlined
def _compute_angle(t0, t1, t2, d0, d1, d2, e0, e1, e2):
    """Angle from d to e about t, right-handed, in (-pi, pi]."""
    across = t0 * (d1 * e2 - d2 * e1) + t1 * (d2 * e0 - d0 * e2) + t2 * (d0 * e1 - d1 * e0)
    return np.arctan2(across, d0 * e0 + d1 * e1 + d2 * e2)


@kernel
def transport_frames(axes, tables, twist, x, p, frames):
    """Transports a director without twist along the hose, from row 0 of `frames` on, to all frames.

    That director is where the hose begins. From knot to knot and from a knot to what is in its
    span: the smallest rotation, and a turn that makes up for the way between (twist.py).
    """
    n_spans = tables.first.shape[0]
    d0, d1, d2 = frames[0, 6], frames[0, 7], frames[0, 8]
    u0, u1, u2 = _compute_first_tangent(x)
    along = d0 * u0 + d1 * u1 + d2 * u2
    d0, d1, d2 = d0 - along * u0, d1 - along * u1, d2 - along * u2
    inverse = 1.0 / np.sqrt(max(d0 * d0 + d1 * d1 + d2 * d2, LEAST_SQUARE))
    d0, d1, d2 = d0 * inverse, d1 * inverse, d2 * inverse
    for e in range(n_spans):
        for g in range(3):
            compute_derivatives(axes, tables, e, g, x, p.a, p.b)
            row = 3 * e + g
            for k in range(10):
                frames[row, k] = 0.0
            a0, a1, a2 = p.a[g, 0], p.a[g, 1], p.a[g, 2]
            # From nothing: a first move sets t and t'.
            move_frame(frames, row, a0, a1, a2, p.b[g, 0], p.b[g, 1], p.b[g, 2])
            t0, t1, t2 = frames[row, 0], frames[row, 1], frames[row, 2]
            s0, s1, s2 = frames[row, 3], frames[row, 4], frames[row, 5]
            turn = u0 * (t1 * s2 - t2 * s1) + u1 * (t2 * s0 - t0 * s2) + u2 * (t0 * s1 - t1 * s0)
            # Kept in the place of m until the span is done.
            frames[row, 9] = turn / max(1.0 + u0 * t0 + u1 * t1 + u2 * t2, LEAST_TURN_ROOM)
        for g in range(3):
            row = 3 * e + g
            t0, t1, t2 = frames[row, 0], frames[row, 1], frames[row, 2]
            angle = _integrate_turn(tables, frames, e, _GAUSS * (g - 1))
            c0, c1, c2 = transport(u0, u1, u2, t0, t1, t2, d0, d1, d2)
            c0, c1, c2 = _turn(t0, t1, t2, c0, c1, c2, angle)
            frames[row, 6], frames[row, 7], frames[row, 8] = c0, c1, c2
        for clamp in range(len(twist.starts)):
            if min(int(twist.places[clamp]), n_spans - 1) == e:
                row = 3 * n_spans + clamp
                t0, t1, t2 = compute_tangent(axes, twist.starts[clamp], twist.slopes, clamp, x)
                angle = _integrate_turn(tables, frames, e, 2.0 * (twist.places[clamp] - e) - 1.0)
                c0, c1, c2 = transport(u0, u1, u2, t0, t1, t2, d0, d1, d2)
                c0, c1, c2 = _turn(t0, t1, t2, c0, c1, c2, angle)
                frames[row, 0], frames[row, 1], frames[row, 2] = t0, t1, t2
                frames[row, 6], frames[row, 7], frames[row, 8] = c0, c1, c2
        t0, t1, t2 = compute_tangent(axes, 4 * e, tables.ends, e, x)
        d0, d1, d2 = transport(u0, u1, u2, t0, t1, t2, d0, d1, d2)
        d0, d1, d2 = _turn(t0, t1, t2, d0, d1, d2, _integrate_turn(tables, frames, e, 1.0))
        u0, u1, u2 = t0, t1, t2
        for g in range(3):
            frames[3 * e + g, 9] = 0.0


@inlined
def _compute_first_tangent(x):
    """Unit tangent where the hose begins: from the first control point to the second."""
    t0, t1, t2 = x[4] - x[0], x[5] - x[1], x[6] - x[2]
    inverse = 1.0 / np.sqrt(
        max(t0 * t0 + t1 * t1 + t2 * t2, 1e-24)
    )  # control points at least 1e-12 m apart
    return t0 * inverse, t1 * inverse, t2 * inverse


@inlined
def _integrate_turn(tables, frames, e, end):
    """Integral of what stands in the frames' last column from the span's start to `end` (-1 to 1).

    Of the parabola through the three Gauss points.
    """
    f0, f1, f2 = frames[3 * e, 9], frames[3 * e + 1, 9], frames[3 * e + 2, 9]
    slope, bend = (f2 - f0) / (2.0 * _GAUSS), (f2 - 2.0 * f1 + f0) / (2.0 * _GAUSS**2)
    whole = f1 * (end + 1.0) + slope * (end**2 - 1.0) / 2.0 + bend * (end**3 + 1.0) / 3.0
    return 0.5 * tables.span_length * whole


@inlined
def _turn(t0, t1, t2, d0, d1, d2, angle):
    """The director d, normal to the unit vector t, turned by an angle about it."""
    cosine, sine = np.cos(angle), np.sin(angle)
    e0, e1, e2 = t1 * d2 - t2 * d1, t2 * d0 - t0 * d2, t0 * d1 - t1 * d0
    return cosine * d0 + sine * e0, cosine * d1 + sine * e1, cosine * d2 + sine * e2


@inlined
def _find_gauss_point(tables, n_spans, place):
    """The Gauss point that is nearest to a place (in spans from the start)."""
    e = min(int(place), n_spans - 1)
    inside = place - e
    edge = 0.5 - 0.5 * tables.gaps[1]
    g = 0 if inside < edge else (1 if inside < 1.0 - edge else 2)
    return 3 * e + g


@kernel
def reset_frames(axes, hose, constraints, state, p):
    """Resets the frames to parallel transport; theta takes over what they had gathered.

    Works on twist.frames, x and x_old; the change of theta is fitted to values and slopes at the
    Gauss points, and to the clamps.
    """
    tables = hose.tables
    twist = constraints.twist
    n_spans = tables.first.shape[0]
    n = n_spans + 3
    fresh, angles = twist.fresh, twist.angles
    band, change = twist.fit, twist.change
    band[:, :] = 0.0
    change[:, :] = 0.0
    angles[0] = 0.0
    # Any director will do: what differs at the first Gauss point differs everywhere.
    for k in range(3):
        fresh[0, 6 + k] = twist.frames[0, 6 + k]
    transport_frames(axes, tables, twist, state.x, p, fresh)
    f, old = fresh[0], twist.frames[0]
    offset = _compute_angle(f[0], f[1], f[2], f[6], f[7], f[8], old[6], old[7], old[8])
    for row in range(fresh.shape[0]):
        f = fresh[row]
        f[6], f[7], f[8] = _turn(f[0], f[1], f[2], f[6], f[7], f[8], offset)
    for row in range(fresh.shape[0]):
        f = fresh[row]
        old = twist.frames[row]
        angle = _compute_angle(f[0], f[1], f[2], f[6], f[7], f[8], old[6], old[7], old[8])
        if row < 3 * n_spans:
            e, g = row // 3, row % 3
            angles[row] = _unwrap(angle, angles[max(row - 1, 0)])
            length = tables.span_length
            _add_fit(e, tables.value[e, g], 1.0, angles[row], band, change)
            _add_fit(e, tables.first[e, g], length * length, old[9], band, change)
        else:
            clamp = row - 3 * n_spans
            angle = _unwrap(angle, angles[_find_gauss_point(tables, n_spans, twist.places[clamp])])
            at = twist.turn_rows[clamp]
            _add_fit(
                constraints.start[at] // 4, constraints.rows[at, 3::4], _STIFF, angle, band, change
            )
            constraints.before[at] += angle
            constraints.after[at] = constraints.before[at]
    factorize((0.0,), n, band)
    solve_lower((0.0,), n, band, change)
    solve_upper((0.0,), n, band, change[0])
    for j in range(n):
        state.x[4 * j + 3] += change[0, j]
        state.x_old[4 * j + 3] += change[0, j]
    for row in range(fresh.shape[0]):
        for k in range(fresh.shape[1]):
            twist.frames[row, k] = fresh[row, k]


@inlined
def _unwrap(angle, near):
    """The angle plus the whole turns that bring it closest to another one."""
    return angle + 2.0 * np.pi * np.round((near - angle) / (2.0 * np.pi))


@kernel
def _add_fit(start, values, weight, wanted, band, rhs):
    """Adds one line of a least-squares fit, sum_i values_i c_(start + i) = wanted."""
    for i in range(4):
        rhs[0, start + i] += weight * values[i] * wanted
        for j in range(i + 1):
            band[start + j, i - j] += weight * values[i] * values[j]


@kernel
def accept_frames(axes, hose, constraints, state, p):
    """Ends a step of a hose with theta: frames are reset if they have gathered too much.

    Else they stay where the last iterate has put them, but for those of the clamps.
    """
    twist = constraints.twist
    move_clamp_frames(axes, twist, state.x)
    for clamp in range(len(twist.starts)):
        at = twist.turn_rows[clamp]
        value = 0.0
        for k in range(constraints.rows.shape[1]):
            value += constraints.rows[at, k] * state.x[constraints.start[at] + k]
        constraints.before[at] = constraints.after[at] = value
        twist.spin[clamp, 0] = twist.spin[clamp, 1] = 0.0
    gathered = 0.0
    for f in range(3 * hose.tables.first.shape[0]):
        gathered = max(gathered, abs(twist.frames[f, 9]))
    if gathered * hose.tables.span_length > LARGEST_GATHERED:
        move_frames(axes, hose.tables, twist, state.x, p)
        reset_frames(axes, hose, constraints, state, p)
    _save_frames(twist)
