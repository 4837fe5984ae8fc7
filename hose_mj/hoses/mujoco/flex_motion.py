"""How a flex rod lies and moves at one moment: centre line, bending, energies, momentum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hose_mj.hoses.mujoco.chain_layout import turn_frame
from hose_mj.hoses.mujoco.flex_layout import FlexLayout, interpolate
from hose_mj.hoses.protocol import Array, Energies, Momentum


@dataclass(frozen=True)
class FlexMotion:
    """Vertices and their velocities, (N + 1, 3), m and m/s."""

    layout: FlexLayout
    vertices: Array
    velocities: Array

    def position(self, arc_lengths: Array) -> Array:
        """Points of the centre line (k, 3), m; beyond the ends the end edges go on straight."""
        return self._blend(self.vertices, arc_lengths)

    def velocity(self, arc_lengths: Array) -> Array:
        """Velocities of the centre line (k, 3), m/s."""
        return self._blend(self.velocities, arc_lengths)

    def edge_tangents(self) -> Array:
        """Unit tangents of the edges (N, 3)."""
        edges = np.diff(self.vertices, axis=0)
        return np.asarray(edges / np.linalg.norm(edges, axis=1, keepdims=True))

    def tangent(self, arc_lengths: Array) -> Array:
        """Unit tangents (k, 3): an edge's own, at a vertex the mean of its two neighbours."""
        tangents, slack = self.edge_tangents(), 1e-9 * self.layout.length
        before, _ = self.layout.locate(arc_lengths - slack)
        after, _ = self.layout.locate(arc_lengths + slack)
        total = tangents[before] + tangents[after]
        return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))

    def curvature(self, arc_lengths: Array) -> Array:
        """Angle at the inner vertices over the length they stand for (k,), 1/m."""
        tangents = self.edge_tangents()
        across = np.linalg.norm(np.cross(tangents[:-1], tangents[1:]), axis=1)
        along = np.einsum("ni,ni->n", tangents[:-1], tangents[1:])
        at_vertices = np.arctan2(across, along) / self.layout.hinges
        places = self.layout.nodes[1:-1]
        return np.maximum(interpolate(arc_lengths, places, at_vertices), 0.0)

    def twist(self, arc_lengths: Array) -> Array:
        """Zero: vertices have no angle about the tangent."""
        return np.zeros(len(arc_lengths))

    def frame(self, arc_length: float) -> Array:
        """The world's frame (4,) turned by the least rotation onto the tangent."""
        tangent = self.tangent(np.array([arc_length]))[0]
        return turn_frame(np.array([1.0, 0.0, 0.0, 0.0]), tangent)

    def stretch(self) -> Array:
        """Strain of the edges (N,)."""
        lengths = np.linalg.norm(np.diff(self.vertices, axis=0), axis=1)
        return np.asarray(lengths / self.layout.edges - 1.0)

    def energies(self, masses: Array, bending_stiffness: float, gravity: Array) -> Energies:
        """Energies (J).

        Bending is that of discrete elastic rods, EI / (2 l) |2 t1 x t2 / (1 + t1 . t2)|^2 with the
        length l that a vertex stands for (Bergou et al. 2008), which MuJoCo uses.
        """
        tangents = self.edge_tangents()
        along = np.einsum("ni,ni->n", tangents[:-1], tangents[1:])
        bends = 2.0 * (1.0 - along) / ((1.0 + along) * self.layout.hinges)
        return Energies(
            kinetic=float(masses @ (self.velocities**2).sum(axis=1)) / 2,
            stretching=0.0,
            bending=bending_stiffness * float(bends.sum()),
            twisting=0.0,
            gravitational=-float(masses @ self.vertices @ gravity),
        )

    def momentum(self, masses: Array) -> Momentum:
        """Linear and angular momentum about the world's origin."""
        linear = masses[:, None] * self.velocities
        return Momentum(linear.sum(axis=0), np.cross(self.vertices, linear).sum(axis=0))

    def _blend(self, values: Array, arc_lengths: Array) -> Array:
        edge, after = self.layout.locate(arc_lengths)
        return np.asarray((1 - after)[:, None] * values[edge] + after[:, None] * values[edge + 1])
