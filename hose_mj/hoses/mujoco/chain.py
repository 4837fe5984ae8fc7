"""A hose that is a chain of rigid segments inside an mjModel of its own.

`CableHose` and `HingeChainHose` say what the joints are.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.mujoco import chain_holds
from hose_mj.hoses.mujoco.chain_holds import Held, Load
from hose_mj.hoses.mujoco.chain_layout import (
    ChainKind,
    ChainLayout,
    ChainMass,
    ChainMotion,
    rotation_matrix,
    transport_frames,
    turn_frame,
)
from hose_mj.hoses.mujoco.chain_settings import ChainSettings, add_obstacles
from hose_mj.hoses.mujoco.hose import MujocoHose
from hose_mj.hoses.mujoco.model import MujocoModel
from hose_mj.hoses.mujoco.statics import BodyPoint, ChainSystem, StaticChain, solve_equilibrium
from hose_mj.hoses.protocol import Array, Reaction
from hose_mj.hoses.spec import HoseSpec, check_spec

_ADVICE = (
    "the elastic forces are explicit and unstable; try a smaller timestep, fewer segments or a "
    "lower torsional stiffness"
)


class ChainModel(MujocoModel[ChainMotion]):
    """A compiled chain with what holds it; a rigid hold holds the first segment.

    `bodies` (N,) are the body ids of the segments.
    """

    layout: ChainLayout

    def __init__(
        self, kind: ChainKind, spec: HoseSpec, settings: ChainSettings, held: Sequence[Held]
    ) -> None:
        self.kind, self.stiffness = kind, kind.stiffness
        clamped = {item.hold.arc_length for item in held if item.hold.fixes_tangent}
        ends = [settings.clamp_correction and end in clamped for end in (0.0, spec.length)]
        self.layout = ChainLayout(spec.length, settings.segments, *ends)
        self.mass = ChainMass.of_hose(self.layout, spec.linear_density, spec.outer_radius)
        self.rooted = any(item.rigid for item in held)
        root = None  # first node and frame of a first segment that is part of the world
        for item in held:
            if item.rigid:
                tangent = rotation_matrix(item.frame)[:, 0]
                root = item.position + self.layout.nodes[0] * tangent, item.frame
        maker, bodies = kind.make_chain(self.layout, root)
        settings.apply(maker.option)
        add_obstacles(maker, bodies, settings.obstacles, settings.timestep)
        self.mass.write(bodies)
        for item in held:
            if not item.rigid:
                (index,), (along,) = self.layout.locate(np.array([item.hold.arc_length]))
                chain_holds.add_equality(maker, bodies[index], along, item, settings.hold_options())
        chain_holds.check_segments(self.layout, held)
        try:
            model = maker.compile()
        except ValueError as error:
            light = f"heavier segments than {settings.segments} of this hose"
            valid = f"{light} (MuJoCo: {' '.join(str(error).split())})"
            raise InputError("linear_density", spec.linear_density, valid) from error
        super().__init__(model, settings.lead, _ADVICE)
        self.bodies = np.array([self.model.body(body.name).id for body in bodies])

    def point(self, arc_length: float) -> BodyPoint:
        """The body and place in it of a point of the hose."""
        (index,), (along,) = self.layout.locate(np.array([arc_length]))
        return BodyPoint(int(self.bodies[index]), np.array([along, 0.0, 0.0]))

    # State.

    def set_state(self, start: Array, frames: Array, velocity: Array, spins: Array) -> None:
        """Poses and moves the chain; of a rooted one the first frame and spin are not used."""
        self.data.qpos[:] = self.kind.to_qpos(start, frames, self.rooted)
        self.data.qvel[:] = self.kind.to_qvel(velocity, spins, frames, self.rooted)
        self.forget()

    def lay(self, points: Array, speeds: Array | None) -> None:
        """The first node is on its point; each segment points along the chord of its nodes."""
        still = np.zeros((self.layout.segments, 3))
        frames = transport_frames(points, self.kind.base_frame)
        self.set_state(points[0], frames, still[0], still)
        if speeds is not None:
            self.fit_velocity(speeds)

    def take_over(self, old: ChainMotion, held: Sequence[Held]) -> None:
        """Lays and moves the chain as another one; a rigid clamp's target comes first."""
        layout = self.layout
        nearest, _ = old.layout.locate((layout.nodes[:-1] + layout.nodes[1:]) / 2)
        points = old.position(layout.nodes)
        chords = np.diff(points, axis=0)
        chords /= np.linalg.norm(chords, axis=1, keepdims=True)
        frames = np.array(
            [turn_frame(old.frames[k], chord) for k, chord in zip(nearest, chords, strict=True)]
        )
        velocity, spins = old.velocity(layout.nodes[:1])[0], old.spins[nearest]
        for item in held:
            if item.rigid:
                frames[0], spins[0], velocity = item.frame, 0.0, np.zeros(3)
        self.set_state(points[0], frames, velocity, spins)

    def fit_velocity(self, speeds: Array) -> None:
        """Sets qvel such that the velocities of the nodes (N + 1, 3) are met in least squares."""
        motion = self.motion()
        nodes = motion.position(self.layout.nodes)
        rows = np.zeros((len(nodes), 3, self.model.nv))
        for k, node in enumerate(nodes):
            body = self.bodies[min(k, len(self.bodies) - 1)]
            mujoco.mj_jac(self.model, self.data, rows[k], None, node, body)
        system = rows.reshape(-1, self.model.nv)
        self.data.qvel[:] = np.linalg.lstsq(system, speeds.ravel(), rcond=1e-10)[0]
        self.forget()

    def _read_motion(self) -> ChainMotion:
        return ChainMotion.read(self.model, self.data, self.layout, self.bodies)

    def update_forces(self, loads: Sequence[Load]) -> None:
        """Computes the forces of constraints and joints; see `MujocoModel.update_forces`."""
        if self._forces_known:
            return
        flags = self.model.opt.disableflags
        if self.settled:
            self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
        self.forward([*loads, *self.settled.values()])
        mujoco.mj_rnePostConstraint(self.model, self.data)
        self.model.opt.disableflags = flags
        self.write_loads(loads)
        self._forces_known = True

    def reaction(self, held: Held) -> Reaction:
        """What the world or an equality constraint does to the chain."""
        if held.rigid:
            wrench = self.data.cfrc_int[self.bodies[0]]
            arm = self.data.subtree_com[self.bodies[0]] - held.position
            return Reaction(wrench[3:].copy(), wrench[:3] + np.cross(arm, wrench[3:]))
        body = self.point(held.hold.arc_length).body
        return chain_holds.compute_equality_reaction(self.model, self.data, held, body)

    def tension(self, arc_lengths: Array) -> Array:
        """Axial force in the joints, straight lines between and beyond them."""
        at_joints = self.motion().joint_tensions(self.data, self.bodies)
        return self.layout.interpolate(arc_lengths, at_joints)

    def torque(self, arc_lengths: Array) -> Array:
        """Moment about the mean of the tangents on both sides of a joint, damping included."""
        motion = self.motion()
        wrenches = self.data.cfrc_int[self.bodies[1:]]
        arms = self.data.subtree_com[self.bodies[0]] - motion.starts[1:]
        on_rest = wrenches[:, :3] + np.cross(arms, wrenches[:, 3:])
        tangents = motion.tangent(self.layout.nodes[1:-1])
        return self.layout.interpolate(arc_lengths, -np.einsum("ni,ni->n", on_rest, tangents))

    def settle(self, held: Sequence[Held], loads: Sequence[Load]) -> bool:
        """Moves to static equilibrium, velocity zero; returns whether it is stable."""
        system = self._static_system(held, loads)
        multipliers, is_stable = solve_equilibrium(system)
        self.write_targets(held)
        self.data.qpos[:] = system.data.qpos
        self.data.qvel[:], self.data.qacc_warmstart[:] = 0.0, 0.0
        self.keep_settled(multipliers, held)
        return is_stable

    # What acts on it, and steps.

    def write_targets(self, held: Sequence[Held], lead: float = 0.0) -> None:
        """Sets the poses of the bodies that hold the hose; see `MujocoModel.write_targets`."""
        for item in held:
            if not item.rigid:
                place = self.model.body(f"target{item.hold.number}").mocapid[0]
                self.data.mocap_pos[place], self.data.mocap_quat[place] = item.ahead(lead)

    def write_loads(self, loads: Sequence[Load]) -> None:
        """Sets the forces on the bodies, which act at their centres of mass, for this pose."""
        self.data.xfrc_applied[:] = 0.0
        if not loads:
            return
        mujoco.mj_kinematics(self.model, self.data)
        for load in loads:
            point = self.point(load.arc_length)
            axes = self.data.xmat[point.body].reshape(3, 3)
            arm = self.data.xpos[point.body] + axes @ point.local - self.data.xipos[point.body]
            self.data.xfrc_applied[point.body, :3] += load.force
            self.data.xfrc_applied[point.body, 3:] += load.moment + np.cross(arm, load.force)

    def _static_system(self, held: Sequence[Held], loads: Sequence[Load]) -> ChainSystem:
        holds = [(self.point(x.hold.arc_length), x) for x in held if not x.rigid]
        forces = [(self.point(load.arc_length), load) for load in loads]
        chain = StaticChain(self.kind, self.model, self.bodies, self.rooted, self.layout)
        motion = self.motion()
        return ChainSystem(chain, motion.starts[0], motion.frames, holds, forces)


