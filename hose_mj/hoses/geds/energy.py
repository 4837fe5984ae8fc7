"""Stretching and bending energy of the spline, their gradient and Hessian (thesis A.9-A.11, A.17).

With a = r', b = r'' (derivatives by rest arc length), A = a.a, B = b.b, C = a.b:

* bending: W = EI/2 |kb|^2 at three Gauss points of each span, kb = a x b / A the curvature vector
  of the material, |kb|^2 = (A B - C^2) / A^2. No Frenet frame: smooth where the hose is straight.
* stretching: EA h/2 (mean of |a| - 1 over the span)^2. The mean instead of the pointwise strain
  removes membrane locking. In the first and the last span the linear mode of the strain is added;
  without it two axial modes would cost no energy.
* rest strains (thesis A.11) are subtracted; the rest curvature is signed, for a hose in a plane.

Below |a| = 0.1 (compressed to a tenth) |a| and A are continued by polynomials that stay positive:
a control polygon folded onto itself has finite forces, and nothing changes for a hose in use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.compiled import compiled, kernel
from hose_mj.hoses.model import Array

SMALLEST_A = 0.01
"""A below which |a| and A are continued by polynomials."""


class Elasticity(NamedTuple):
    """What the strain energy needs of the material, per span so that a hose may vary.

    Attributes:
        axial_stiffness: EA (N), (S,).
        bending_stiffness: EI (N m^2), at the Gauss points, (S, 3).
        rest_strain: (S,).
        rest_curvature: (1/m), at the Gauss points, (S, 3).
        damping_time: Kelvin-Voigt tau (s).
    """

    axial_stiffness: Array
    bending_stiffness: Array
    rest_strain: Array
    rest_curvature: Array
    damping_time: float


class Span(NamedTuple):
    """Work arrays of one thread: one span and its three Gauss points.

    Attributes:
        a, b: r' and r'', (3, 3), Gauss point first.
        a_rate, b_rate: their rates of change, (3, 3).
        force: derivatives of the energy by a and by b, (3, 2, 3).
        stiffness: its second derivatives for coordinates (c1, c2), (3, 3, 12): by (a, a), (a, b),
            (b, a), (b, b) at each Gauss point, in the order of `Tables.products`.
        modes: derivatives of the mean and the linear strain by the control points, (2, 3, 4).
        stretches: |a| and its first two derivatives by A, (3, 3), Gauss point first.
        block: one pair of coordinates of the span's stiffness, (16,).
    """

    a: Array
    b: Array
    a_rate: Array
    b_rate: Array
    force: Array
    stiffness: Array
    modes: Array
    stretches: Array
    block: Array


@compiled
def make_span():  # type: ignore[no-untyped-def]
    """Returns work arrays for one thread."""
    return Span(
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 2, 3)),
        np.zeros((3, 3, 12)),
        np.zeros((2, 3, 4)),
        np.zeros((3, 3)),
        np.zeros(16),
    )


@kernel
def _stretch(A):  # type: ignore[no-untyped-def]
    """|a| and its first two derivatives by A."""
    if A >= SMALLEST_A:
        stretch = np.sqrt(A)
        slope = 0.5 * stretch / A
        return stretch, slope, -0.5 * slope / A
    root = np.sqrt(SMALLEST_A)
    u = A / SMALLEST_A
    return (
        root * (0.375 + u * (0.75 - 0.125 * u)),
        (0.75 - 0.25 * u) / root,
        -0.25 / (SMALLEST_A * root),
    )


@kernel
def _inverse_square(A):  # type: ignore[no-untyped-def]
    """P = 1 / A^2, s = P' / (2 P) and P'' (derivatives by A)."""
    if A >= SMALLEST_A:
        inverse = 1.0 / A
        square = inverse * inverse
        return square, -inverse, 6.0 * square * square
    # 1 / phi^2 with phi / SMALLEST_A = 1/3 + u^2 - u^3/3.
    u = A / SMALLEST_A
    inverse = 1.0 / (SMALLEST_A * (1.0 / 3.0 + u * u - u * u * u / 3.0))
    square = inverse * inverse
    slope = 2.0 * u - u * u
    bend = (2.0 - 2.0 * u) / SMALLEST_A
    return (
        square,
        -inverse * slope,
        square * (6.0 * square * slope * slope - 2.0 * inverse * bend),
    )


