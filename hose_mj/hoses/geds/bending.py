"""Bending of a hose that bends alike in every direction (thesis A.9-A.11, A.17).

With a = r', b = r'' (derivatives by rest arc length), A = a.a, B = b.b, C = a.b the energy per
length is W = EI/2 |kb|^2, kb = a x b / A the curvature vector of the material and
|kb|^2 = (A B - C^2) / A^2. No Frenet frame: smooth where the hose is straight. A rest curvature is
signed here, for a hose in a plane.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.span import compute_inverse_square
from hose_mj.jit import inlined


@inlined
def set_bending(axes, g, weight, exact, viscous, p):  # type: ignore[no-untyped-def]
    """Sets force and stiffness of Gauss point g to `weight` (EI times length) times bending.

    `exact` scales the Hessian of |kb|^2 / 2, `viscous` its Gauss-Newton part J^T J with
    J = (1 - t t^T) d kb, the change of kb that a turn of the tangent alone does not explain.
    """
    a = p.a
    b = p.b
    A = 0.0
    B = 0.0
    C = 0.0
    for c in range(len(axes)):
        A += a[g, c] * a[g, c]
        B += b[g, c] * b[g, c]
        C += a[g, c] * b[g, c]
    P, s, P2 = compute_inverse_square(A)
    P1 = 2.0 * s * P
    D = max(A * B - C * C, 0.0)
    for c in range(len(axes)):
        p.force[g, 0, c] = weight * (P * (B * a[g, c] - C * b[g, c]) + D * P1 * a[g, c])
        p.force[g, 1, c] = weight * P * (A * b[g, c] - C * a[g, c])
    # Coefficients of I, a a^T, a b^T, b a^T, b b^T in the blocks (a, a) and (a, b).
    both = weight * (exact + viscous) * P
    exact *= weight
    viscous *= weight * P
    aa_1 = exact * (B * P + D * P1) + viscous * (B + s * D)
    aa_aa = exact * (4.0 * B * P1 + 2.0 * D * P2) + viscous * (3.0 * s * B + 4.0 * s * s * D)
    aa_ab = -C * (2.0 * exact * P1 + viscous * s)
    aa_bb = -exact * P - viscous * (1.0 + s * A)
    ab_aa = -2.0 * C * (exact * P1 + viscous * s)
    ab_ab = 2.0 * exact * (P + A * P1) + viscous * (1.0 + 2.0 * s * A)
    ab_ba = -exact * P
    for c1 in range(len(axes)):
        for c2 in range(c1 + 1):
            unit = 1.0 if c1 == c2 else 0.0
            aa = a[g, c1] * a[g, c2]
            ab = a[g, c1] * b[g, c2]
            ba = b[g, c1] * a[g, c2]
            bb = b[g, c1] * b[g, c2]
            entry = p.stiffness
            entry[c1, c2, g] = aa_1 * unit + aa_aa * aa + aa_ab * (ab + ba) + aa_bb * bb
            entry[c1, c2, 3 + g] = -both * C * unit + ab_aa * aa + ab_ab * ab + ab_ba * ba
            entry[c1, c2, 6 + g] = -both * C * unit + ab_aa * aa + ab_ab * ba + ab_ba * ab
            entry[c1, c2, 9 + g] = both * (A * unit - aa)


@inlined
def add_bending_viscosity(axes, g, weight, p):  # type: ignore[no-untyped-def]
    """Adds the viscous force of bending, `weight` (EI tau times length) J^T J (a_rate, b_rate)."""
    a = p.a
    b = p.b
    u = p.a_rate
    v = p.b_rate
    A = 0.0
    B = 0.0
    C = 0.0
    a_u = 0.0
    b_u = 0.0
    a_v = 0.0
    b_v = 0.0
    for c in range(len(axes)):
        A += a[g, c] * a[g, c]
        B += b[g, c] * b[g, c]
        C += a[g, c] * b[g, c]
        a_u += a[g, c] * u[g, c]
        b_u += b[g, c] * u[g, c]
        a_v += a[g, c] * v[g, c]
        b_v += b[g, c] * v[g, c]
    P, s, _ = compute_inverse_square(A)
    D = max(A * B - C * C, 0.0)
    weight *= P
    aa_1 = B + s * D
    aa_aa = 3.0 * s * B + 4.0 * s * s * D
    aa_ab = -s * C
    aa_bb = -1.0 - s * A
    ab_aa = -2.0 * s * C
    ab_ab = 1.0 + 2.0 * s * A
    on_a = aa_aa * a_u + aa_ab * b_u + ab_aa * a_v + ab_ab * b_v
    on_b = aa_ab * a_u + aa_bb * b_u
    for c in range(len(axes)):
        p.force[g, 0, c] += weight * (
            aa_1 * u[g, c] - C * v[g, c] + on_a * a[g, c] + on_b * b[g, c]
        )
        p.force[g, 1, c] += weight * (
            A * v[g, c] - C * u[g, c] + (ab_aa * a_u - a_v) * a[g, c] + ab_ab * a_u * b[g, c]
        )


@inlined
def add_rest_curvature(g, weight, exact, p):  # type: ignore[no-untyped-def]
    """Adds `weight` (minus EI kappa_0 times length) times the signed curvature (planar hose)."""
    a = (p.a[g, 0], p.a[g, 1])
    b = (p.b[g, 0], p.b[g, 1])
    A = a[0] * a[0] + a[1] * a[1]
    P, s, P2 = compute_inverse_square(A)
    n = a[0] * b[1] - a[1] * b[0]
    u = np.sqrt(P)
    u1 = s * u
    u2 = (0.5 * P2 - u1 * u1) / u
    by_a = (b[1], -b[0])
    by_b = (-a[1], a[0])
    for c1 in range(2):
        p.force[g, 0, c1] += weight * (u * by_a[c1] + 2.0 * u1 * n * a[c1])
        p.force[g, 1, c1] += weight * u * by_b[c1]
        for c2 in range(c1 + 1):
            unit = 1.0 if c1 == c2 else 0.0
            turn = float(c2 - c1)
            pair = by_a[c1] * a[c2] + a[c1] * by_a[c2]
            curl = 4.0 * u2 * a[c1] * a[c2] + 2.0 * u1 * unit
            p.stiffness[c1, c2, g] += weight * exact * (2.0 * u1 * pair + n * curl)
            p.stiffness[c1, c2, 3 + g] += weight * exact * (u * turn + 2.0 * u1 * a[c1] * by_b[c2])
            p.stiffness[c1, c2, 6 + g] += weight * exact * (-u * turn + 2.0 * u1 * by_b[c1] * a[c2])
