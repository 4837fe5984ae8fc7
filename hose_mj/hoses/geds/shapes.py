"""Signed distance from a point to MuJoCo's shapes, with outward normal and curvature.

A geom is one row of numbers, so that a whole scene crosses from Python in one array: its kind
(MuJoCo's mjtGeom), friction, bounding radius, and then size, position, rotation, velocity and
angular velocity as in geom_size, geom_xpos and geom_xmat, a factor on the contact's stiffness, and
the arc lengths between which the hose does not touch it. Distances are negative inside.
"""

from __future__ import annotations

import numpy as np

from hose_mj.jit import compiled, kernel

PLANE, SPHERE, CAPSULE, CYLINDER, BOX = 0, 2, 3, 5, 6
"""Kinds, the codes of MuJoCo's mjtGeom. The axis of plane, capsule and cylinder is the local z."""
KIND, FRICTION, BOUND = 0, 1, 2
SIZE, POSITION, ROTATION = 3, 6, 9
VELOCITY, SPIN, SCALE = 18, 21, 24
SKIP_FROM, SKIP_TO = 25, 26
ROW = 27
"""Columns of a geom's row, and how many there are; the rotation is stored row by row."""
_NO_AXIS = (0.0, 0.0, 0.0)


@kernel
def is_near(geoms, g, point, reach):
    """Whether a ball of radius `reach` about a point may touch geom g (its bounding sphere)."""
    d0 = point[0] - geoms[g, POSITION]
    d1 = point[1] - geoms[g, POSITION + 1]
    d2 = point[2] - geoms[g, POSITION + 2]
    if geoms[g, KIND] == PLANE:
        at = ROTATION
        return geoms[g, at + 2] * d0 + geoms[g, at + 5] * d1 + geoms[g, at + 8] * d2 < reach
    reach += geoms[g, BOUND]
    return d0 * d0 + d1 * d1 + d2 * d2 < reach * reach


@kernel
def measure(geoms, g, point):
    """Distance from geom g and its first two derivatives.

    Returns:
        distance, normal, (across, along), axis: the normal is the distance's gradient (3,), and its
        Hessian is across (1 - normal normal^T - axis axis^T) + along axis axis^T; an axis of zeros
        stands for a curvature alike in all directions.
    """
    d0 = point[0] - geoms[g, POSITION]
    d1 = point[1] - geoms[g, POSITION + 1]
    d2 = point[2] - geoms[g, POSITION + 2]
    at = ROTATION
    local = (
        geoms[g, at] * d0 + geoms[g, at + 3] * d1 + geoms[g, at + 6] * d2,
        geoms[g, at + 1] * d0 + geoms[g, at + 4] * d1 + geoms[g, at + 7] * d2,
        geoms[g, at + 2] * d0 + geoms[g, at + 5] * d1 + geoms[g, at + 8] * d2,
    )
    size = (geoms[g, SIZE], geoms[g, SIZE + 1], geoms[g, SIZE + 2])
    kind = geoms[g, KIND]
    if kind == BOX:
        distance, n, bend, a = _measure_box(size, local)
    elif kind == CYLINDER:
        distance, n, bend, a = _measure_cylinder(size, local)
    elif kind == PLANE:
        distance, n, bend, a = local[2], (0.0, 0.0, 1.0), (0.0, 0.0), _NO_AXIS
    else:
        half = size[1] if kind == CAPSULE else 0.0
        distance, n, bend, a = _measure_capsule(size[0], half, local)
    return distance, _turn(geoms, g, n), bend, _turn(geoms, g, a)


@kernel
def _turn(geoms, g, v):
    """A local vector in the world frame."""
    at = ROTATION
    return (
        geoms[g, at] * v[0] + geoms[g, at + 1] * v[1] + geoms[g, at + 2] * v[2],
        geoms[g, at + 3] * v[0] + geoms[g, at + 4] * v[1] + geoms[g, at + 5] * v[2],
        geoms[g, at + 6] * v[0] + geoms[g, at + 7] * v[1] + geoms[g, at + 8] * v[2],
    )


