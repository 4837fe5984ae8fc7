"""`FluidLoad`: what a fluid does to one hose: buoyancy, the current at its Gauss points, drag."""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.fluid import Fluid
from hose_mj.hoses.geds.basis import Tables
from hose_mj.hoses.geds.morison import Morison, compute_drag
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec


class FluidLoad:
    """A fluid about a hose, or none.

    It remembers nothing: the current is found anew from where the hose is.

    Args:
        spline: the hose's geometry.
        spec: the hose.
        tables: its quadrature.
        fluid: None for none.

    Attributes:
        morison: what the kernels read.
        moves: whether the fluid flows, or may flow.
        is_field: whether its velocity depends on the place.

    Raises:
        InputError: a current that leaves the plane of a planar hose.
    """

    def __init__(self, spline: Spline, spec: HoseSpec, tables: Tables, fluid: Fluid | None) -> None:
        self._spline, self._fluid = spline, fluid
        self._displaced = 0.0 if fluid is None else fluid.density * np.pi * spec.outer_radius**2
        n_points = 0 if fluid is None else tables.first.shape[0] * 3
        share = np.tile(tables.weights * tables.span_length, n_points // 3)
        points, slopes = (
            np.column_stack([rows.reshape(-1, 4)[:n_points], share])
            for rows in (tables.value, tables.first)
        )
        current = np.zeros((n_points, 3))
        self.moves = self.is_field = fluid is not None and callable(fluid.velocity)
        across = along = added = 0.0
        if fluid is not None:
            across = fluid.density * spec.outer_radius * fluid.normal_drag
            along = fluid.density * spec.outer_radius * np.pi * fluid.tangential_drag
            added = fluid.added_mass * self._displaced
        block = np.zeros((10, 6))
        self.morison = Morison(points, slopes, current, block, across, along, added)
        if fluid is not None and not self.is_field:
            self._set(fluid.compute_velocities(current))
            self.moves = bool(np.any(current))

    def compute_buoyancy(self, gravity: Array) -> Array:
        """Generalised force of the fluid's pressure on the control points, flat (n d,), N."""
        knots = self._spline.knots
        share = (knots[4:] - knots[:-4]) / 4.0  # the integral of N_i
        return -self._displaced * self._spline.from_world(np.outer(share, gravity))

    def update(self, x: Array) -> None:
        """Finds the current where control points x, flat, have the hose.

        Raises:
            InputError: velocities that are not finite, of another shape or out of the hose's plane.
        """
        if self.is_field and self._fluid is not None:
            windows = self._spline.to_world(x)[self._list_windows()]
            places = np.einsum("qi,qic->qc", self.morison.points[:, :4], windows)
            self._set(self._fluid.compute_velocities(places + self._spline.offset))

    def compute_drag(self, x: Array) -> tuple[Array, Array]:
        """Drag on a hose at rest at x, flat: generalised force (n d,), N, and its derivative by x.

        The derivative (n d, n d) is not symmetric; that of a current by the place is left out.
        """
        self.update(x)
        force, by_slope, _ = compute_drag(self.morison, self._pad(x))
        n, d = self._spline.n_control_points, self._spline.dimension
        drag, weights = np.zeros((n, self._spline.n_dof)), self._weigh()
        np.add.at(drag[:, :d], self._list_windows(), weights[:, :, None] * force[:, None, :d])
        return drag.ravel(), self._gather(by_slope, self.morison.slopes[:, :4])

    def compute_added_mass(self, x: Array) -> Array:
        """What the fluid adds to the mass matrix (n d, n d), kg, at x, flat."""
        across = compute_drag(self.morison, self._pad(x))[2]
        return self._gather(self.morison.added * across, self.morison.points[:, :4])

    def _list_windows(self) -> np.ndarray:
        """Numbers of the four control points of each Gauss point, (Q, 4)."""
        return np.arange(len(self.morison.points))[:, None] // 3 + np.arange(4)

    def _weigh(self) -> Array:
        """N_i times the share of arc length at each Gauss point, (Q, 4), m."""
        return self.morison.points[:, :4] * self.morison.points[:, 4:]

    def _pad(self, x: Array) -> Array:
        """Control points (n, 3) in the hose's coordinates."""
        points = np.zeros((self._spline.n_control_points, 3))
        d = self._spline.dimension
        points[:, :d] = x.reshape(len(points), -1)[:, :d]
        return points

    def _gather(self, local: Array, basis: Array) -> Array:
        """The matrix (n d, n d) of values (Q, 3, 3) between N_i and `basis` (Q, 4)."""
        n, size, d = self._spline.n_control_points, self._spline.n_dof, self._spline.dimension
        blocks = np.einsum("qi,qcb,qj->qijcb", self._weigh(), local[:, :d, :d], basis)
        whole, at = np.zeros((n, n, size, size)), self._list_windows()
        np.add.at(whole[:, :, :d, :d], (at[:, :, None], at[:, None, :]), blocks)
        return whole.transpose(0, 2, 1, 3).reshape(n * size, n * size)

    def _set(self, velocities: Array) -> None:
        fastest = np.abs(velocities).argmax(axis=0)
        for velocity in velocities[fastest]:
            self._spline.check_in_plane("velocity of the fluid", velocity, 0.0)
        d, current = self._spline.dimension, self.morison.current
        current[:, :d] = velocities[:, self._spline.dims]
