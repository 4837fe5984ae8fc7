"""One span of the spline at its three Gauss points: r', r'', |r'| and the two strain modes.

Below |r'| = 0.1 (compressed to a tenth) |r'| and A = r'.r' are continued by polynomials that stay
positive: a control polygon folded onto itself has finite forces, and nothing changes for a hose in
use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.jit import inlined, jitable

SMALLEST_A = 0.01
"""A below which |a| and A are continued by polynomials."""
LEAST_A = 1e-4
"""Where there is only a division by A, it counts as this at least: |r'| is a hundredth then."""
LEAST_SQUARE = 1e-12
"""Of a vector that is made a unit vector: below it there is no direction in it to be found."""
LEAST_TURN_ROOM = 1e-6
"""Least 1 + cosine of the smallest rotation between two tangents, which has no axis at half a turn;
within 0.1 degrees of that it is short of the rotation instead of infinite."""


class Elasticity(NamedTuple):
    """What the strain energy needs of the material, per span so that a hose may vary.

    Attributes:
        axial_stiffness: EA (N), (S,).
        bending_stiffness: EI about m1 (N m^2), at the Gauss points, (S, 3).
        second_stiffness: EI about m2, (S, 3).
        torsional_stiffness: GJ (N m^2), (S, 3).
        rest_strain: (S,).
        rest_curvature: (1/m), at the Gauss points, (S, 3).
        rest_torsion: (1/m), (S, 3).
        damping_time: Kelvin-Voigt tau (s).
        frenet: whether a hose with theta measures twist by the Frenet torsion (frenet.py).
    """

    axial_stiffness: Array
    bending_stiffness: Array
    second_stiffness: Array
    torsional_stiffness: Array
    rest_strain: Array
    rest_curvature: Array
    rest_torsion: Array
    damping_time: float
    frenet: bool = False


class Span(NamedTuple):
    """Work arrays of one thread: one span and its three Gauss points.

    Attributes:
        a, b: r' and r'', (3, 4), Gauss point first; the fourth entries are theta' and theta.
        a_rate, b_rate: their rates of change, (3, 4).
        force: derivatives of the energy by a and by b, (3, 2, 4).
        stiffness: its second derivatives for coordinates (c1, c2), (4, 4, 12), in the order of
            `Tables.products`: by (a, a), (a, b), (b, a), (b, b) at each Gauss point.
        directors: m1 and m2 at the Gauss point at hand, (2, 3).
        strains: derivatives of K1, K2 and the twist by a and by b, (3, 2, 4); for frenet.py those
            of the torsion and of its denominator by a, b and c.
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
    directors: Array
    strains: Array
    modes: Array
    stretches: Array
    block: Array


@jitable
def make_span():
    """Returns work arrays for one thread; plain Python where Python calls it."""
    return Span(
        np.zeros((3, 4)),
        np.zeros((3, 4)),
        np.zeros((3, 4)),
        np.zeros((3, 4)),
        np.zeros((3, 2, 4)),
        np.zeros((4, 4, 12)),
        np.zeros((2, 3)),
        np.zeros((3, 2, 4)),
        np.zeros((2, 3, 4)),
        np.zeros((3, 3)),
        np.zeros(16),
    )


@inlined
def compute_stretch(A):
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


@inlined
def compute_inverse_square(A):
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


@inlined
def compute_derivatives(axes, tables, e, g, x, a, b):
    """Writes a[g] = r' and b[g] = r'' at Gauss point g of span e; returns A, B, C.

    With four unknowns a control point, theta' and theta become the fourth entries of a and b.
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
    for c in range(len(axes[:3])):
        k = e * d + c
        x0, x1, x2, x3 = x[k], x[k + d], x[k + 2 * d], x[k + 3 * d]
        ac = f0 * x0 + f1 * x1 + f2 * x2 + f3 * x3
        bc = s0 * x0 + s1 * x1 + s2 * x2 + s3 * x3
        a[g, c] = ac
        b[g, c] = bc
        A += ac * ac
        B += bc * bc
        C += ac * bc
    if d == 4:
        k = 4 * e + 3
        x0, x1, x2, x3 = x[k], x[k + 4], x[k + 8], x[k + 12]
        a[g, 3] = f0 * x0 + f1 * x1 + f2 * x2 + f3 * x3
        b[g, 3] = (
            tables.value[e, g, 0] * x0
            + tables.value[e, g, 1] * x1
            + tables.value[e, g, 2] * x2
            + tables.value[e, g, 3] * x3
        )
    return A, B, C


@inlined
def load_span(axes, tables, e, x, p):
    """Computes r', r'', |r'| and the derivatives of the two strain modes of span e."""
    for g in range(3):
        A = compute_derivatives(axes, tables, e, g, x, p.a, p.b)[0]
        stretch, slope, bend = compute_stretch(A)
        p.stretches[g, 0] = stretch
        p.stretches[g, 1] = slope
        p.stretches[g, 2] = bend
    for c in range(len(axes[:3])):
        t0 = 2.0 * tables.weights[0] * p.stretches[0, 1] * p.a[0, c]
        t1 = 2.0 * tables.weights[1] * p.stretches[1, 1] * p.a[1, c]
        t2 = 2.0 * tables.weights[2] * p.stretches[2, 1] * p.a[2, c]
        l0, l1, l2 = tables.linear[0] * t0, tables.linear[1] * t1, tables.linear[2] * t2
        for i in range(4):
            f0, f1, f2 = tables.first[e, 0, i], tables.first[e, 1, i], tables.first[e, 2, i]
            p.modes[0, c, i] = t0 * f0 + t1 * f1 + t2 * f2
            p.modes[1, c, i] = l0 * f0 + l1 * f1 + l2 * f2


@inlined
def load_rates(axes, tables, e, rate, p):
    """Computes the rates of r' and r'' at span e; returns those of the two strain modes."""
    mean = 0.0
    linear = 0.0
    for g in range(3):
        compute_derivatives(axes, tables, e, g, rate, p.a_rate, p.b_rate)
    for c in range(len(axes[:3])):
        for i in range(4):
            speed = rate[(e + i) * len(axes) + c]
            mean += p.modes[0, c, i] * speed
            linear += p.modes[1, c, i] * speed
    return mean, linear
