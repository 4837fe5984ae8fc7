"""The equations of static equilibrium of a flex rod.

Unknowns are the vertices. Bending forces are MuJoCo's own; edges and holds are rigid here, with
one multiplier an edge (its tension, negative) and three for each vertex that a hold holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hose_mj.hoses.mujoco.chain_holds import Load
from hose_mj.hoses.mujoco.flex_layout import FlexLayout
from hose_mj.hoses.mujoco.statics import StaticSystem
from hose_mj.hoses.protocol import Array

_REACH = 5  # a vertex's bending force depends on two neighbours to either side


@dataclass(frozen=True)
class FlexProblem:
    """What a flex rod is to be in equilibrium with.

    Attributes:
        layout: its vertices.
        masses: of the vertices (N + 1,), kg.
        gravity: (3,) m/s^2.
        bending_stiffness: EI (N m^2).
        bend: bending forces (N + 1, 3), N, of vertices (N + 1, 3).
        held: vertices that are held (h,).
        targets: where (h, 3), m.
        loads: point loads.
    """

    layout: FlexLayout
    masses: Array
    gravity: Array
    bending_stiffness: float
    bend: Callable[[Array], Array]
    held: np.ndarray
    targets: Array
    loads: tuple[Load, ...]


class FlexSystem(StaticSystem):
    """The functions f, c and J at vertices `pose`, (N + 1, 3)."""

    pose: Array

    def __init__(self, problem: FlexProblem, vertices: Array) -> None:
        self.problem = problem
        length, mass = problem.layout.length, float(problem.masses.sum())
        pull = mass * float(np.linalg.norm(problem.gravity))
        pull += sum(float(np.linalg.norm(load.force)) for load in problem.loads)
        bend = sum(float(np.linalg.norm(load.moment)) for load in problem.loads)
        self._scale = pull + (bend + problem.bending_stiffness / length) / length
        self.softest = 1e-6 * self._scale / (mass * length)
        self.conservative = not any(np.any(load.moment) for load in problem.loads)
        self.set_pose(vertices)

    def set_pose(self, pose: Array) -> None:
        """Moves the vertices."""
        self.pose = pose
        edges = np.diff(pose, axis=0)
        self._lengths = np.linalg.norm(edges, axis=1)
        self._tangents = edges / self._lengths[:, None]

    def advance(self, change: Array) -> None:
        """Moves by a change of the coordinates (n,)."""
        self.set_pose(self.pose + change.reshape(-1, 3))

    def force(self, multipliers: Array) -> Array:
        """Bending, gravity and loads, and J^T lambda, (n,)."""
        along = multipliers[: len(self._lengths), None] * self._tangents
        total = self._applied()
        total[:-1] -= along
        total[1:] += along
        np.add.at(total, self.problem.held, multipliers[len(along) :].reshape(-1, 3))
        return total.ravel()

    def errors(self) -> Array:
        """Stretches of the edges (N,), then gaps of the held vertices, m."""
        gaps = self.pose[self.problem.held] - self.problem.targets
        return np.concatenate([self._lengths - self.problem.layout.edges, gaps.ravel()])

    def constraints(self) -> Array:
        """J here (c, n)."""
        count, held = len(self._lengths), self.problem.held
        rows = np.zeros((count + 3 * len(held), len(self.pose), 3))
        edge = np.arange(count)
        rows[edge, edge], rows[edge, edge + 1] = -self._tangents, self._tangents
        for k, vertex in enumerate(held):
            rows[count + 3 * k : count + 3 * k + 3, vertex] = np.eye(3)
        return rows.reshape(len(rows), -1)

    def mass(self) -> Array:
        """Mass matrix (n, n)."""
        return np.diag(np.repeat(self.problem.masses, 3))

    def stiffness(self, multipliers: Array, *, central: bool = False) -> Array:
        """-d(f + J^T lambda)/dx: of edges as it is, of all else by differences of every fifth."""
        count, width = len(self.pose), 1e-6 * float(self.problem.layout.edges.min())
        full = np.zeros((count, 3, count, 3))
        here, start = self.pose, self._applied()
        vertex = np.arange(count)
        for first in range(_REACH):
            # Of the vertices that move together, the one near enough to change another's force.
            moved = first + _REACH * np.rint((vertex - first) / _REACH).astype(np.int64)
            near = (moved >= 0) & (moved < count)
            for c in range(3):
                change = np.zeros_like(here)
                change[first::_REACH, c] = width
                self.set_pose(here + change)
                ahead = self._applied()
                behind, span = start, width
                if central:
                    self.set_pose(here - change)
                    behind, span = self._applied(), 2 * width
                full[vertex[near], :, moved[near], c] = ((behind - ahead) / span)[near]
        self.set_pose(here)
        self._add_edge_stiffness(full, multipliers)
        return full.reshape(3 * count, 3 * count)

    def largest_turn(self, change: Array) -> float:
        """Largest rotation of an edge (rad)."""
        steps = np.diff(change.reshape(-1, 3), axis=0)
        across = steps - np.einsum("ni,ni->n", steps, self._tangents)[:, None] * self._tangents
        return float((np.linalg.norm(across, axis=1) / self._lengths).max())

    def residual(self, multipliers: Array) -> float:
        """Largest force over those around, largest error over the length."""
        force = np.abs(self.force(multipliers)).max() / self._scale
        return float(max(force, np.abs(self.errors()).max() / self.problem.layout.length))

    def _applied(self) -> Array:
        """Bending, gravity and loads on the vertices (N + 1, 3), N."""
        problem = self.problem
        weight = problem.masses[:, None] * problem.gravity
        forces = spread_loads(problem.layout, self.pose, problem.loads)
        return np.asarray(problem.bend(self.pose) + weight + forces)

    def _add_edge_stiffness(self, full: Array, multipliers: Array) -> None:
        """Adds what turning the tensions does."""
        pulls = -multipliers[: len(self._lengths)] / self._lengths
        for k, (tangent, pull) in enumerate(zip(self._tangents, pulls, strict=True)):
            block = pull * (np.eye(3) - np.outer(tangent, tangent))
            full[k, :, k] += block
            full[k + 1, :, k + 1] += block
            full[k, :, k + 1] -= block
            full[k + 1, :, k] -= block


def spread_loads(layout: FlexLayout, vertices: Array, loads: tuple[Load, ...]) -> Array:
    """Forces on the vertices (N + 1, 3), N, that do what loads do to the edges they are on.

    A moment becomes a couple across its edge; its part along the tangent has nothing to act on.
    """
    forces = np.zeros_like(vertices)
    for load in loads:
        (edge,), (after,) = layout.locate(np.array([load.arc_length]))
        span = vertices[edge + 1] - vertices[edge]
        couple = np.cross(load.moment, span) / (span @ span)
        forces[edge] += (1 - after) * load.force - couple
        forces[edge + 1] += after * load.force + couple
    return forces
