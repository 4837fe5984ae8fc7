"""Strain energy of the hose, its gradient and Hessian (thesis A.9-A.11, A.17).

With a = r', b = r'' (derivatives by rest arc length):

* bending of a hose that bends alike in every direction: W = EI/2 |kb|^2 a length, with
  kb = a x b / |a|^2 the curvature vector of the material, at three Gauss points a span. With
  A = a.a, B = b.b, C = a.b it is |kb|^2 = (A B - C^2) / A^2. No Frenet frame: smooth where the hose
  is straight. A rest curvature is signed here, for a hose in a plane;
* twist: twist.py for that hose, rod.py (with theta as fourth unknown) for all others; frenet.py for
  the literal strain of GEDS, with theta as well;
* stretching: EA h/2 (mean of |a| - 1 over the span)^2. The mean instead of the pointwise strain
  removes membrane locking. In the first and the last span the linear mode of the strain is added;
  without it two axial modes would cost no energy.
* rest strains (thesis A.11) are subtracted.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.basis import find_kind
from hose_mj.hoses.geds.frames import move_clamp_frames
from hose_mj.hoses.geds.frenet import add_frenet, compute_frenet_energy
from hose_mj.hoses.geds.rod import compute_rod_strains, set_rod
from hose_mj.hoses.geds.span import (
    compute_derivatives,
    compute_inverse_square,
    compute_stretch,
    load_rates,
    load_span,
)
from hose_mj.hoses.geds.twist import add_twist, close_segments, open_segments
from hose_mj.jit import choose_by_unknowns, inlined, kernel


@kernel
def compute_strains(axes, tables, elasticity, x, p, strains):
    """Writes mean stretch strain and linear mode of each span, less the rest strain, (S, 2).

    The linear mode is kept at zero but in the first and last span.
    """
    n_spans = tables.first.shape[0]
    for e in range(n_spans):
        mean = -1.0 - elasticity.rest_strain[e]
        linear = 0.0
        for g in range(3):
            A = compute_derivatives(axes, tables, e, g, x, p.a, p.b)[0]
            stretch = tables.weights[g] * compute_stretch(A)[0]
            mean += stretch
            linear += tables.linear[g] * stretch
        strains[e, 0] = mean
        strains[e, 1] = linear if e == 0 or e == n_spans - 1 else 0.0


@kernel
def compute_energy(axes, tables, elasticity, frames, x, p, strains):
    """Returns stretching, bending and, for a hose with theta, twisting energy (J).

    Overwrites `strains` (S, 2) and moves the frames along.
    """
    compute_strains(axes, tables, elasticity, x, p, strains)
    stretching = 0.0
    bending = 0.0
    twisting = 0.0
    for e in range(tables.first.shape[0]):
        squares = strains[e, 0] ** 2 + strains[e, 1] ** 2
        stretching += 0.5 * elasticity.axial_stiffness[e] * tables.span_length * squares
        for g in range(3):
            A, B, C = compute_derivatives(axes, tables, e, g, x, p.a, p.b)
            half = 0.5 * tables.weights[g] * tables.span_length
            rest = elasticity.rest_curvature[e, g]
            if len(axes) == 4 and not elasticity.frenet:
                first, second, twist, _ = compute_rod_strains(frames, 3 * e + g, g, p)
                bending += half * elasticity.bending_stiffness[e, g] * (first - rest) ** 2
                bending += half * elasticity.second_stiffness[e, g] * second**2
                twist -= elasticity.rest_torsion[e, g]
                twisting += half * elasticity.torsional_stiffness[e, g] * twist**2
                continue
            square = max(A * B - C * C, 0.0) * compute_inverse_square(A)[0]
            if len(axes) == 2 and rest != 0.0:
                curvature = (p.a[g, 0] * p.b[g, 1] - p.a[g, 1] * p.b[g, 0]) * np.sqrt(
                    compute_inverse_square(A)[0]
                )
                square = (curvature - rest) ** 2
            bending += half * elasticity.bending_stiffness[e, g] * square
        if len(axes) == 4 and elasticity.frenet:
            twisting += compute_frenet_energy(tables, elasticity, e, p)
    return stretching, bending, twisting


@inlined
def _add_tension(axes, g, weight, tension, exact, p):
    """Adds force and, scaled by `exact`, geometric stiffness of a tension (N) at Gauss point g."""
    a = p.a
    slope = 2.0 * weight * tension * p.stretches[g, 1]
    unit = 2.0 * weight * exact * tension * p.stretches[g, 1]
    bend = 4.0 * weight * exact * tension * p.stretches[g, 2]
    for c1 in range(len(axes[:3])):
        p.force[g, 0, c1] += slope * a[g, c1]
        for c2 in range(c1 + 1):
            p.stiffness[c1, c2, g] += bend * a[g, c1] * a[g, c2] + (unit if c1 == c2 else 0.0)


@inlined
def _scatter(axes, tables, e, axial, has_linear_mode, p, gradient, band):
    """Adds the span's force to the gradient and its stiffness to the band."""
    d = len(axes)
    start = e * d
    for c in range(len(axes[:3])):
        _scatter_force(tables.first, tables.second, e, d, c, p, gradient)
    block = p.block
    q = tables.products
    kind = find_kind(tables.first.shape[0], e)
    s = p.stiffness
    for c1 in range(len(axes[:3])):
        for c2 in range(c1 + 1):
            s0, s1, s2, s3 = s[c1, c2, 0], s[c1, c2, 1], s[c1, c2, 2], s[c1, c2, 3]
            s4, s5, s6, s7 = s[c1, c2, 4], s[c1, c2, 5], s[c1, c2, 6], s[c1, c2, 7]
            s8, s9, s10, s11 = s[c1, c2, 8], s[c1, c2, 9], s[c1, c2, 10], s[c1, c2, 11]
            # One fused loop over a contiguous 16-vector: most of a step is spent here.
            for k in range(16):
                block[k] = (
                    (s0 * q[kind, 0, k] + s1 * q[kind, 1, k] + s2 * q[kind, 2, k])
                    + (s3 * q[kind, 3, k] + s4 * q[kind, 4, k] + s5 * q[kind, 5, k])
                    + (s6 * q[kind, 6, k] + s7 * q[kind, 7, k] + s8 * q[kind, 8, k])
                    + (s9 * q[kind, 9, k] + s10 * q[kind, 10, k] + s11 * q[kind, 11, k])
                )
            _add_outer(0, c1, c2, axial, p)
            if has_linear_mode:
                _add_outer(1, c1, c2, axial, p)
            _add_block(d, start, c1, c2, block, band)


