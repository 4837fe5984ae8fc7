"""A Gauss point of a hose with a fourth unknown theta: bending on material directors, and twist.

Needed where the hose is curved or twisted at rest or bends unequally; elsewhere twist.py does it
for less. A reference director d at every Gauss point goes along with the tangent t by the smallest
rotation at every iterate (time-parallel frames), m is the twist rate that these frames have along
the hose, and the material directors are

    m1 = cos(theta) d + sin(theta) t x d,    m2 = t x m1.

Strains: K1 = kb . m1, K2 = kb . m2 with kb = a x b / A, and the twist tau = theta' + m. When the
tangent turns from t0 to t

    m = m0 - (t0 x t) . (t0' + t') / (1 + t0 . t),

whose derivatives at t0 = t are dm/da = kb / |a|, dm/db = 0. With stresses s1, s2, s3 and
W = s1 m1 + s2 m2, V = t x W, q = kb x t, sym(x, y) = x y^T + y x^T the second derivatives of the
strains, each times its stress, add up to

    aa: kb.W (-3 I / A + 9 a a^T / A^2) - 2 sym(a, b x W) / A^2 + sym(W, kb) / A
        - sym(q, V) / (2 A) - 3 s3 sym(t, kb) / (2 A)
    ab: -[W]x / A - 2 a (W x a)^T / A^2 + s3 [t]x / (2 A)
    a theta: (b x V - 2 (kb.V) a) / A,    b theta: V x a / A,    theta theta: -kb.W
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.span import LEAST_TURN_ROOM, SMALLEST_A
from hose_mj.jit import inlined

TANGENT, SLOPE, DIRECTOR, RATE = 0, 3, 6, 9
"""Where a row of the frames (F, 10) has t, t', d and m."""


@inlined
def compute_cosine_and_sine(angle):
    """Cosine and sine of an angle (rad) to the rounding of the angle, for less than two calls.

    Their power series about the nearest multiple of pi / 2.
    """
    quarter = np.round(angle * (2.0 / np.pi))
    r = angle - quarter * (0.5 * np.pi)
    q = r * r
    c = 1.0 - q / 182.0 * (1.0 - q / 240.0)
    c = 1.0 - q / 56.0 * (1.0 - q / 90.0 * (1.0 - q / 132.0 * c))
    c = 1.0 - q / 2.0 * (1.0 - q / 12.0 * (1.0 - q / 30.0 * c))
    s = 1.0 - q / 156.0 * (1.0 - q / 210.0)
    s = 1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0 * s))
    s = r * (1.0 - q / 6.0 * (1.0 - q / 20.0 * s))
    quadrant = quarter - 4.0 * np.floor(0.25 * quarter)
    if quadrant == 1.0 or quadrant == 3.0:
        c, s = -s, c
    if quadrant >= 2.0:
        c, s = -c, -s
    return c, s


@inlined
def move_frame(frames, f, a0, a1, a2, b0, b1, b2):
    """Takes frame f along to a new a = r' and b = r''; returns 1 / |a|."""
    inverse = 1.0 / np.sqrt(max(a0 * a0 + a1 * a1 + a2 * a2, SMALLEST_A))
    t0, t1, t2 = a0 * inverse, a1 * inverse, a2 * inverse
    along = t0 * b0 + t1 * b1 + t2 * b2
    s0, s1, s2 = (
        (b0 - along * t0) * inverse,
        (b1 - along * t1) * inverse,
        (b2 - along * t2) * inverse,
    )
    u0, u1, u2 = frames[f, 0], frames[f, 1], frames[f, 2]
    scale = 1.0 / max(1.0 + u0 * t0 + u1 * t1 + u2 * t2, LEAST_TURN_ROOM)
    v0, v1, v2 = frames[f, 3] + s0, frames[f, 4] + s1, frames[f, 5] + s2
    turn = (u1 * t2 - u2 * t1) * v0 + (u2 * t0 - u0 * t2) * v1 + (u0 * t1 - u1 * t0) * v2
    frames[f, 9] -= scale * turn
    d0, d1, d2 = frames[f, 6], frames[f, 7], frames[f, 8]
    factor = scale * (d0 * t0 + d1 * t1 + d2 * t2)
    frames[f, 6] = d0 - factor * (u0 + t0)
    frames[f, 7] = d1 - factor * (u1 + t1)
    frames[f, 8] = d2 - factor * (u2 + t2)
    frames[f, 0], frames[f, 1], frames[f, 2] = t0, t1, t2
    frames[f, 3], frames[f, 4], frames[f, 5] = s0, s1, s2
    return inverse


