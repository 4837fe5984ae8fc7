"""Morison's drag and added mass on the spline hose, at the Gauss points of its strain energy.

With u the hose's velocity less the fluid's, w its acceleration, t = r' / |r'| and P = 1 - t t^T,

    -f = cn |P u| P u + ct |u.t| (u.t) t + m P w

per rest length. In the matrix stand its derivatives by u and w, which are positive semidefinite;
left out is how f turns with t, which is not symmetric. Statics need that (`compute_drag`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.basis import Tables
from hose_mj.hoses.geds.span import LEAST_A
from hose_mj.hoses.protocol import Array
from hose_mj.jit import kernel


class Morison(NamedTuple):
    """A fluid as the kernels read it.

    Attributes:
        current: the fluid's velocity at the Gauss points in the hose's coordinates, (S, 3, 3),
            m/s; (0, 3, 3) without a fluid.
        across: cn = density d Cn / 2, N s^2/m^3.
        along: ct = density d pi Ct / 2, N s^2/m^3.
        added: m = Ca density A, kg/m.
    """

    current: Array
    across: float
    along: float
    added: float


@kernel
def add_fluid(axes, tables, fluid, h, V, x, rate, p, gradient, band):
    """Adds drag and added mass to the residual and its matrix in a stage of length h from V.

    Args:
        axes: (0.0,) * d.
        tables: quadrature.
        fluid: `Morison`.
        h: length of the stage (s), finite.
        V: velocity that it begins with, flat (n d,).
        x: control points, flat.
        rate: their velocity (x - X) / h, flat.
        p: work arrays of a span.
        gradient: added to.
        band: added to.
    """
    d, n_places = len(axes), len(axes[:3])
    t, u, w = p.a[0], p.b[0], p.b[1]
    for e in range(fluid.current.shape[0]):
        for g in range(3):
            A = u_t = w_t = 0.0
            for c in range(n_places):
                t[c], u[c], w[c] = 0.0, -fluid.current[e, g, c], 0.0
                for i in range(4):
                    k = (e + i) * d + c
                    t[c] += tables.first[e, g, i] * x[k]
                    u[c] += tables.value[e, g, i] * rate[k]
                    w[c] += tables.value[e, g, i] * (rate[k] - V[k]) / h
                A += t[c] * t[c]
            length = np.sqrt(max(A, LEAST_A))
            for c in range(n_places):
                t[c] /= length
                u_t += u[c] * t[c]
                w_t += w[c] * t[c]
            speed = 0.0
            for c in range(n_places):
                u[c] -= u_t * t[c]
                w[c] -= w_t * t[c]
                speed += u[c] * u[c]
            speed = np.sqrt(speed)
            # Derivative by x: flat P + steep un un^T + slide t t^T, with un across the hose.
            flat = fluid.across * speed / h + fluid.added / (h * h)
            steep = fluid.across / (speed * h) if speed > 0.0 else 0.0
            slide = 2.0 * fluid.along * abs(u_t) / h
            share = tables.weights[g] * tables.span_length
            for c1 in range(n_places):
                force = fluid.across * speed * u[c1] + fluid.along * abs(u_t) * u_t * t[c1]
                p.force[g, 0, c1] = share * (force + fluid.added * w[c1])
                for c2 in range(c1 + 1):
                    D = (slide - flat) * t[c1] * t[c2] + steep * u[c1] * u[c2]
                    p.stiffness[c1, c2, g] = share * (D + (flat if c1 == c2 else 0.0))
        _scatter(axes, tables.value, e, p, gradient, band)


@kernel
def _scatter(axes, value, e, p, gradient, band):
    """Adds the forces at a span's Gauss points and their derivatives to gradient and band."""
    d = len(axes)
    for i in range(4):
        n0, n1, n2 = value[e, 0, i], value[e, 1, i], value[e, 2, i]
        for c in range(len(axes[:3])):
            f = n0 * p.force[0, 0, c] + n1 * p.force[1, 0, c] + n2 * p.force[2, 0, c]
            gradient[(e + i) * d + c] += f
        for j in range(i + 1):
            m0, m1, m2 = n0 * value[e, 0, j], n1 * value[e, 1, j], n2 * value[e, 2, j]
            for c1 in range(len(axes[:3])):
                for c2 in range(c1 + 1):
                    D = p.stiffness[c1, c2]
                    weight = m0 * D[0] + m1 * D[1] + m2 * D[2]
                    band[(e + j) * d + c2, (i - j) * d + c1 - c2] += weight
                    if j < i and c2 < c1:
                        band[(e + j) * d + c1, (i - j) * d + c2 - c1] += weight


def compute_drag(fluid: Morison, tables: Tables, points: Array) -> tuple[Array, Array, Array]:
    """Returns the drag on a hose at rest, how it changes with r', and P, at the Gauss points.

    Args:
        fluid: with its current.
        tables: quadrature.
        points: control points (n, 3) in the hose's coordinates, m.

    Returns:
        force (S, 3, 3), N/m, its derivative by r' (S, 3, 3, 3), by the last index, and the
        projection across the hose (S, 3, 3, 3).
    """
    windows = points[np.arange(len(tables.first))[:, None] + np.arange(4)]
    slope = np.einsum("sgi,sic->sgc", tables.first, windows)
    length = np.sqrt(np.maximum(np.sum(slope**2, axis=2, keepdims=True), LEAST_A))
    t, u = slope / length, fluid.current
    u_t = np.sum(u * t, axis=2, keepdims=True)
    un = u - u_t * t
    speed = np.linalg.norm(un, axis=2, keepdims=True)
    force = fluid.across * speed * un + fluid.along * np.abs(u_t) * u_t * t
    # By t: d(u.t) = un.dt and d un = -(un.dt) t - (u.t) dt, for a dt across t.
    ahead = un / np.maximum(speed, np.finfo(float).tiny)
    turn = (fluid.along * np.abs(u_t) - fluid.across * speed) * u_t
    outer = (2.0 * fluid.along * np.abs(u_t) - fluid.across * speed) * t
    outer = outer - fluid.across * u_t * ahead
    flat = np.eye(3) - t[..., :, None] * t[..., None, :]
    by_t = outer[..., :, None] * un[..., None, :] + turn[..., None] * np.eye(3)
    return force, by_t @ flat / length[..., None], flat