class MujocoChainHose(MujocoHose):
    """The `HoseModel` protocol for a chain of rigid segments; inextensible, axial_stiffness unused.

    A clamp holds a whole segment, see `ChainLayout`: at s = 0 the first one becomes part of the
    world until the clamp is moved, elsewhere a weld holds it. One segment carries one hold. Moving
    holds follow within some 1e-4 of the way per step for a hose with little damping. All of
    MuJoCo's integrators but "discrete" leave implicit damping out of their constraint forces, so
    where timestep times joint damping exceeds a segment's moment of inertia clamps turn late.

    Static holds are exact. Unstable equilibria are left, but not by a shape exactly in one, and not
    where a moment acts. `linearize` has the first node and the rotation vectors of the segments, in
    the world frame, without those of a first segment that is part of the world.
    """

    _model: ChainModel
    layout: ChainLayout

    def __init__(self, spec: HoseSpec, kind: ChainKind, settings: ChainSettings) -> None:
        check_plain(type(self).__name__, spec)
        self.settings, self._kind = settings, kind
        super().__init__(spec, rotation_matrix(kind.base_frame)[:, 0])

    @property
    def segments(self) -> int:
        """Number of rigid segments."""
        return self.settings.segments

    @property
    def twists(self) -> bool:
        """Whether the joints let segments turn about their tangents."""
        return self._kind.twists

    def _make_model(self, held: Sequence[Held]) -> ChainModel:
        return ChainModel(self._kind, self.spec, self.settings, held)

    def _check_points(self, name: str, points: Array) -> Array:
        self._kind.check_points(name, points)
        return points

    def _check_direction(self, tangent: Array) -> Array:
        self._kind.check_tangent(tangent)
        return tangent

    def _is_root(self, arc_length: float) -> bool:
        return arc_length == 0.0

    def _check_static(self) -> None:
        """A chain with obstacles must come to rest by itself."""
        if self.settings.obstacles:
            raise InputError("obstacles", len(self.settings.obstacles), "none in a chain's statics")


def check_plain(name: str, spec: HoseSpec) -> None:
    """Raises `InputError` for what no hose inside an mjModel has, `name` being its class."""
    check_spec(spec)
    for what in ("rest_strain", "rest_curvature", "rest_torsion", "drag"):
        if getattr(spec, what) != 0.0:
            raise InputError(what, getattr(spec, what), f"0 for a {name}")
    if spec.bending_stiffness == 0.0:
        raise InputError("bending_stiffness", 0.0, f"above 0 for a {name}")
    if spec.fittings or not spec.is_isotropic:
        what = "fittings" if spec.fittings else "second_bending_stiffness"
        raise InputError(what, getattr(spec, what), f"none for a {name}")