@inlined
def compute_rod_strains(frames, f, g, p):
    """Moves the frame of Gauss point g and returns K1, K2 and the twist there, and 1 / A.

    Writes their derivatives by (a, theta') and (b, theta) to p.strains, m1 and m2 to p.directors.
    """
    a0, a1, a2 = p.a[g, 0], p.a[g, 1], p.a[g, 2]
    b0, b1, b2 = p.b[g, 0], p.b[g, 1], p.b[g, 2]
    root = move_frame(frames, f, a0, a1, a2, b0, b1, b2)
    inverse = root * root
    t0, t1, t2 = frames[f, 0], frames[f, 1], frames[f, 2]
    d0, d1, d2 = frames[f, 6], frames[f, 7], frames[f, 8]
    cosine, sine = compute_cosine_and_sine(p.b[g, 3])
    u0 = cosine * d0 + sine * (t1 * d2 - t2 * d1)
    u1 = cosine * d1 + sine * (t2 * d0 - t0 * d2)
    u2 = cosine * d2 + sine * (t0 * d1 - t1 * d0)
    v0, v1, v2 = t1 * u2 - t2 * u1, t2 * u0 - t0 * u2, t0 * u1 - t1 * u0
    p.directors[0, 0], p.directors[0, 1], p.directors[0, 2] = u0, u1, u2
    p.directors[1, 0], p.directors[1, 1], p.directors[1, 2] = v0, v1, v2
    k0 = (a1 * b2 - a2 * b1) * inverse
    k1 = (a2 * b0 - a0 * b2) * inverse
    k2 = (a0 * b1 - a1 * b0) * inverse
    first = k0 * u0 + k1 * u1 + k2 * u2
    second = k0 * v0 + k1 * v1 + k2 * v2
    s = p.strains
    # K = kb . w: (b x w - 2 K a) / A by a, w x a / A by b, kb . (t x w) by theta.
    s[0, 0, 0] = (b1 * u2 - b2 * u1 - 2.0 * first * a0) * inverse
    s[0, 0, 1] = (b2 * u0 - b0 * u2 - 2.0 * first * a1) * inverse
    s[0, 0, 2] = (b0 * u1 - b1 * u0 - 2.0 * first * a2) * inverse
    s[0, 1, 0] = (u1 * a2 - u2 * a1) * inverse
    s[0, 1, 1] = (u2 * a0 - u0 * a2) * inverse
    s[0, 1, 2] = (u0 * a1 - u1 * a0) * inverse
    s[0, 1, 3] = second
    s[1, 0, 0] = (b1 * v2 - b2 * v1 - 2.0 * second * a0) * inverse
    s[1, 0, 1] = (b2 * v0 - b0 * v2 - 2.0 * second * a1) * inverse
    s[1, 0, 2] = (b0 * v1 - b1 * v0 - 2.0 * second * a2) * inverse
    s[1, 1, 0] = (v1 * a2 - v2 * a1) * inverse
    s[1, 1, 1] = (v2 * a0 - v0 * a2) * inverse
    s[1, 1, 2] = (v0 * a1 - v1 * a0) * inverse
    s[1, 1, 3] = -first
    s[2, 0, 0], s[2, 0, 1], s[2, 0, 2] = k0 * root, k1 * root, k2 * root
    s[2, 0, 3] = 1.0
    return first, second, p.a[g, 3] + frames[f, 9], inverse


