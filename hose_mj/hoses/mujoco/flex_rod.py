"""How a flex rod is made, and the equations of its static equilibrium.

The unknowns of these are the vertices. Bending forces are MuJoCo's own; edges and holds are rigid,
with one multiplier an edge (its tension, negative) and three for each vertex that a hold holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.hoses.mujoco.chain_holds import Held, Load
from hose_mj.hoses.mujoco.chain_settings import ChainSettings, check_numbers, check_solref
from hose_mj.hoses.mujoco.flex_layout import FlexLayout
from hose_mj.hoses.mujoco.statics import StaticSystem
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec

BALLAST = 10.0
"""Inertia of a held vertex beside its own, over the mass of the hose. It has no weight, and its
forces are taken off reactions: a soft constraint that holds much inertia gives less."""


@dataclass(frozen=True, kw_only=True)
class FlexSettings(ChainSettings):
    """Settings of a flex rod; `FlexHose` says what they are."""

    edge_solref: Sequence[float] | None
    edge_solimp: Sequence[float]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_solref("edge_solref", self.edge_solref)
        check_numbers("edge_solimp", self.edge_solimp, 5)

    def edge_options(self) -> dict[str, object]:
        """solref and solimp of the edges."""
        options = self.hold_options()
        if self.edge_solref is not None:
            options["solref"] = list(self.edge_solref)
        return options | {"solimp": list(self.edge_solimp)}


def make_rod(
    spec: HoseSpec, rest: Array, masses: Array, edge_options: Mapping[str, object]
) -> mujoco.MjSpec:
    """Vertices on slides, MuJoCo's bending between them, edges that keep their lengths.

    MuJoCo multiplies `young` by the section of a solid cylinder of the flex's radius; `damping` is
    the Kelvin-Voigt time. Nothing collides. `rest` is the straight shape (N + 1, 3), m; masses are
    (N + 1,), kg; `edge_options` are solref and solimp of the edges.
    """
    maker = mujoco.MjSpec()
    for k, (place, mass) in enumerate(zip(rest, masses, strict=True)):
        body = maker.worldbody.add_body(name=f"v{k}", pos=place)
        body.explicitinertial = True
        body.mass, body.inertia = mass, [mass * spec.outer_radius**2] * 3
        for axis in np.eye(3):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    rod = add_edges(maker, "hose", range(len(rest)), spec.outer_radius)
    rod.young = spec.bending_stiffness / (math.pi * spec.outer_radius**4 / 4)
    rod.poisson, rod.damping = 0.0, spec.damping_time
    maker.add_equality(
        name="edges",
        type=mujoco.mjtEq.mjEQ_FLEX,
        objtype=mujoco.mjtObj.mjOBJ_FLEX,
        name1="hose",
        **edge_options,
    )
    return maker


def add_edges(
    maker: mujoco.MjSpec, name: str, vertices: Sequence[int], radius: float
) -> mujoco.MjsFlex:
    """Adds a flex of edges between consecutive vertices; nothing in it acts or collides yet."""
    flex = maker.add_flex(name=name, dim=1, radius=radius)
    flex.contype, flex.conaffinity, flex.selfcollide = 0, 0, mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    flex.vertbody = [f"v{k}" for k in vertices]
    flex.vert = [0.0] * (3 * len(vertices))
    flex.elem = [vertex for k in range(len(vertices) - 1) for vertex in (k, k + 1)]
    return flex


def name_hold(held: Held, vertex: int) -> str:
    """Name of what ties a vertex of a hold."""
    return f"hold{held.hold.number}-{vertex}"


def add_connect(
    maker: mujoco.MjSpec, held: Held, vertex: int, ballast: float, options: dict[str, object]
) -> None:
    """Ties a vertex to a mocap body and gives it more inertia (kg)."""
    name, body = name_hold(held, vertex), maker.body(f"v{vertex}")
    for joint in body.joints:
        joint.armature = ballast
    body.add_site(name=name)
    target = maker.worldbody.add_body(name=f"target-{name}", mocap=True)
    target.add_site(name=f"target-{name}")
    maker.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        name1=name,
        name2=f"target-{name}",
        **options,
    )


_REACH = 5  # a vertex's bending force depends on two neighbours to either side


@dataclass(frozen=True)
class FlexProblem:
    """What a flex rod is to be in equilibrium with.

    `masses` are of the vertices (N + 1,), kg, gravity (3,) m/s^2, `bending_stiffness` EI (N m^2).
    `bend` returns bending forces (N + 1, 3), N, of vertices (N + 1, 3); the vertices `held` (h,)
    are to be at `targets` (h, 3), m.
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
        pulls = -multipliers[: len(self._lengths)] / self._lengths  # turning the tensions
        for k, (tangent, pull) in enumerate(zip(self._tangents, pulls, strict=True)):
            block = pull * (np.eye(3) - np.outer(tangent, tangent))
            full[k, :, k] += block
            full[k + 1, :, k + 1] += block
            full[k, :, k + 1] -= block
            full[k + 1, :, k] -= block
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
