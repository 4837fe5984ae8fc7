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
        self._spline, self._tables, self._fluid = spline, tables, fluid
        self._windows = np.arange(len(tables.first))[:, None] + np.arange(4)
        self._share = (tables.weights * tables.span_length)[:, None] * tables.value
        self._displaced = 0.0
        self.morison = Morison(np.zeros((0, 3, 3)), 0.0, 0.0, 0.0)
        self.moves = self.is_field = fluid is not None and callable(fluid.velocity)
        if fluid is None:
            return
        current, radius = np.zeros((len(tables.first), 3, 3)), spec.outer_radius
        self._displaced = fluid.density * np.pi * radius**2  # kg/m
        across = fluid.density * radius * fluid.normal_drag
        along = fluid.density * radius * np.pi * fluid.tangential_drag
        self.morison = Morison(current, across, along, fluid.added_mass * self._displaced)
        if not self.is_field:
            self._set(fluid.compute_velocities(current.reshape(-1, 3)))
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
            windows = self._spline.to_world(x)[self._windows]
            places = np.einsum("sgi,sic->sgc", self._tables.value, windows).reshape(-1, 3)
            self._set(self._fluid.compute_velocities(places + self._spline.offset))

    def compute_drag(self, x: Array) -> tuple[Array, Array]:
        """Drag on a hose at rest at x, flat: generalised force (n d,), N, and its derivative by x.

        The derivative (n d, n d) is not symmetric; that of a current by the place is left out.
        """
        self.update(x)
        force, by_slope, _ = compute_drag(self.morison, self._tables, self._pad(x))
        drag = np.zeros((self._spline.n_control_points, self._spline.n_dof))
        d = self._spline.dimension
        for e, part in enumerate(np.einsum("sgi,sgc->sic", self._share, force)):
            drag[e : e + 4, :d] += part[:, :d]
        return drag.ravel(), self._gather(by_slope, self._tables.first)

    def compute_added_mass(self, x: Array) -> Array:
        """What the fluid adds to the mass matrix (n d, n d), kg, at x, flat."""
        if self._fluid is None:
            return np.zeros((len(x), len(x)))
        across = compute_drag(self.morison, self._tables, self._pad(x))[2]
        return self._gather(self.morison.added * across, self._tables.value)

    def _pad(self, x: Array) -> Array:
        """Control points (n, 3) in the hose's coordinates."""
        points = np.zeros((self._spline.n_control_points, 3))
        d = self._spline.dimension
        points[:, :d] = x.reshape(len(points), -1)[:, :d]
        return points

    def _gather(self, local: Array, basis: Array) -> Array:
        """The matrix (n d, n d) of values (S, 3, 3, 3) between N_i and `basis` (S, 3, 4)."""
        n, size, d = self._spline.n_control_points, self._spline.n_dof, self._spline.dimension
        blocks = np.einsum("sgi,sgcb,sgj->sicjb", self._share, local, basis)
        whole = np.zeros((n, size, n, size))
        for e, block in enumerate(blocks):
            whole[e : e + 4, :d, e : e + 4, :d] += block[:, :d, :, :d]
        return whole.reshape(n * size, n * size)

    def _set(self, velocities: Array) -> None:
        fastest = np.abs(velocities).argmax(axis=0)
        for velocity in velocities[fastest]:
            self._spline.check_in_plane("velocity of the fluid", velocity, 0.0)
        d, current = self._spline.dimension, self.morison.current
        current[..., :d] = velocities.reshape(*current.shape[:2], 3)[..., self._spline.dims]