@inlined
def set_rod(elasticity, frames, e, g, weight, exact, step, p):
    """Sets force and stiffness of Gauss point g of span e, Kelvin-Voigt terms included.

    Args:
        elasticity: material constants.
        frames: reference frames, (F, 10), moved along.
        e: span.
        g: Gauss point.
        weight: length that the point stands for (m).
        exact: 1.0 for the Hessian, 0.0 for its Gauss-Newton part.
        step: the stage's time step (s), infinite in statics.
        p: work arrays.
    """
    f = 3 * e + g
    first, second, twist, inverse = compute_rod_strains(frames, f, g, p)
    tau = elasticity.damping_time
    c0 = weight * elasticity.bending_stiffness[e, g]
    c1 = weight * elasticity.second_stiffness[e, g]
    c2 = weight * elasticity.torsional_stiffness[e, g]
    s0 = c0 * (first - elasticity.rest_curvature[e, g])
    s1 = c1 * second
    s2 = c2 * (twist - elasticity.rest_torsion[e, g])
    s = p.strains
    r0, r1, r2 = s0, s1, s2
    if tau != 0.0:
        for c in range(4):
            r0 += tau * c0 * (s[0, 0, c] * p.a_rate[g, c] + s[0, 1, c] * p.b_rate[g, c])
            r1 += tau * c1 * (s[1, 0, c] * p.a_rate[g, c] + s[1, 1, c] * p.b_rate[g, c])
            r2 += tau * c2 * s[2, 0, c] * p.a_rate[g, c]
        viscous = 1.0 + tau / step
        c0 *= viscous
        c1 *= viscous
        c2 *= viscous
    for c in range(4):
        p.force[g, 0, c] = r0 * s[0, 0, c] + r1 * s[1, 0, c] + r2 * s[2, 0, c]
        p.force[g, 1, c] = r0 * s[0, 1, c] + r1 * s[1, 1, c]
    q = p.stiffness
    for i in range(3):
        for j in range(i + 1):
            q[i, j, g] = (
                c0 * s[0, 0, i] * s[0, 0, j]
                + c1 * s[1, 0, i] * s[1, 0, j]
                + c2 * s[2, 0, i] * s[2, 0, j]
            )
            q[i, j, 3 + g] = c0 * s[0, 0, i] * s[0, 1, j] + c1 * s[1, 0, i] * s[1, 1, j]
            q[i, j, 6 + g] = c0 * s[0, 1, i] * s[0, 0, j] + c1 * s[1, 1, i] * s[1, 0, j]
            q[i, j, 9 + g] = c0 * s[0, 1, i] * s[0, 1, j] + c1 * s[1, 1, i] * s[1, 1, j]
    for j in range(3):
        q[3, j, g] = c2 * s[2, 0, j]
        q[3, j, 3 + g] = c0 * s[0, 1, 3] * s[0, 0, j] + c1 * s[1, 1, 3] * s[1, 0, j]
        q[3, j, 6 + g] = c0 * s[0, 1, 3] * s[0, 1, j] + c1 * s[1, 1, 3] * s[1, 1, j]
    q[3, 3, g] = c2
    q[3, 3, 3 + g] = c0 * s[0, 1, 3] ** 2 + c1 * s[1, 1, 3] ** 2
    if exact != 0.0:
        _add_second_derivatives(frames, f, g, s0, s1, s2, inverse, p)


