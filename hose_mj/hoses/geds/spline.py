"""`Spline`: where a hose's control points lie in the world, and the curve they make (thesis A.1).

The kernels know a flat array of d coordinates per control point, d = 2 for a hose in a plane. This
class knows which world axes those are and how far the plane lies from the origin.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds import basis
from hose_mj.hoses.inputs import check_count, check_place, check_vector
from hose_mj.hoses.protocol import Array

PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
FEWEST_CONTROL_POINTS = 5
MOST_CONTROL_POINTS = 4096
"""Sanity bound of the constructor; cost is linear, so nothing breaks above it but patience."""


class Spline:
    """Knots, plane and place of one hose; it holds no control points.

    Args:
        n_control_points: n.
        length: rest length L (m).
        plane: None for space, or "xy", "xz", "yz".
        has_theta: True for a fourth unknown of a control point, the angle of the material.

    Attributes:
        n_control_points: n.
        length: L (m).
        knots: open-uniform over [0, L], (n + 4,).
        dims: the world axes of the d coordinates of a control point, ascending.
        axes: a zero for each unknown of a control point, which is how kernels know them.
        offset: world position (3,) m of the plane's origin; zero along `dims`.
        plane: the constructor's.

    Raises:
        InputError: a number of control points or a plane outside the valid set.
    """

    def __init__(
        self, n_control_points: int, length: float, plane: str | None, has_theta: bool = False
    ) -> None:
        n = check_count(
            "control_points", n_control_points, FEWEST_CONTROL_POINTS, MOST_CONTROL_POINTS
        )
        if plane is not None and (not isinstance(plane, str) or plane not in PLANES):
            raise InputError("plane", plane, f"None, {', '.join(PLANES)}")
        self.n_control_points = n
        self.length = length
        self.plane = plane
        self.knots = basis.make_knots(n, length)
        self.dims = list(PLANES[plane]) if plane else [0, 1, 2]
        self.axes = (0.0,) * (len(self.dims) + has_theta)
        self.offset = np.zeros(3)

    @property
    def dimension(self) -> int:
        """Coordinates per control point, d = 2 or 3."""
        return len(self.dims)

    @property
    def n_dof(self) -> int:
        """Unknowns per control point: d, or 4 with theta."""
        return len(self.axes)

    @property
    def has_theta(self) -> bool:
        """True where the fourth unknown of a control point is the angle of the material."""
        return self.n_dof == 4

    @property
    def size(self) -> int:
        """Unknowns of the hose."""
        return self.n_control_points * self.n_dof

    @cached_property
    def normal(self) -> Array:
        """Unit normal (3,) of a planar hose: positive moments about it turn dims[0] to dims[1]."""
        unit = np.eye(3)
        return np.cross(unit[self.dims[0]], unit[self.dims[1]])

    # -- between the world and the kernels -----------------------------------------------------

    def to_world(self, flat: Array) -> Array:
        """Returns the places in flat unknowns as vectors of the world (n, 3), without offset."""
        world = np.zeros((len(flat) // self.n_dof, 3))
        world[:, self.dims] = flat.reshape(-1, self.n_dof)[:, : self.dimension]
        return world

    def from_world(self, vectors: Array) -> Array:
        """Returns vectors of the world (n, 3) as flat unknowns, theta zero."""
        flat = np.zeros((len(vectors), self.n_dof))
        flat[:, : self.dimension] = vectors[:, self.dims]
        return flat.ravel()

    def compute_basis(self, arc_lengths: Array) -> tuple[np.ndarray, Array]:
        """Returns starts (k,) and basis values with two derivatives (k, 3, 4) at arc lengths (k,).

        A start is the index of the first of the unknowns that shape the hose there.
        """
        spans, values = basis.compute_basis(self.knots, arc_lengths)
        return spans * self.n_dof, values

    def evaluate(self, arc_lengths: Array, flat: Array, derivative: int = 0) -> Array:
        """Returns sum_i N_i(s) p_i, or its first or second derivative by s, in the world frame.

        Args:
            arc_lengths: (k,), m.
            flat: control points or their velocities.
            derivative: 0, 1 or 2.

        Returns:
            (k, 3), without the offset.
        """
        spans, values = basis.compute_basis(self.knots, arc_lengths)
        points = self.to_world(flat)[spans[:, None] + np.arange(4)]
        return np.asarray(np.einsum("ki,kid->kd", values[:, derivative], points))

    def evaluate_theta(self, arc_lengths: Array, flat: Array, derivative: int = 0) -> Array:
        """Returns theta (k,) or its derivative by s; zero for a hose without."""
        if not self.has_theta:
            return np.zeros(len(arc_lengths))
        spans, values = basis.compute_basis(self.knots, arc_lengths)
        points = flat[3::4][spans[:, None] + np.arange(4)]
        return np.asarray(np.einsum("ki,ki->k", values[:, derivative], points))

    def interpolate(self, arc_lengths: Array, points: Array) -> Array:
        """Returns flat unknowns of the spline through n points (n, 3), theta zero (thesis A.3)."""
        return self.from_world(basis.interpolate(self.knots, arc_lengths, points))

    def compute_jacobian(self, arc_lengths: Array, derivative: int = 0) -> Array:
        """Returns J_pr of thesis A.24 at arc lengths (l,): N_i(s_j), or a derivative, (n, l)."""
        spans, values = basis.compute_basis(self.knots, arc_lengths)
        jacobian = np.zeros((self.n_control_points, len(arc_lengths)))
        columns = np.arange(len(arc_lengths))
        for i in range(4):
            jacobian[spans + i, columns] = values[:, derivative, i]
        return jacobian

    # -- checks --------------------------------------------------------------------------------

    def compute_offset(self, points: Array) -> Array:
        """Returns the offset (3,) of the plane that points (k, 3) lie in.

        Raises:
            InputError: points of a planar hose that lie in no plane parallel to its own.
        """
        offset = np.array(points[0])
        offset[self.dims] = 0.0
        for point in points:
            self.check_in_plane("curve", point - offset, 1e-9 * self.length)
        return offset

    def check_in_plane(self, name: str, vector: Array, slack: float) -> None:
        """Raises `InputError` for a vector more than `slack` off the plane of a planar hose."""
        if self.dimension == 2 and abs(float(vector @ self.normal)) > slack:
            raise InputError(name, vector.tolist(), f"a vector in the hose's plane, {self.plane}")

    def check_along_normal(self, name: str, vector: Array) -> None:
        """Raises `InputError` for a vector that is not along the normal of a planar hose."""
        if self.dimension == 2 and np.any(vector[self.dims] != 0.0):
            valid = f"a vector along the normal of the hose's plane, {self.normal.tolist()}"
            raise InputError(name, vector.tolist(), valid)

    def check_place(self, arc_length: float) -> float:
        """Returns one arc length; raises `InputError` unless it is one number on the hose."""
        return check_place(arc_length, self.length)

    def check_position(self, position: ArrayLike) -> Array:
        """Returns a position (3,) m; raises `InputError` unless finite and in the hose's plane."""
        point = check_vector("position", position)
        self.check_in_plane("position", point - self.offset, 1e-9 * self.length)
        return point

    def check_direction(self, tangent: ArrayLike) -> Array:
        """Returns a unit vector (3,); raises `InputError` for zero or one out of the plane."""
        vector = check_vector("tangent", tangent)
        length = float(np.linalg.norm(vector))
        if length == 0.0:
            raise InputError("tangent", vector.tolist(), "a vector that is not zero")
        self.check_in_plane("tangent", vector / length, 1e-9)
        return vector / length
