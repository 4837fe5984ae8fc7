"""Morison's drag and added mass on the spline hose, at the Gauss points of its strain energy.

With u the hose's velocity less the fluid's, w its acceleration, t = r' / |r'| and P = 1 - t t^T,

    -f = cn |P u| P u + ct |u.t| (u.t) t + m P w

per rest length. In the matrix stand its derivatives by u and w, which are positive semidefinite;
left out is how f turns with t, which is not symmetric. Statics need that (`compute_drag`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.contact import gather, scatter_block
from hose_mj.hoses.geds.span import LEAST_A
from hose_mj.hoses.geds.touch import evaluate
from hose_mj.hoses.protocol import Array
from hose_mj.jit import kernel

TINY = 1e-100
"""Least speed (m/s) that anything is divided by: where it is 0, so is what is divided."""


class Morison(NamedTuple):
    """A fluid as the kernels read it, at Q Gauss points, three a span; none of them without one.

    Attributes:
        points: the four basis functions at each and its share of arc length (m), (Q, 5).
        slopes: their derivatives (1/m) and that share, (Q, 5).
        current: the fluid's velocity in the hose's coordinates, (Q, 3), m/s.
        block: stiffness of one span, for each pair of its control points, (10, 6), written.
        across: cn = density d Cn / 2, N s^2/m^3.
        along: ct = density d pi Ct / 2, N s^2/m^3.
        added: m = Ca density A, kg/m.
    """

    points: Array
    slopes: Array
    current: Array
    block: Array
    across: float
    along: float
    added: float


@kernel
def _split(v, t):
    """Parts of a vector along a unit vector t, one number, and across it, (3,)."""
    along = v[0] * t[0] + v[1] * t[1] + v[2] * t[2]
    return along, (v[0] - along * t[0], v[1] - along * t[1], v[2] - along * t[2])


@kernel
def add_fluid(axes, fluid, h, V, x, rate, gradient, band):
    """Adds drag and added mass to the residual and its matrix in a stage of length h from V.

    Args:
        axes: (0.0,) * d.
        fluid: `Morison`.
        h: length of the stage (s), finite.
        V: velocity that it begins with, flat (n d,).
        x: control points, flat.
        rate: their velocity (x - X) / h, flat.
        gradient: added to.
        band: added to.
    """
    cn, ct, m, current = fluid.across, fluid.along, fluid.added, fluid.current
    for e in range(len(current) // 3):
        start = e * len(axes)
        fluid.block[:, :] = 0.0
        for q in range(3 * e, 3 * e + 3):
            r = evaluate(axes, fluid.slopes, q, start, x)
            r_r = max(r[0] * r[0] + r[1] * r[1] + r[2] * r[2], LEAST_A)
            t = (r[0] / np.sqrt(r_r), r[1] / np.sqrt(r_r), r[2] / np.sqrt(r_r))
            v, v0 = (
                evaluate(axes, fluid.points, q, start, rate),
                evaluate(axes, fluid.points, q, start, V),
            )
            u = (v[0] - current[q, 0], v[1] - current[q, 1], v[2] - current[q, 2])
            slip, un = _split(u, t)
            _, wn = _split((v[0] - v0[0], v[1] - v0[1], v[2] - v0[2]), t)
            speed = np.sqrt(un[0] * un[0] + un[1] * un[1] + un[2] * un[2])
            skin = -ct * abs(slip) * slip
            force = (
                skin * t[0] - cn * speed * un[0] - m / h * wn[0],
                skin * t[1] - cn * speed * un[1] - m / h * wn[1],
                skin * t[2] - cn * speed * un[2] - m / h * wn[2],
            )
            # Less its derivative by x: flat P + steep un un^T + 2 ct |slip| t t^T / h.
            flat, steep = cn * speed / h + m / (h * h), cn / (h * max(speed, TINY))
            ahead = 2.0 * ct * abs(slip) / h - flat
            matrix = (
                flat + ahead * t[0] * t[0] + steep * un[0] * un[0],
                flat + ahead * t[1] * t[1] + steep * un[1] * un[1],
                flat + ahead * t[2] * t[2] + steep * un[2] * un[2],
                ahead * t[0] * t[1] + steep * un[0] * un[1],
                ahead * t[0] * t[2] + steep * un[0] * un[2],
                ahead * t[1] * t[2] + steep * un[1] * un[2],
            )
            gather(axes, fluid.points, fluid.block, q, start, force, matrix, gradient)
        scatter_block(axes, fluid.block, start, band)


def compute_drag(fluid: Morison, points: Array) -> tuple[Array, Array, Array]:
    """Returns the drag on a hose at rest, how it changes with r', and P, at the Gauss points.

    Args:
        fluid: with its current.
        points: control points (n, 3) in the hose's coordinates, m.

    Returns:
        force (Q, 3), N/m, its derivative by r' (Q, 3, 3), by the last index, and the projection
        across the hose (Q, 3, 3).
    """
    windows = points[np.arange(len(fluid.current))[:, None] // 3 + np.arange(4)]
    slope = np.einsum("qi,qic->qc", fluid.slopes[:, :4], windows)
    length = np.sqrt(np.maximum(np.sum(slope**2, axis=1, keepdims=True), LEAST_A))
    t, u = slope / length, fluid.current
    u_t = np.sum(u * t, axis=1, keepdims=True)
    un = u - u_t * t
    speed = np.linalg.norm(un, axis=1, keepdims=True)
    force = fluid.across * speed * un + fluid.along * np.abs(u_t) * u_t * t
    # By t: d(u.t) = un.dt and d un = -(un.dt) t - (u.t) dt, for a dt across t.
    turn = (fluid.along * np.abs(u_t) - fluid.across * speed) * u_t
    outer = (2.0 * fluid.along * np.abs(u_t) - fluid.across * speed) * t
    outer = outer - fluid.across * u_t * un / np.maximum(speed, TINY)
    flat = np.eye(3) - t[:, :, None] * t[:, None, :]
    by_t = outer[:, :, None] * un[:, None, :] + turn[:, :, None] * np.eye(3)
    return force, by_t @ flat / length[:, :, None], flat