@kernel
def _derivatives(axes, tables, e, g, x, a, b):  # type: ignore[no-untyped-def]
    """Writes a[g] = r' and b[g] = r'' at Gauss point g of span e; returns A, B, C.

    Like all kernels here it indexes whole arrays: a slice would cost a reference count.
    """
    d = len(axes)
    f0, f1 = tables.first[e, g, 0], tables.first[e, g, 1]
    f2, f3 = tables.first[e, g, 2], tables.first[e, g, 3]
    s0, s1 = tables.second[e, g, 0], tables.second[e, g, 1]
    s2, s3 = tables.second[e, g, 2], tables.second[e, g, 3]
    A = 0.0
    B = 0.0
    C = 0.0
    for c in range(d):
        k = e * d + c
        x0, x1, x2, x3 = x[k], x[k + d], x[k + 2 * d], x[k + 3 * d]
        ac = f0 * x0 + f1 * x1 + f2 * x2 + f3 * x3
        bc = s0 * x0 + s1 * x1 + s2 * x2 + s3 * x3
        a[g, c] = ac
        b[g, c] = bc
        A += ac * ac
        B += bc * bc
        C += ac * bc
    return A, B, C


@kernel
def compute_strains(axes, tables, elasticity, x, p, strains):  # type: ignore[no-untyped-def]
    """Writes mean stretch strain and linear mode of each span, less the rest strain, (S, 2).

    The linear mode is kept at zero but in the first and last span.
    """
    n_spans = tables.first.shape[0]
    for e in range(n_spans):
        mean = -1.0 - elasticity.rest_strain[e]
        linear = 0.0
        for g in range(3):
            A = _derivatives(axes, tables, e, g, x, p.a, p.b)[0]
            stretch = tables.weights[g] * _stretch(A)[0]
            mean += stretch
            linear += tables.linear[g] * stretch
        strains[e, 0] = mean
        strains[e, 1] = linear if e == 0 or e == n_spans - 1 else 0.0


@kernel
def compute_energy(axes, tables, elasticity, x, p, strains):  # type: ignore[no-untyped-def]
    """Returns the stretching and the bending energy (J); overwrites `strains` (S, 2)."""
    compute_strains(axes, tables, elasticity, x, p, strains)
    stretching = 0.0
    bending = 0.0
    for e in range(tables.first.shape[0]):
        squares = strains[e, 0] ** 2 + strains[e, 1] ** 2
        stretching += 0.5 * elasticity.axial_stiffness[e] * tables.span_length * squares
        for g in range(3):
            A, B, C = _derivatives(axes, tables, e, g, x, p.a, p.b)
            square = max(A * B - C * C, 0.0) * _inverse_square(A)[0]
            rest = elasticity.rest_curvature[e, g]
            if len(axes) == 2 and rest != 0.0:
                curvature = (p.a[g, 0] * p.b[g, 1] - p.a[g, 1] * p.b[g, 0]) * np.sqrt(
                    _inverse_square(A)[0]
                )
                square = (curvature - rest) ** 2
            weight = tables.weights[g] * tables.span_length
            bending += 0.5 * elasticity.bending_stiffness[e, g] * weight * square
    return stretching, bending


@kernel
def _set_bending(axes, g, weight, exact, viscous, p):  # type: ignore[no-untyped-def]
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
    P, s, P2 = _inverse_square(A)
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


@kernel
def _add_bending_viscosity(axes, g, weight, p):  # type: ignore[no-untyped-def]
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
    P, s, _ = _inverse_square(A)
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


@kernel
def _add_rest_curvature(g, weight, exact, p):  # type: ignore[no-untyped-def]
    """Adds `weight` (minus EI kappa_0 times length) times the signed curvature (planar hose)."""
    a = (p.a[g, 0], p.a[g, 1])
    b = (p.b[g, 0], p.b[g, 1])
    A = a[0] * a[0] + a[1] * a[1]
    P, s, P2 = _inverse_square(A)
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


