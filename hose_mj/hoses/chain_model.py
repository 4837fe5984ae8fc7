"""One compiled mjModel of a chain: its settings, how it is made, its state and its steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.chain_holds import Held, Load, add_equality, make_layout
from hose_mj.hoses.chain_kind import ChainKind
from hose_mj.hoses.chain_layout import rotation_matrix, turn_frame
from hose_mj.hoses.chain_motion import ChainMass, ChainMotion
from hose_mj.hoses.chain_obstacles import add_obstacles
from hose_mj.hoses.chain_settings import ChainSettings
from hose_mj.hoses.chain_statics import (
    BodyPoint,
    StaticChain,
    StaticHold,
    StaticLoad,
    StaticSystem,
    linearize,
    solve_equilibrium,
)
from hose_mj.hoses.model import Array, Linearization
from hose_mj.hoses.spec import HoseSpec

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_BAD = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


class ChainModel:
    """A compiled chain with its holds.

    Args:
        kind: what the joints are.
        spec: what the hose is made of.
        settings: numerics.
        held: what holds it; a rigid one holds the first segment.

    Attributes:
        layout: arc lengths of the nodes.
        model: the mjModel.
        data: its mjData.
        bodies: body ids of the segments (N,).
        mass: of the segments.
        targets_ahead: the bodies that hold the hose may be elsewhere than the holds' targets.
        settled: what each equality constraint does, by hold number, after `settle` only.
    """

    def __init__(
        self, kind: ChainKind, spec: HoseSpec, settings: ChainSettings, held: Sequence[Held]
    ) -> None:
        self.kind = kind
        correct = settings.clamp_correction
        self.layout = make_layout(spec.length, settings.segments, held, clamp_correction=correct)
        self.mass = ChainMass.of_hose(self.layout, spec.linear_density, spec.radius)
        self.rooted = any(item.rigid for item in held)
        root = next((self._root_pose(item) for item in held if item.rigid), None)
        maker, bodies = kind.make_chain(self.layout, root)
        settings.apply(maker.option)
        add_obstacles(maker, bodies, settings.obstacles, settings.timestep)
        for k, body in enumerate(bodies):
            body.explicitinertial = True
            body.mass, body.inertia = max(self.mass.mass[k], 1e-300), self.mass.inertia[k]
            body.ipos, body.iquat = self.mass.centre[k], [1.0, 0.0, 0.0, 0.0]
        for item in held:
            if not item.rigid:
                (index,), (along,) = self.layout.locate(np.array([item.hold.arc_length]))
                add_equality(maker, bodies[index], along, item, settings.hold_options())
        self.model = maker.compile()
        self.data = mujoco.MjData(self.model)
        self.bodies = np.array([self.model.body(body.name).id for body in bodies])
        self._lead = settings.lead
        self.targets_ahead = True
        self._warnings = [self.data.warning[kind] for kind in _BAD]
        self.settled: dict[int, Load] = {}
        self._motion: ChainMotion | None = None
        self._forces_known = False

    def _root_pose(self, held: Held) -> tuple[Array, Array]:
        """First node and frame of a first segment that a clamp at s = 0 makes part of the world."""
        tangent = rotation_matrix(held.frame)[:, 0]
        return held.position + self.layout.nodes[0] * tangent, held.frame

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

    def get_numbers(self) -> Array:
        """All of MuJoCo's state that the next steps depend on."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def set_numbers(self, state: Array) -> None:
        """The inverse of `get_numbers`."""
        if state.shape != (mujoco.mj_stateSize(self.model, _STATE),):
            raise InputError("size of the state", state.shape, "a snapshot of this very hose")
        mujoco.mj_setState(self.model, self.data, state, _STATE)
        self.forget()

    def motion(self) -> ChainMotion:
        """How the chain lies and moves now."""
        if self._motion is None:
            self._motion = ChainMotion.read(self.model, self.data, self.layout, self.bodies)
        return self._motion

    def update_forces(self, loads: Sequence[Load]) -> None:
        """Computes the forces of constraints and joints for the present state.

        After `settle` they are those of the exact equilibrium; MuJoCo's equality constraints, soft
        as they are, would let go a little first.
        """
        if self._forces_known:
            return
        self.write_loads([*loads, *self.settled.values()])
        flags = self.model.opt.disableflags
        if self.settled:
            self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_rnePostConstraint(self.model, self.data)
        self.model.opt.disableflags = flags
        self.write_loads(loads)
        self._forces_known = True

    def forget(self) -> None:
        """Drops what was computed for an earlier state."""
        self._motion, self._forces_known = None, False
        self.settled = {}

    def settle(self, held: Sequence[Held], loads: Sequence[Load]) -> None:
        """Moves to static equilibrium, velocity zero."""
        system = self._static_system(held, loads)
        multipliers = solve_equilibrium(system)
        self.write_targets(held)
        self.data.qpos[:] = system.data.qpos
        self.data.qvel[:], self.data.qacc_warmstart[:] = 0.0, 0.0
        self.forget()
        for item in held:
            if not item.rigid:
                n_rows = 6 if item.hold.fixes_tangent else 3
                wrench = np.zeros(6)
                wrench[:n_rows], multipliers = multipliers[:n_rows], multipliers[n_rows:]
                load = Load(item.hold.arc_length, wrench[:3], wrench[3:])
                self.settled[item.hold.number] = load

    def linearize(self, held: Sequence[Held], loads: Sequence[Load]) -> Linearization:
        """Small motions about the present pose."""
        return linearize(self._static_system(held, loads))

    # What acts on it, and steps.

    def write_targets(self, held: Sequence[Held], lead: float = 0.0) -> None:
        """Sets the poses of the bodies that equality constraints hold the hose to.

        MuJoCo takes these bodies to be at rest, so a hold lags behind one that moves; `lead` steps
        ahead of its target it is in time.
        """
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

    def step(self, n_steps: int, held: Sequence[Held], loads: Sequence[Load]) -> None:
        """Advances the clock; on a `StepError` the state is the one before."""
        before = self.get_numbers()
        if any(item.moves for item in held):
            self.write_targets(held, self._lead)
            self._run(1, loads)
            n_steps -= 1
            self.targets_ahead = True
        if n_steps:
            if self.targets_ahead:
                self.write_targets(held)
                self.targets_ahead = False
            self._run(n_steps, loads)
        self.forget()
        if any(warning.number for warning in self._warnings):
            time = self.data.time
            for warning in self._warnings:
                warning.number = 0
            self.set_numbers(before)
            raise StepError(
                f"MuJoCo met a NaN or a huge number within {n_steps} steps from time "
                f"{self.data.time:g} s (it reset itself and went on to {time:g} s): the elastic "
                f"forces are explicit and unstable at timestep {self.model.opt.timestep:g} s; try "
                "a smaller timestep, fewer segments or a lower torsional stiffness"
            )

    def _run(self, n_steps: int, loads: Sequence[Load]) -> None:
        """Steps MuJoCo; loads follow the segments."""
        with _mute_warnings():
            if not loads:
                mujoco.mj_step(self.model, self.data, n_steps)
                return
            for _ in range(n_steps):
                self.write_loads(loads)
                mujoco.mj_step(self.model, self.data)

    def _static_system(self, held: Sequence[Held], loads: Sequence[Load]) -> StaticSystem:
        """The equations of equilibrium from the present pose on."""
        holds = [
            StaticHold(
                self.point(item.hold.arc_length),
                item.position,
                item.frame if item.hold.fixes_tangent else None,
            )
            for item in held
            if not item.rigid
        ]
        forces = [StaticLoad(self.point(x.arc_length), x.force, x.moment) for x in loads]
        chain = StaticChain(self.kind, self.model, self.bodies, self.rooted, self.layout)
        motion = self.motion()
        return StaticSystem(chain, motion.starts[0], motion.frames, holds, forces)


@contextmanager
def _mute_warnings() -> Iterator[None]:
    """Keeps MuJoCo from printing and from leaving a log file: the caller raises one clear error."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
