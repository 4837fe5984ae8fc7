"""Where the vertices of a flex rod lie along the hose, what they weigh, what holds and loads them.

A vertex or an edge is there for each hold: an attachment holds a vertex, a clamp both vertices of
an edge. Between two holds edges are alike.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.mujoco.chain_layout import turn_frame
from hose_mj.hoses.protocol import Array, Energies, Hold, Momentum


@dataclass(frozen=True)
class FlexLayout:
    """N edges between N + 1 vertices.

    Attributes:
        length: of the hose (m).
        nodes: rest arc lengths of the vertices (N + 1,), m; beyond the hose at corrected ends.
    """

    length: float
    nodes: Array

    @classmethod
    def of_holds(
        cls, length: float, segments: int, holds: Sequence[Hold], *, clamp_correction: bool
    ) -> FlexLayout:
        """Returns the layout of about so many edges that holds ask for.

        A clamp inside the hose has an edge centred on it. An edge that begins at a clamped end
        would hold the hose half an edge too late; with `clamp_correction` it is centred on the end
        too, half of it beyond.

        Raises:
            InputError: holds less than half an edge apart, or as close to a free end.
        """
        ends = (0.0, length)
        clamps = {hold.arc_length for hold in holds if hold.fixes_tangent}
        halved = clamps if clamp_correction else clamps - set(ends)
        h = length / (segments - 0.5 * len(halved & set(ends)))
        places = sorted(
            [*ends, *(hold.arc_length for hold in holds if hold.arc_length not in ends)]
        )
        for k, s in enumerate(places):
            if k and s - places[k - 1] < h / 2:
                raise InputError("arc_length", s, f"{h / 2:g} m or more from ends and other holds")
        for s in ends:
            if sum(hold.arc_length == s for hold in holds) > 1:
                raise InputError("arc_length", s, "one hold at an end")
        nodes: list[float] = []
        for start, end in itertools.pairwise(places):
            halves = 0.5 * (start in halved) + 0.5 * (end in halved)
            count = max(1, round((end - start) / h - halves))
            edge = (end - start) / (count + halves)
            first = -0.5 if (start in halved and start == 0.0) else 0.5 * (start in halved)
            last = count + halves + (0.5 if end == length else -0.5) * (end in halved)
            steps = first + np.arange(round(last - first) + 1)
            # Neighbouring stretches share a vertex: to the bit, so that it counts once.
            nodes += [end if k == count + halves else float(start + k * edge) for k in steps]
        return cls(length, np.unique(nodes))

    @property
    def edges(self) -> Array:
        """Rest lengths of the edges (N,), m."""
        return np.diff(self.nodes)

    @cached_property
    def hinges(self) -> Array:
        """Rest length of hose that each inner vertex's bending stands for (N - 1,), m."""
        return np.asarray((self.edges[:-1] + self.edges[1:]) / 2)

    def compute_masses(self, linear_density: float) -> Array:
        """Masses of the vertices (N + 1,), kg: mass and first moment are those of the hose.

        Each edge shares the mass of what of it is hose between its two vertices.
        """
        begin = np.clip(self.nodes[:-1], 0.0, self.length)
        end = np.clip(self.nodes[1:], 0.0, self.length)
        mass = linear_density * (end - begin)
        share = ((begin + end) / 2 - self.nodes[:-1]) / self.edges
        masses = np.zeros(len(self.nodes))
        masses[:-1] += mass * (1 - share)
        masses[1:] += mass * share
        return masses

    def locate(self, arc_lengths: Array) -> tuple[np.ndarray, Array]:
        """Returns the edge (k,) of each arc length and the fraction of it that lies before."""
        index = np.searchsorted(self.nodes, arc_lengths, side="right") - 1
        index = np.clip(index, 0, len(self.edges) - 1)
        return index, (arc_lengths - self.nodes[index]) / self.edges[index]

    def find_vertices(self, hold: Hold) -> np.ndarray:
        """Vertices that a hold holds: one of an attachment, the two of a clamp's edge."""
        if hold.fixes_tangent:
            (edge,), _ = self.locate(np.array([hold.arc_length]))
            return np.array([edge, edge + 1])
        return np.array([int(np.argmin(np.abs(self.nodes - hold.arc_length)))])


def interpolate(arc_lengths: Array, places: Array, values: Array) -> Array:
    """Straight lines through values at places, both (m,), continued to both sides; (k,)."""
    if len(places) == 1:
        return np.full(len(arc_lengths), values[0])
    index = np.clip(np.searchsorted(places, arc_lengths) - 1, 0, len(places) - 2)
    slope = np.diff(values)[index] / np.diff(places)[index]
    return np.asarray(values[index] + slope * (arc_lengths - places[index]))


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