@kernel
def _add_tension(axes, g, weight, tension, exact, p):  # type: ignore[no-untyped-def]
    """Adds force and, scaled by `exact`, geometric stiffness of a tension (N) at Gauss point g."""
    a = p.a
    slope = 2.0 * weight * tension * p.stretches[g, 1]
    unit = 2.0 * weight * exact * tension * p.stretches[g, 1]
    bend = 4.0 * weight * exact * tension * p.stretches[g, 2]
    for c1 in range(len(axes)):
        p.force[g, 0, c1] += slope * a[g, c1]
        for c2 in range(c1 + 1):
            p.stiffness[c1, c2, g] += bend * a[g, c1] * a[g, c2] + (unit if c1 == c2 else 0.0)


@kernel
def _load_span(axes, tables, e, x, p):  # type: ignore[no-untyped-def]
    """Computes r', r'', |r'| and the derivatives of the two strain modes of span e."""
    for g in range(3):
        A = _derivatives(axes, tables, e, g, x, p.a, p.b)[0]
        stretch, slope, bend = _stretch(A)
        p.stretches[g, 0] = stretch
        p.stretches[g, 1] = slope
        p.stretches[g, 2] = bend
    for c in range(len(axes)):
        t0 = 2.0 * tables.weights[0] * p.stretches[0, 1] * p.a[0, c]
        t1 = 2.0 * tables.weights[1] * p.stretches[1, 1] * p.a[1, c]
        t2 = 2.0 * tables.weights[2] * p.stretches[2, 1] * p.a[2, c]
        l0, l1, l2 = tables.linear[0] * t0, tables.linear[1] * t1, tables.linear[2] * t2
        for i in range(4):
            f0, f1, f2 = tables.first[e, 0, i], tables.first[e, 1, i], tables.first[e, 2, i]
            p.modes[0, c, i] = t0 * f0 + t1 * f1 + t2 * f2
            p.modes[1, c, i] = l0 * f0 + l1 * f1 + l2 * f2


@kernel
def _load_rates(axes, tables, e, rate, p):  # type: ignore[no-untyped-def]
    """Computes the rates of r' and r'' at span e; returns those of the two strain modes."""
    mean = 0.0
    linear = 0.0
    for g in range(3):
        _derivatives(axes, tables, e, g, rate, p.a_rate, p.b_rate)
    for c in range(len(axes)):
        for i in range(4):
            speed = rate[(e + i) * len(axes) + c]
            mean += p.modes[0, c, i] * speed
            linear += p.modes[1, c, i] * speed
    return mean, linear


@kernel
def _scatter(axes, tables, e, axial, has_linear_mode, p, gradient, band):  # type: ignore[no-untyped-def]
    """Adds the span's force to the gradient and its stiffness to the band."""
    d = len(axes)
    start = e * d
    for c in range(d):
        a0, a1, a2 = p.force[0, 0, c], p.force[1, 0, c], p.force[2, 0, c]
        b0, b1, b2 = p.force[0, 1, c], p.force[1, 1, c], p.force[2, 1, c]
        for i in range(4):
            along = (
                a0 * tables.first[e, 0, i] + a1 * tables.first[e, 1, i] + a2 * tables.first[e, 2, i]
            )
            across = (
                b0 * tables.second[e, 0, i]
                + b1 * tables.second[e, 1, i]
                + b2 * tables.second[e, 2, i]
            )
            gradient[start + i * d + c] += along + across
    block = p.block
    q = tables.products
    s = p.stiffness
    for c1 in range(d):
        for c2 in range(c1 + 1):
            s0, s1, s2, s3 = s[c1, c2, 0], s[c1, c2, 1], s[c1, c2, 2], s[c1, c2, 3]
            s4, s5, s6, s7 = s[c1, c2, 4], s[c1, c2, 5], s[c1, c2, 6], s[c1, c2, 7]
            s8, s9, s10, s11 = s[c1, c2, 8], s[c1, c2, 9], s[c1, c2, 10], s[c1, c2, 11]
            # One fused loop over a contiguous 16-vector: most of a step is spent here.
            for k in range(16):
                block[k] = (
                    (s0 * q[e, 0, k] + s1 * q[e, 1, k] + s2 * q[e, 2, k])
                    + (s3 * q[e, 3, k] + s4 * q[e, 4, k] + s5 * q[e, 5, k])
                    + (s6 * q[e, 6, k] + s7 * q[e, 7, k] + s8 * q[e, 8, k])
                    + (s9 * q[e, 9, k] + s10 * q[e, 10, k] + s11 * q[e, 11, k])
                )
            _add_outer(0, c1, c2, axial, p)
            if has_linear_mode:
                _add_outer(1, c1, c2, axial, p)
            for i in range(4):
                for j in range(i + 1):
                    band[start + j * d + c2, (i - j) * d + c1 - c2] += block[4 * i + j]
            if c1 != c2:
                for j in range(1, 4):
                    for i in range(j):
                        band[start + i * d + c1, (j - i) * d + c2 - c1] += block[4 * i + j]


