"""Contact of the spline with rigid shapes: a smoothed penalty and smoothed Coulomb friction.

The force per length of contact_law.py acts at contact points spread over the spans, all of it taken
at the end of the stage. In the matrix stand the parts that leave it positive semidefinite: the
slope of N along n, and for friction mu N / (h s) (1 - n n^T - (w v^T + v w^T) / 2) with
s = sqrt(u_t^2 + eps^2), v = u_t / s and w the same at the stage's base: close to the true
derivative while the hose slides or sticks, and stiff where the slip turns over within a step (the
idea of Chan, Golub, Mulet 1999). With `exact` also the curvature of the shape, which softens. Left
out is how friction grows with N: it is not symmetric.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.contact_law import (
    DAMPING,
    WIDTH,
    compute_force,
    evaluate,
    find_gap,
    is_skipped,
    is_span_near,
)
from hose_mj.hoses.geds.shapes import POSITION, SCALE
from hose_mj.jit import compiled, inlined, kernel


@kernel
def _relate(velocity, surface):  # type: ignore[no-untyped-def]
    return velocity[0] - surface[0], velocity[1] - surface[1], velocity[2] - surface[2]


@inlined
def add_contact(axes, contact, x, rate, base, step, exact, gradient, band):  # type: ignore[no-untyped-def]
    """Adds contact to the residual and its matrix; returns how many contact points touch.

    Nine arguments, as in `energy.assemble`, which it follows.

    Args:
        axes: (0.0,) * d.
        contact: what may be touched.
        x: control points, flat.
        rate: their velocity.
        base: their velocity before the stage.
        step: the stage's length (s); where it is infinite (statics) nothing rubs.
        exact: whether the curvature of shapes enters the matrix.
        gradient: added to.
        band: added to.
    """
    touching = 0
    d = len(axes)
    n_spans = len(x) // d - 3
    per_span = contact.points.shape[0] // n_spans
    first = -1 if contact.given.shape[0] > 0 else 0
    for e in range(n_spans):
        start = e * d
        for g in range(first, contact.geoms.shape[0]):
            if not is_span_near(axes, contact, e, g, x):
                continue
            for q in range(e * per_span, (e + 1) * per_span):
                if is_skipped(contact, q, g):
                    continue
                gap, normal, bend, friction, surface = find_gap(axes, contact, q, g, start, x)
                if gap >= contact.law[WIDTH]:
                    continue
                velocity = evaluate(axes, contact.points, q, start, rate)
                if step == np.inf:
                    velocity = surface
                relative = _relate(velocity, surface)
                scale = contact.geoms[g, SCALE] if g >= 0 else 1.0
                force, N, slope, slip, s = compute_force(
                    contact.law, scale, gap, normal, friction, relative
                )
                if N == 0.0:
                    continue
                touching += 1
                matrix = press(normal, slope * (1.0 + contact.law[DAMPING] / step))
                if exact:
                    matrix = _soften(matrix, normal, bend, N)
                if friction > 0.0 and step < np.inf:
                    before = _relate(evaluate(axes, contact.points, q, start, base), surface)
                    _, _, _, usual, _ = compute_force(
                        contact.law, scale, gap, normal, friction, before
                    )
                    matrix = _rub(matrix, normal, slip, usual, friction * N / (step * s))
                share = contact.points[q, 4]
                force, matrix = _scale3(share, force), _scale6(share, matrix)
                scatter(axes, contact.points, q, start, force, matrix, gradient, band)
    return touching


@kernel
def _scale3(c, v):  # type: ignore[no-untyped-def]
    return c * v[0], c * v[1], c * v[2]


@kernel
def _scale6(c, m):  # type: ignore[no-untyped-def]
    return c * m[0], c * m[1], c * m[2], c * m[3], c * m[4], c * m[5]


@kernel
def press(n, stiffness):  # type: ignore[no-untyped-def]
    """stiffness n n^T as (00, 11, 22, 01, 02, 12)."""
    return (
        stiffness * n[0] * n[0],
        stiffness * n[1] * n[1],
        stiffness * n[2] * n[2],
        stiffness * n[0] * n[1],
        stiffness * n[0] * n[2],
        stiffness * n[1] * n[2],
    )


@kernel
def _soften(m, n, bend, N):  # type: ignore[no-untyped-def]
    """Subtracts N times the Hessian of the distance."""
    (across, along), a = bend
    c = N * across
    r = N * (along - across)
    return (
        m[0] - c * (1.0 - n[0] * n[0]) - r * a[0] * a[0],
        m[1] - c * (1.0 - n[1] * n[1]) - r * a[1] * a[1],
        m[2] - c * (1.0 - n[2] * n[2]) - r * a[2] * a[2],
        m[3] + c * n[0] * n[1] - r * a[0] * a[1],
        m[4] + c * n[0] * n[2] - r * a[0] * a[2],
        m[5] + c * n[1] * n[2] - r * a[1] * a[2],
    )


@kernel
def _rub(m, n, v, w, c):  # type: ignore[no-untyped-def]
    """Adds c (1 - n n^T - (v w^T + w v^T) / 2)."""
    return (
        m[0] + c * (1.0 - n[0] * n[0] - v[0] * w[0]),
        m[1] + c * (1.0 - n[1] * n[1] - v[1] * w[1]),
        m[2] + c * (1.0 - n[2] * n[2] - v[2] * w[2]),
        m[3] - c * (n[0] * n[1] + 0.5 * (v[0] * w[1] + v[1] * w[0])),
        m[4] - c * (n[0] * n[2] + 0.5 * (v[0] * w[2] + v[2] * w[0])),
        m[5] - c * (n[1] * n[2] + 0.5 * (v[1] * w[2] + v[2] * w[1])),
    )


@kernel
def scatter(axes, points, q, start, force, m, gradient, band):  # type: ignore[no-untyped-def]
    """Adds a force at contact point q and its stiffness m to the span's unknowns."""
    d = len(axes)
    n_coordinates = len(axes[:3])
    rows = ((m[0], m[3], m[4]), (m[3], m[1], m[5]), (m[4], m[5], m[2]))
    for i in range(4):
        for c in range(n_coordinates):
            gradient[start + i * d + c] -= points[q, i] * force[c]
        for j in range(i + 1):
            weight = points[q, i] * points[q, j]
            column = start + j * d
            for c1 in range(n_coordinates):
                for c2 in range(n_coordinates if j < i else c1 + 1):
                    band[column + c2, (i - j) * d + c1 - c2] += weight * rows[c1][c2]