@inlined
def _add_second_derivatives(frames, f, g, s0, s1, s2, inverse, p):
    """Adds what stresses s0, s1, s2 times the strains' second derivatives make (see above).

    `inverse` is 1 / A.
    """
    a0, a1, a2 = p.a[g, 0], p.a[g, 1], p.a[g, 2]
    b0, b1, b2 = p.b[g, 0], p.b[g, 1], p.b[g, 2]
    t0, t1, t2 = frames[f, 0], frames[f, 1], frames[f, 2]
    m = p.directors
    # W and V = t x W.
    w0, w1, w2 = (
        s0 * m[0, 0] + s1 * m[1, 0],
        s0 * m[0, 1] + s1 * m[1, 1],
        s0 * m[0, 2] + s1 * m[1, 2],
    )
    v0, v1, v2 = (
        s0 * m[1, 0] - s1 * m[0, 0],
        s0 * m[1, 1] - s1 * m[0, 1],
        s0 * m[1, 2] - s1 * m[0, 2],
    )
    k0 = (a1 * b2 - a2 * b1) * inverse
    k1 = (a2 * b0 - a0 * b2) * inverse
    k2 = (a0 * b1 - a1 * b0) * inverse
    bending = k0 * w0 + k1 * w1 + k2 * w2
    q0, q1, q2 = k1 * t2 - k2 * t1, k2 * t0 - k0 * t2, k0 * t1 - k1 * t0
    x0, x1, x2 = b1 * w2 - b2 * w1, b2 * w0 - b0 * w2, b0 * w1 - b1 * w0
    unit = -3.0 * bending * inverse
    aa = 9.0 * bending * inverse * inverse
    ax = -2.0 * inverse * inverse
    half = 0.5 * inverse
    # sym(W - 3 s3 t / 2, kb) / A in one.
    z0, z1, z2 = w0 - 1.5 * s2 * t0, w1 - 1.5 * s2 * t1, w2 - 1.5 * s2 * t2
    m = p.stiffness
    m[0, 0, g] += unit + aa * a0 * a0 + 2.0 * (ax * a0 * x0 + inverse * z0 * k0 - half * q0 * v0)
    m[1, 1, g] += unit + aa * a1 * a1 + 2.0 * (ax * a1 * x1 + inverse * z1 * k1 - half * q1 * v1)
    m[2, 2, g] += unit + aa * a2 * a2 + 2.0 * (ax * a2 * x2 + inverse * z2 * k2 - half * q2 * v2)
    m[1, 0, g] += (
        aa * a1 * a0
        + ax * (a1 * x0 + x1 * a0)
        + inverse * (z1 * k0 + k1 * z0)
        - half * (q1 * v0 + v1 * q0)
    )
    m[2, 0, g] += (
        aa * a2 * a0
        + ax * (a2 * x0 + x2 * a0)
        + inverse * (z2 * k0 + k2 * z0)
        - half * (q2 * v0 + v2 * q0)
    )
    m[2, 1, g] += (
        aa * a2 * a1
        + ax * (a2 * x1 + x2 * a1)
        + inverse * (z2 * k1 + k2 * z1)
        - half * (q2 * v1 + v2 * q1)
    )
    _add_mixed_derivatives(frames, f, g, s2, inverse, (w0, w1, w2), (v0, v1, v2), (k0, k1, k2), p)
    m[3, 3, 3 + g] -= bending


@inlined
def _add_mixed_derivatives(frames, f, g, s2, inverse, w, v, k, p):
    """Adds the second derivatives by a and b, and by theta with either; w = W, v = V, k = kb."""
    a0, a1, a2 = p.a[g, 0], p.a[g, 1], p.a[g, 2]
    b0, b1, b2 = p.b[g, 0], p.b[g, 1], p.b[g, 2]
    t0, t1, t2 = frames[f, 0], frames[f, 1], frames[f, 2]
    w0, w1, w2 = w
    v0, v1, v2 = v
    k0, k1, k2 = k
    y0, y1, y2 = w1 * a2 - w2 * a1, w2 * a0 - w0 * a2, w0 * a1 - w1 * a0
    ax = -2.0 * inverse * inverse
    half = 0.5 * inverse
    m = p.stiffness
    # [c]x with c = -W / A + s3 t / (2 A), row a, column b.
    c0 = half * s2 * t0 - inverse * w0
    c1 = half * s2 * t1 - inverse * w1
    c2 = half * s2 * t2 - inverse * w2
    m[0, 0, 3 + g] += ax * a0 * y0
    m[1, 1, 3 + g] += ax * a1 * y1
    m[2, 2, 3 + g] += ax * a2 * y2
    m[1, 0, 3 + g] += ax * a1 * y0 + c2
    m[2, 0, 3 + g] += ax * a2 * y0 - c1
    m[2, 1, 3 + g] += ax * a2 * y1 + c0
    m[0, 0, 6 + g] += ax * a0 * y0
    m[1, 1, 6 + g] += ax * a1 * y1
    m[2, 2, 6 + g] += ax * a2 * y2
    m[1, 0, 6 + g] += ax * a0 * y1 - c2
    m[2, 0, 6 + g] += ax * a0 * y2 + c1
    m[2, 1, 6 + g] += ax * a1 * y2 - c0
    along = k0 * v0 + k1 * v1 + k2 * v2
    m[3, 0, 3 + g] += (b1 * v2 - b2 * v1 - 2.0 * along * a0) * inverse
    m[3, 1, 3 + g] += (b2 * v0 - b0 * v2 - 2.0 * along * a1) * inverse
    m[3, 2, 3 + g] += (b0 * v1 - b1 * v0 - 2.0 * along * a2) * inverse
    m[3, 0, 6 + g] += (v1 * a2 - v2 * a1) * inverse
    m[3, 1, 6 + g] += (v2 * a0 - v0 * a2) * inverse
    m[3, 2, 6 + g] += (v0 * a1 - v1 * a0) * inverse