@kernel
def _add_outer(mode, c1, c2, axial, p):  # type: ignore[no-untyped-def]
    """Adds a strain mode's rank-one stiffness to the block of coordinates c1, c2."""
    m0, m1 = p.modes[mode, c2, 0], p.modes[mode, c2, 1]
    m2, m3 = p.modes[mode, c2, 2], p.modes[mode, c2, 3]
    for i in range(4):
        along = axial * p.modes[mode, c1, i]
        p.block[4 * i] += along * m0
        p.block[4 * i + 1] += along * m1
        p.block[4 * i + 2] += along * m2
        p.block[4 * i + 3] += along * m3


@kernel
def assemble(axes, tables, elasticity, x, rate, step, exact, p, gradient, band):  # type: ignore[no-untyped-def]
    """Adds strain energy and Kelvin-Voigt terms: dU + C rate to `gradient`, K + C / step to `band`.

    Ten arguments, because one kernel serves every scheme and the statics.

    Args:
        axes: (0.0,) * d, see compiled.py.
        tables: quadrature tables.
        elasticity: material constants.
        x: control points, flat, (n d,).
        rate: their velocity, flat; read only where there is damping.
        step: the stage's time step (s); infinite in statics.
        exact: True for the Hessian, False for its positive semidefinite Gauss-Newton part.
        p: work arrays.
        gradient: (n d + 4 d,), added to.
        band: lower band, added to.
    """
    n_spans = tables.first.shape[0]
    tau = elasticity.damping_time
    scale = 1.0 if exact else 0.0
    viscous = (1.0 - scale) + tau / step
    for e in range(n_spans):
        _load_span(axes, tables, e, x, p)
        has_linear_mode = e == 0 or e == n_spans - 1
        mean = -1.0 - elasticity.rest_strain[e]
        linear = 0.0
        for g in range(3):
            mean += tables.weights[g] * p.stretches[g, 0]
            linear += tables.weights[g] * tables.linear[g] * p.stretches[g, 0]
        mean_rate = 0.0
        linear_rate = 0.0
        if tau != 0.0:
            mean_rate, linear_rate = _load_rates(axes, tables, e, rate, p)
        stiffness = elasticity.axial_stiffness[e]
        for g in range(3):
            weight = tables.weights[g] * tables.span_length
            bending = weight * elasticity.bending_stiffness[e, g]
            _set_bending(axes, g, bending, scale, viscous, p)
            if tau != 0.0:
                _add_bending_viscosity(axes, g, bending * tau, p)
            if len(axes) == 2 and elasticity.rest_curvature[e, g] != 0.0:
                _add_rest_curvature(g, -bending * elasticity.rest_curvature[e, g], scale, p)
            tension = stiffness * (mean + tau * mean_rate)
            if has_linear_mode:
                tension += stiffness * tables.linear[g] * (linear + tau * linear_rate)
            keep = 1.0 if exact or tension > 0.0 else 0.0
            _add_tension(axes, g, weight, tension, keep, p)
        axial = stiffness * tables.span_length * (1.0 + tau / step)
        _scatter(axes, tables, e, axial, has_linear_mode, p, gradient, band)