@inlined
def _scatter_force(by_a, by_b, e, d, c, p, gradient):
    """Adds the force on unknown c of the span's control points, a and b made with these tables."""
    a0, a1, a2 = p.force[0, 0, c], p.force[1, 0, c], p.force[2, 0, c]
    b0, b1, b2 = p.force[0, 1, c], p.force[1, 1, c], p.force[2, 1, c]
    for i in range(4):
        along = a0 * by_a[e, 0, i] + a1 * by_a[e, 1, i] + a2 * by_a[e, 2, i]
        across = b0 * by_b[e, 0, i] + b1 * by_b[e, 1, i] + b2 * by_b[e, 2, i]
        gradient[(e + i) * d + c] += along + across


@inlined
def _add_block(d, start, c1, c2, block, band):
    """Adds the block (16,) of unknowns c1 >= c2 of four control points to the band."""
    for i in range(4):
        for j in range(i + 1):
            band[start + j * d + c2, (i - j) * d + c1 - c2] += block[4 * i + j]
    if c1 != c2:
        for j in range(1, 4):
            for i in range(j):
                band[start + i * d + c1, (j - i) * d + c2 - c1] += block[4 * i + j]


@inlined
def _scatter_turn(tables, e, p, band):
    """Adds the stiffness of theta, alone and with the place, to the band."""
    block = p.block
    q = tables.turn_products
    kind = find_kind(tables.first.shape[0], e)
    s = p.stiffness
    for c in range(3):
        s0, s1, s2, s3 = s[3, c, 0], s[3, c, 1], s[3, c, 2], s[3, c, 3]
        s4, s5, s6, s7, s8 = s[3, c, 4], s[3, c, 5], s[3, c, 6], s[3, c, 7], s[3, c, 8]
        for k in range(16):
            block[k] = (
                (s0 * q[kind, 0, k] + s1 * q[kind, 1, k] + s2 * q[kind, 2, k])
                + (s3 * q[kind, 3, k] + s4 * q[kind, 4, k] + s5 * q[kind, 5, k])
                + (s6 * q[kind, 6, k] + s7 * q[kind, 7, k] + s8 * q[kind, 8, k])
            )
        _add_block(4, 4 * e, 3, c, block, band)
    s0, s1, s2 = s[3, 3, 0], s[3, 3, 1], s[3, 3, 2]
    s3, s4, s5 = s[3, 3, 3], s[3, 3, 4], s[3, 3, 5]
    for k in range(16):
        block[k] = (s0 * q[kind, 9, k] + s1 * q[kind, 10, k] + s2 * q[kind, 11, k]) + (
            s3 * q[kind, 12, k] + s4 * q[kind, 13, k] + s5 * q[kind, 14, k]
        )
    _add_block(4, 4 * e, 3, 3, block, band)


@inlined
def _add_outer(mode, c1, c2, axial, p):
    """Adds a strain mode's rank-one stiffness to the block of coordinates c1, c2."""
    m0, m1 = p.modes[mode, c2, 0], p.modes[mode, c2, 1]
    m2, m3 = p.modes[mode, c2, 2], p.modes[mode, c2, 3]
    for i in range(4):
        along = axial * p.modes[mode, c1, i]
        p.block[4 * i] += along * m0
        p.block[4 * i + 1] += along * m1
        p.block[4 * i + 2] += along * m2
        p.block[4 * i + 3] += along * m3


@inlined
def _set_bending(axes, g, weight, exact, viscous, p):
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
def _add_bending_viscosity(axes, g, weight, p):
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
def _add_rest_curvature(g, weight, exact, p):
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