@kernel
def _measure_capsule(radius, half, q):
    """A capsule along z; a sphere is one without length."""
    z = q[2] - min(max(q[2], -half), half)
    far = np.sqrt(q[0] * q[0] + q[1] * q[1] + z * z)
    if far < 1e-12:
        # On the axis every direction across it is outward.
        return -radius, (1.0, 0.0, 0.0), (0.0, 0.0), _NO_AXIS
    inverse = 1.0 / far
    normal = (q[0] * inverse, q[1] * inverse, z * inverse)
    if z == 0.0 and half > 0.0:
        return far - radius, normal, (inverse, 0.0), (0.0, 0.0, 1.0)
    return far - radius, normal, (inverse, 0.0), _NO_AXIS


@kernel
def _measure_cylinder(size, q):
    """A cylinder along z of radius size[0] and half length size[1]."""
    far = np.sqrt(q[0] * q[0] + q[1] * q[1])
    inverse = 1.0 / max(far, 1e-12)
    out = (q[0] * inverse, q[1] * inverse) if far > 1e-12 else (1.0, 0.0)
    up = 1.0 if q[2] >= 0.0 else -1.0
    side = far - size[0]
    cap = abs(q[2]) - size[1]
    if side > 0.0 and cap > 0.0:
        distance = np.sqrt(side * side + cap * cap)
        lean = side / distance
        normal = (out[0] * lean, out[1] * lean, up * cap / distance)
        return distance, normal, (1.0 / distance, lean * inverse), (-out[1], out[0], 0.0)
    if side > cap:
        bend = inverse if far > 1e-12 else 0.0
        return side, (out[0], out[1], 0.0), (bend, 0.0), (0.0, 0.0, 1.0)
    return cap, (0.0, 0.0, up), (0.0, 0.0), _NO_AXIS


@kernel
def _measure_box(size, q):
    """A box of half lengths `size`: nearest face, edge or corner; inside, the nearest face."""
    o0 = abs(q[0]) - size[0]
    o1 = abs(q[1]) - size[1]
    o2 = abs(q[2]) - size[2]
    s0 = 1.0 if q[0] >= 0.0 else -1.0
    s1 = 1.0 if q[1] >= 0.0 else -1.0
    s2 = 1.0 if q[2] >= 0.0 else -1.0
    outside = (o0 > 0.0) + (o1 > 0.0) + (o2 > 0.0)
    if outside < 2:
        if o0 >= o1 and o0 >= o2:
            return o0, (s0, 0.0, 0.0), (0.0, 0.0), _NO_AXIS
        if o1 >= o2:
            return o1, (0.0, s1, 0.0), (0.0, 0.0), _NO_AXIS
        return o2, (0.0, 0.0, s2), (0.0, 0.0), _NO_AXIS
    e0, e1, e2 = max(o0, 0.0), max(o1, 0.0), max(o2, 0.0)
    distance = np.sqrt(e0 * e0 + e1 * e1 + e2 * e2)
    inverse = 1.0 / distance
    axis = _NO_AXIS
    if outside == 2:
        axis = (
            1.0 if o0 <= 0.0 else 0.0,
            1.0 if o1 <= 0.0 else 0.0,
            1.0 if o2 <= 0.0 else 0.0,
        )
    normal = (s0 * e0 * inverse, s1 * e1 * inverse, s2 * e2 * inverse)
    return distance, normal, (inverse, 0.0), axis


@compiled
def measure_points(geoms, g, points, distances, normals):
    """Writes the distances (k,) of points (k, 3) from geom g and the outward normals (k, 3)."""
    for k in range(points.shape[0]):
        point = (points[k, 0], points[k, 1], points[k, 2])
        distance, normal, _, _ = measure(geoms, g, point)
        distances[k] = distance
        for c in range(3):
            normals[k, c] = normal[c]