@compiled
def compute_forces(axes, contact, x, v, forces, reactions):  # type: ignore[no-untyped-def]
    """Contact forces at the state (x, v), flat.

    Writes the force on the hose at each contact point (Q, 3), N, and what the hose does to each
    geom, (G, 6): force (N) and moment about the geom's position (N m), of forces that act at the
    hose's centre line. In the hose's coordinates.
    """
    d = len(axes)
    n_spans = len(x) // d - 3
    per_span = contact.points.shape[0] // n_spans
    first = -1 if contact.given.shape[0] > 0 else 0
    forces[:, :] = 0.0
    reactions[:, :] = 0.0
    for g in range(first, contact.geoms.shape[0]):
        for e in range(n_spans):
            start = e * d
            if not is_span_near(axes, contact, e, g, x):
                continue
            for q in range(e * per_span, (e + 1) * per_span):
                if is_skipped(contact, q, g):
                    continue
                gap, normal, _, friction, surface = find_gap(axes, contact, q, g, start, x)
                velocity = evaluate(axes, contact.points, q, start, v)
                relative = _relate(velocity, surface)
                scale = contact.geoms[g, SCALE] if g >= 0 else 1.0
                force = compute_force(contact.law, scale, gap, normal, friction, relative)[0]
                weight = contact.points[q, 4]
                for c in range(3):
                    forces[q, c] += weight * force[c]
                if g < 0:
                    continue
                point = evaluate(axes, contact.points, q, start, x)
                for c in range(3):
                    c1, c2 = (c + 1) % 3, (c + 2) % 3
                    arm1 = point[c1] - contact.geoms[g, POSITION + c1]
                    arm2 = point[c2] - contact.geoms[g, POSITION + c2]
                    reactions[g, c] -= weight * force[c]
                    reactions[g, 3 + c] -= weight * (arm1 * force[c2] - arm2 * force[c1])
