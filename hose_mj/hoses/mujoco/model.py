"""What every hose inside an mjModel of its own shares below its protocol: state, steps, targets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

import mujoco
import numpy as np

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.mujoco.chain_holds import Held, Load
from hose_mj.hoses.mujoco.chain_layout import ChainLayout, ChainMotion
from hose_mj.hoses.mujoco.flex_layout import FlexLayout, FlexMotion
from hose_mj.hoses.mujoco.statics import StaticSystem, linearize
from hose_mj.hoses.protocol import Array, Energies, Linearization, Momentum, Reaction

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_BAD = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


Motion = TypeVar("Motion", ChainMotion, FlexMotion)
"""How a hose inside an mjModel lies and moves at one moment."""


class MujocoModel(ABC, Generic[Motion]):
    """A compiled mjModel of one hose and what holds it.

    A moving target must run ahead by `lead` steps for a hold to be in time; `advice` says what to
    try where the model turns out unstable.

    Attributes:
        layout: arc lengths of the nodes.
        mass, stiffness: as the motion's `energies` and `momentum` take them.
        data: its mjData.
        targets_ahead: the bodies that hold the hose may be elsewhere than the holds' targets.
        settled: what each equality constraint does, by hold number, after `settle` only.
    """

    layout: ChainLayout | FlexLayout
    mass: Any
    stiffness: Any

    def __init__(self, model: mujoco.MjModel, lead: float, advice: str) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.targets_ahead = True
        self.settled: dict[int, Load] = {}
        self._lead, self._advice = lead, advice
        self._forces_known = False
        # State before the last step where that moved holds; its targets are those of the data.
        self._replay: Array | None = None
        self._motion: Motion | None = None

    # What each kind of hose says for itself.

    @abstractmethod
    def lay(self, points: Array, speeds: Array | None) -> None:
        """Lays the nodes at points (N + 1, 3), m, with speeds (N + 1, 3), m/s, as well as it can.

        Without speeds it is at rest.
        """

    @abstractmethod
    def take_over(self, old: Motion, held: Sequence[Held]) -> None:
        """Lays and moves the hose as another model of it."""

    @abstractmethod
    def _read_motion(self) -> Motion:
        """Reads how the hose lies and moves now."""

    @abstractmethod
    def update_forces(self, loads: Sequence[Load]) -> None:
        """Computes the forces of constraints and joints for the present state.

        After `settle` they are those of the exact equilibrium; MuJoCo's equality constraints, soft
        as they are, would let go a little first.
        """

    @abstractmethod
    def reaction(self, held: Held) -> Reaction:
        """What a hold does to the hose, after `update_forces`, not after `settle`."""

    @abstractmethod
    def tension(self, arc_lengths: Array) -> Array:
        """Axial force (k,), N, after `update_forces`."""

    @abstractmethod
    def torque(self, arc_lengths: Array) -> Array:
        """Moment about the tangent (k,), N m, after `update_forces`."""

    @abstractmethod
    def settle(self, held: Sequence[Held], loads: Sequence[Load]) -> bool:
        """Moves to static equilibrium, velocity zero; returns whether it is stable."""

    @abstractmethod
    def _static_system(self, held: Sequence[Held], loads: Sequence[Load]) -> StaticSystem:
        """The equations of equilibrium from the present pose on."""

    @abstractmethod
    def write_targets(self, held: Sequence[Held], lead: float = 0.0) -> None:
        """Sets the poses of the bodies that equality constraints hold the hose to.

        MuJoCo takes these bodies to be at rest, so a hold lags behind one that moves; `lead` steps
        ahead of its target it is in time.
        """

    @abstractmethod
    def write_loads(self, loads: Sequence[Load]) -> None:
        """Sets the forces on the bodies for this pose."""

    def forget(self) -> None:
        """Drops what was computed for an earlier state."""
        self._forces_known = False
        self._motion = None
        self.settled = {}

    # State and steps.

    def motion(self) -> Motion:
        """How the hose lies and moves now."""
        if self._motion is None:
            self._motion = self._read_motion()
        return self._motion

    def energies(self) -> Energies:
        """Energies at the present state; `stretching` is 0."""
        return self.motion().energies(self.mass, self.stiffness, self.model.opt.gravity)

    def momentum(self) -> Momentum:
        """Linear and angular momentum about the world's origin."""
        return self.motion().momentum(self.mass)

    def linearize(self, held: Sequence[Held], loads: Sequence[Load]) -> Linearization:
        """Small motions about the present pose."""
        return linearize(self._static_system(held, loads))

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
        self._replay = None

    @property
    def replay(self) -> Array:
        """State before the last step where that moved holds, else of no size; for snapshots."""
        return np.zeros(0) if self._replay is None else self._replay

    @replay.setter
    def replay(self, state: Array) -> None:
        self._replay = state.copy() if len(state) else None

    def forward(self, loads: Sequence[Load]) -> None:
        """MuJoCo's forces for the present state or, where the last step moved holds, in that step.

        Its targets run ahead, so what they would do from now on is not what they did.
        """
        if self._replay is None:
            self.write_loads(loads)
            mujoco.mj_forward(self.model, self.data)
            return
        now, data = self.get_numbers(), self.data
        position, frame = data.mocap_pos.copy(), data.mocap_quat.copy()
        mujoco.mj_setState(self.model, data, self._replay, _STATE)
        data.mocap_pos[:], data.mocap_quat[:] = position, frame
        self.write_loads(loads)
        mujoco.mj_forward(self.model, data)
        mujoco.mj_setState(self.model, data, now, _STATE)

    def keep_settled(self, multipliers: Array, held: Sequence[Held]) -> None:
        """Remembers the wrenches of the holds, in their order, as `solve_equilibrium` found them.

        Six numbers for a clamp that is no root, three for an attachment.
        """
        self.forget()
        self._replay = None
        for item in held:
            if not item.rigid:
                n_rows = 6 if item.hold.fixes_tangent else 3
                wrench = np.zeros(6)
                wrench[:n_rows], multipliers = multipliers[:n_rows], multipliers[n_rows:]
                load = Load(item.hold.arc_length, wrench[:3], wrench[3:])
                self.settled[item.hold.number] = load

    def step(self, n_steps: int, held: Sequence[Held], loads: Sequence[Load]) -> None:
        """Advances the clock; on a `StepError` the state is the one before."""
        before = self.get_numbers()
        moving = any(item.moves for item in held)
        if moving:
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
        self._replay = before if moving and n_steps == 0 else None
        if went_bad(self.data):
            time = self.data.time
            self.set_numbers(before)
            raise StepError(
                f"MuJoCo met a NaN or a huge number within {n_steps} steps from time "
                f"{self.data.time:g} s (it reset itself and went on to {time:g} s) at timestep "
                f"{self.model.opt.timestep:g} s: {self._advice}"
            )

    def _run(self, n_steps: int, loads: Sequence[Load]) -> None:
        """Steps MuJoCo; loads follow the hose."""
        with mute_warnings():
            if not loads:
                mujoco.mj_step(self.model, self.data, n_steps)
                return
            for _ in range(n_steps):
                self.write_loads(loads)
                mujoco.mj_step(self.model, self.data)


def went_bad(data: mujoco.MjData) -> bool:
    """Whether MuJoCo met a NaN or a huge number, and so reset itself, since the last call."""
    met = [warning for kind in _BAD if (warning := data.warning[kind]).number]
    for warning in met:
        warning.number = 0
    return bool(met)


@contextmanager
def mute_warnings() -> Iterator[None]:
    """Keeps MuJoCo from printing and from leaving a log file: the caller raises one clear error."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
