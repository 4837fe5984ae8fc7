"""MuJoCo's 1-D flex as a hose, its modulus chosen such that physical EI comes out."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.hoses.mujoco import flex_rod
from hose_mj.hoses.mujoco.chain import check_plain
from hose_mj.hoses.mujoco.chain_holds import Held, Load, find_rows
from hose_mj.hoses.mujoco.chain_layout import rotation_matrix
from hose_mj.hoses.mujoco.flex_layout import FlexLayout, FlexMotion, interpolate
from hose_mj.hoses.mujoco.flex_rod import FlexSettings
from hose_mj.hoses.mujoco.hose import MujocoHose
from hose_mj.hoses.mujoco.model import MujocoModel
from hose_mj.hoses.mujoco.statics import solve_equilibrium
from hose_mj.hoses.protocol import Array, Reaction
from hose_mj.hoses.spec import HoseSpec

_ADVICE = "try a smaller timestep, or softer edges and holds"


class FlexModel(MujocoModel[FlexMotion]):
    """A compiled flex rod with its holds.

    Each vertex is a body on three slides; it is laid out along x from the world's origin, because
    MuJoCo takes the shape at qpos = 0 for the one without bending. `mass` is that of the vertices
    (N + 1,), kg.
    """

    layout: FlexLayout

    def __init__(self, spec: HoseSpec, settings: FlexSettings, held: Sequence[Held]) -> None:
        holds = [item.hold for item in held]
        correct = settings.clamp_correction
        self.layout = FlexLayout.of_holds(
            spec.length, settings.segments, holds, clamp_correction=correct
        )
        self.mass = self.layout.compute_masses(spec.linear_density)
        self.stiffness = spec.bending_stiffness
        self._rest = np.zeros((len(self.mass), 3))
        self._rest[:, 0] = self.layout.nodes
        maker = flex_rod.make_rod(spec, self._rest, self.mass, settings.edge_options())
        settings.apply(maker.option)
        self._ballast = flex_rod.BALLAST * spec.mass
        for item in held:
            for vertex in self.layout.find_vertices(item.hold):
                flex_rod.add_connect(maker, item, vertex, self._ballast, settings.hold_options())
        super().__init__(maker.compile(), settings.lead, _ADVICE)
        self._scratch = mujoco.MjData(self.model)
        self._bodies = np.array([self.model.body(f"v{k}").id for k in range(len(self.mass))])
        self._free = np.ones(len(self.layout.edges), dtype=bool)
        for item in held:
            if item.hold.fixes_tangent:
                self._free[self.layout.find_vertices(item.hold)[0]] = False
        if not self._free.any():
            self._free[:] = True
        self._tensions = np.zeros(len(self.layout.edges))

    # State.

    def lay(self, points: Array, speeds: Array | None) -> None:
        """The first vertex is on its point; each edge points along its chord, unstretched.

        Speeds lose the part that would stretch edges, momentum kept.
        """
        chords = np.diff(points, axis=0)
        chords /= np.linalg.norm(chords, axis=1, keepdims=True)
        steps = np.cumsum(self.layout.edges[:, None] * chords, axis=0)
        vertices = points[0] + np.concatenate([np.zeros((1, 3)), steps])
        velocities = np.zeros_like(vertices)
        if speeds is not None:
            rows = np.zeros((len(chords), len(vertices), 3))
            edge = np.arange(len(chords))
            rows[edge, edge], rows[edge, edge + 1] = -chords, chords
            flat = rows.reshape(len(chords), -1)
            lighter = flat / np.repeat(self.mass, 3)
            impulse = np.linalg.solve(flat @ lighter.T, flat @ speeds.ravel())
            velocities = speeds - (impulse @ lighter).reshape(-1, 3)
        self._set_state(vertices, velocities)

    def take_over(self, old: FlexMotion, held: Sequence[Held]) -> None:
        """Lays the rod where another one is; to the bit where its vertices are the same."""
        if np.array_equal(old.layout.nodes, self.layout.nodes):
            self._set_state(old.vertices, old.velocities)
        else:
            self.lay(old.position(self.layout.nodes), old.velocity(self.layout.nodes))

    def _read_motion(self) -> FlexMotion:
        vertices = self._rest + self.data.qpos.reshape(-1, 3)
        return FlexMotion(self.layout, vertices, self.data.qvel.reshape(-1, 3).copy())

    def _set_state(self, vertices: Array, velocities: Array) -> None:
        self.data.qpos[:] = (vertices - self._rest).ravel()
        self.data.qvel[:] = velocities.ravel()
        self.forget()

    # Forces.

    def update_forces(self, loads: Sequence[Load]) -> None:
        """Computes the forces of edges and holds; after `settle` they are known."""
        if self._forces_known:
            return
        self.forward(loads)
        self._tensions = -self._find_rows("edges")
        self._forces_known = True

    def reaction(self, held: Held) -> Reaction:
        """Sum of what the constraints of a hold do to its vertices."""
        vertices = self.layout.find_vertices(held.hold)
        forces = np.stack(
            [self._find_rows(flex_rod.name_hold(held, vertex)) for vertex in vertices]
        )
        forces -= self._ballast * self.data.qacc.reshape(-1, 3)[vertices]
        return self._add_up(held, forces)

    def tension(self, arc_lengths: Array) -> Array:
        """Tension of the edges, straight lines between and beyond their middles.

        A clamp's two vertices hold its edge whatever its tension: there the next ones count.
        """
        middles = (self.layout.nodes[:-1] + self.layout.nodes[1:]) / 2
        return interpolate(arc_lengths, middles[self._free], self._tensions[self._free])

    def torque(self, arc_lengths: Array) -> Array:
        """Zero: nothing twists."""
        return np.zeros(len(arc_lengths))

    def write_targets(self, held: Sequence[Held], lead: float = 0.0) -> None:
        """Sets the bodies that hold vertices, `lead` steps ahead of where they are to be."""
        for item in held:
            vertices = self.layout.find_vertices(item.hold)
            for vertex, where in zip(vertices, self._find_targets(item, lead), strict=True):
                place = self.model.body(f"target-{flex_rod.name_hold(item, vertex)}").mocapid[0]
                self.data.mocap_pos[place] = where

    def write_loads(self, loads: Sequence[Load]) -> None:
        """Sets the forces on the vertices for this pose."""
        self.data.xfrc_applied[:] = 0.0
        if loads:
            forces = flex_rod.spread_loads(self.layout, self.motion().vertices, tuple(loads))
            self.data.xfrc_applied[self._bodies, :3] = forces

    def _run(self, n_steps: int, loads: Sequence[Load]) -> None:
        """Loads that make a couple follow the rod, so the pose is read anew before each step."""
        if not loads:
            super()._run(n_steps, loads)
            return
        for _ in range(n_steps):
            self._motion = None
            super()._run(1, loads)

    # Statics.

    def settle(self, held: Sequence[Held], loads: Sequence[Load]) -> bool:
        """Moves to static equilibrium with rigid edges and holds; returns whether it is stable."""
        system = self._static_system(held, loads)
        multipliers, is_stable = solve_equilibrium(system)
        self.write_targets(held)
        self.data.qacc_warmstart[:] = 0.0
        self._set_state(system.pose, np.zeros_like(system.pose))
        count = len(self.layout.edges)
        forces, wrenches = multipliers[count:].reshape(-1, 3), [np.zeros(0)]
        for item in held:
            size = len(self.layout.find_vertices(item.hold))
            total = self._add_up(item, forces[:size])
            forces = forces[size:]
            wrenches += [total.force, total.moment] if item.hold.fixes_tangent else [total.force]
        self.keep_settled(np.concatenate(wrenches), held)
        self._tensions, self._forces_known = -multipliers[:count], True
        return is_stable

    def _static_system(self, held: Sequence[Held], loads: Sequence[Load]) -> flex_rod.FlexSystem:
        vertices = [self.layout.find_vertices(item.hold) for item in held]
        targets = [self._find_targets(item, 0.0) for item in held]
        problem = flex_rod.FlexProblem(
            self.layout,
            self.mass,
            np.array(self.model.opt.gravity),
            self.stiffness,
            self._compute_bending,
            np.concatenate([np.zeros(0, dtype=np.int64), *vertices]),
            np.concatenate([np.zeros((0, 3)), *targets]),
            tuple(loads),
        )
        return flex_rod.FlexSystem(problem, self.motion().vertices)

    def _compute_bending(self, vertices: Array) -> Array:
        """MuJoCo's bending forces (N + 1, 3), N, at rest."""
        model, data = self.model, self._scratch
        data.qpos[:] = (vertices - self._rest).ravel()
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_flex(model, data)
        mujoco.mj_passive(model, data)
        return np.array(data.qfrc_passive).reshape(-1, 3)

    # Details.

    def _find_targets(self, held: Held, lead: float) -> Array:
        """Where the vertices of a hold are to be, (1 or 2, 3), m."""
        position, frame = held.ahead(lead)
        if not held.hold.fixes_tangent:
            return position[None]
        vertices = self.layout.find_vertices(held.hold)
        along = self.layout.nodes[vertices] - held.hold.arc_length
        return np.asarray(position + along[:, None] * rotation_matrix(frame)[:, 0])

    def _find_rows(self, name: str) -> Array:
        """Forces of an equality constraint's rows."""
        return np.array(self.data.efc_force[find_rows(self.data, self.model.equality(name).id)])

    def _add_up(self, held: Held, forces: Array) -> Reaction:
        """Forces on a hold's vertices as force and moment about its target."""
        if not held.hold.fixes_tangent:
            return Reaction(forces[0].copy(), np.zeros(3))
        arms = self._find_targets(held, 0.0) - held.position
        return Reaction(forces.sum(axis=0), np.cross(arms, forces).sum(axis=0))