@inlined
def _set_isotropic(axes, elasticity, frames, e, g, weight, exact, step, p):
    """Sets force and stiffness of Gauss point g of a hose that bends alike in every direction."""
    tau = elasticity.damping_time
    bending = weight * elasticity.bending_stiffness[e, g]
    _set_bending(axes[:3], g, bending, exact, (1.0 - exact) + tau / step, p)
    if tau != 0.0:
        _add_bending_viscosity(axes[:3], g, bending * tau, p)
    if len(axes) == 2 and elasticity.rest_curvature[e, g] != 0.0:
        _add_rest_curvature(g, -bending * elasticity.rest_curvature[e, g], exact, p)


@inlined
def _set_turning(axes, elasticity, frames, e, g, weight, exact, step, p):
    """Sets force and stiffness of Gauss point g of a hose with theta."""
    if elasticity.frenet:
        _set_isotropic(axes, elasticity, frames, e, g, weight, exact, step, p)
    else:
        set_rod(elasticity, frames, e, g, weight, exact, step, p)


@inlined
def _add_turning(axes, hose, twist, e, rate, step, exact, x, p, gradient, band):
    """Adds what span e does to theta to the gradient and the band."""
    if hose.elasticity.frenet:
        add_frenet(hose.tables, hose.elasticity, e, rate, step, exact, p, gradient, band)
    else:
        _scatter_force(hose.tables.first, hose.tables.value, e, 4, 3, p, gradient)
        _scatter_turn(hose.tables, e, p, band)


@inlined
def _add_scalar(axes, hose, twist, e, rate, step, exact, x, p, gradient, band):
    """Adds the scalar twist of span e."""
    add_twist(axes, hose.tables, twist, e, exact, x, p)


@inlined
def _close_scalar(axes, hose, twist, progress, rate, step, x, gradient):
    """Adds the force of the scalar twist, now that its angle is known."""
    tau = hose.elasticity.damping_time
    close_segments(twist, np.isinf(step), progress, tau, rate, gradient)


@inlined
def _close_turning(axes, hose, twist, progress, rate, step, x, gradient):
    """Takes the frames at the clamps along."""
    if not hose.elasticity.frenet:
        move_clamp_frames(axes, twist, x)


_open_twist = choose_by_unknowns({3: open_segments})
_set_section = choose_by_unknowns({2: _set_isotropic, 3: _set_isotropic, 4: _set_turning})
_add_moment = choose_by_unknowns({3: _add_scalar})
_scatter_theta = choose_by_unknowns({4: _add_turning})
_close_twist = choose_by_unknowns({3: _close_scalar, 4: _close_turning})


@kernel
def assemble(axes, hose, twist, progress, x, rate, step, exact, p, gradient, band):
    """Adds strain energy and Kelvin-Voigt terms: dU + C rate to `gradient`, K + C / step to `band`.

    Many arguments, because one kernel serves every scheme and the statics.

    Args:
        axes: (0.0,) * d, see compiled.py.
        hose: tables and material constants (solver.Hose).
        twist: clamps, segments between them and frames; written.
        progress: of the clamps' spin, 0 to 1.
        x: unknowns, flat, (n d,).
        rate: their velocity, flat; read only where there is damping.
        step: the stage's time step (s); infinite in statics.
        exact: True for the Hessian, False for its positive semidefinite Gauss-Newton part.
        p: work arrays.
        gradient: (n d + 4 d,), added to.
        band: lower band, added to.
    """
    tables = hose.tables
    elasticity = hose.elasticity
    n_spans = tables.first.shape[0]
    tau = elasticity.damping_time
    scale = 1.0 if exact else 0.0
    _open_twist(axes, twist, x)
    for e in range(n_spans):
        load_span(axes, tables, e, x, p)
        has_linear_mode = e == 0 or e == n_spans - 1
        mean = -1.0 - elasticity.rest_strain[e]
        linear = 0.0
        for g in range(3):
            mean += tables.weights[g] * p.stretches[g, 0]
            linear += tables.weights[g] * tables.linear[g] * p.stretches[g, 0]
        mean_rate = 0.0
        linear_rate = 0.0
        if tau != 0.0:
            mean_rate, linear_rate = load_rates(axes, tables, e, rate, p)
        stiffness = elasticity.axial_stiffness[e]
        for g in range(3):
            weight = tables.weights[g] * tables.span_length
            _set_section(axes, elasticity, twist.frames, e, g, weight, scale, step, p)
            tension = stiffness * (mean + tau * mean_rate)
            if has_linear_mode:
                tension += stiffness * tables.linear[g] * (linear + tau * linear_rate)
            keep = 1.0 if exact or tension > 0.0 else 0.0
            _add_tension(axes, g, weight, tension, keep, p)
        _add_moment(axes, hose, twist, e, rate, step, scale, x, p, gradient, band)
        axial = stiffness * tables.span_length * (1.0 + tau / step)
        _scatter(axes, tables, e, axial, has_linear_mode, p, gradient, band)
        _scatter_theta(axes, hose, twist, e, rate, step, scale, x, p, gradient, band)
    _close_twist(axes, hose, twist, progress, rate, step, x, gradient)