class FlexHose(MujocoHose):
    """A `<flex dim="1">` with bending elasticity, under MuJoCo 3.17's integrator "discrete".

    Point masses joined by edges that keep their length, with MuJoCo's bending of discrete elastic
    rods between them, taken implicitly: large time steps are stable. There is no twist. Edges are
    soft constraints as all of MuJoCo's equalities are; `stretch` says by how much they give.
    Kelvin-Voigt damping is MuJoCo's own for flexes, and acts on bending. Not mapped: stretching
    stiffness (edges are as hard as their settings), torsional stiffness, drag, rest strain,
    curvature and torsion (the last four are errors unless 0). A hold has a vertex of its own, a
    clamp two; where a new one moves the vertices, the shape between them is cut off anew. In
    statics and in `linearize`, whose coordinates are the vertices, edges and holds are rigid.

    Arguments are those of `CableHose`. Segments are edges here; holds that are no vertex may change
    their number by a few. A clamp at an end holds the first two vertices, which `clamp_correction`
    centres on the end. A sparse Jacobian took a tenth less time for a held rod of 20 edges and two
    thirds less for one of 80. `edge_solref`, None for that of holds, and `edge_solimp` are MuJoCo's
    of the edges.
    """

    _model: FlexModel
    layout: FlexLayout
    settings: FlexSettings

    def __init__(
        self,
        spec: HoseSpec,
        *,
        timestep: float,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        segments: int = 40,
        clamp_correction: bool = False,
        iterations: int = 100,
        tolerance: float = 1e-8,
        jacobian: str = "sparse",
        edge_solref: Sequence[float] | None = None,
        edge_solimp: Sequence[float] = (0.9999, 0.9999, 0.001, 0.5, 2.0),
        hold_solref: Sequence[float] | None = None,
        hold_solimp: Sequence[float] = (0.9999, 0.9999, 0.001, 0.5, 2.0),
    ) -> None:
        check_plain(type(self).__name__, spec)
        self.settings = FlexSettings(
            timestep=timestep,
            gravity=gravity,
            segments=segments,
            integrator="discrete",
            clamp_correction=clamp_correction,
            iterations=iterations,
            tolerance=tolerance,
            jacobian=jacobian,
            hold_solref=hold_solref,
            hold_solimp=hold_solimp,
            edge_solref=edge_solref,
            edge_solimp=edge_solimp,
        )
        super().__init__(spec, np.array([1.0, 0.0, 0.0]))

    def stretch(self) -> Array:
        """Strain of the edges (N,); 0 if MuJoCo's constraints were rigid."""
        return self._model.motion().stretch()

    def _make_model(self, held: Sequence[Held]) -> FlexModel:
        return FlexModel(self.spec, self.settings, held)
