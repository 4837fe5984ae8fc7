"""A hose that is a chain of rigid segments inside an mjModel of its own.

`CableHose` and `HingeChainHose` say what the joints are; all else is here. What holds the hose is
part of the mjModel, so every clamp, attachment and release makes the model anew and carries the
state over.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError, StepError
from hose_mj.hoses import chain_statics
from hose_mj.hoses.chain_holds import (
    Held,
    Load,
    add_equality,
    compute_equality_reaction,
    compute_root_reaction,
    stack_rows,
)
from hose_mj.hoses.chain_layout import ChainLayout, transport_frames, turn_frame
from hose_mj.hoses.chain_motion import ChainMass, ChainMotion
from hose_mj.hoses.model import (
    Array,
    Curve,
    Energies,
    Hold,
    Linearization,
    Momentum,
    Reaction,
    check_arc_lengths,
    check_vector,
    sample_curve,
)
from hose_mj.hoses.spec import HoseSpec, check_number

INTEGRATORS = ("euler", "implicit", "implicitfast", "discrete", "rk4")
JACOBIANS = ("auto", "dense", "sparse")
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_BAD = [
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
]


@dataclass(frozen=True, kw_only=True)
class ChainSettings:
    """Settings that both chains share; the constructors of the hoses describe them."""

    timestep: float
    gravity: ArrayLike
    segments: int
    integrator: str
    clamp_correction: bool
    iterations: int
    tolerance: float
    jacobian: str
    hold_solref: tuple[float, float] | None
    hold_solimp: tuple[float, float, float, float, float]

    def __post_init__(self) -> None:
        check_number("timestep", self.timestep)
        check_number("tolerance", self.tolerance, may_be_zero=True)
        check_vector("gravity", self.gravity)
        check_count("segments", self.segments, 2)
        check_count("iterations", self.iterations, 1)
        check_choice("integrator", self.integrator, INTEGRATORS)
        check_choice("jacobian", self.jacobian, JACOBIANS)

    def apply(self, option: Any) -> None:
        """Writes the options of a model that is being made."""
        option.timestep, option.gravity = self.timestep, np.asarray(self.gravity, dtype=float)
        option.iterations, option.tolerance = self.iterations, self.tolerance
        option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{self.integrator.upper()}")
        option.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{self.jacobian.upper()}")

    def hold_options(self) -> dict[str, object]:
        """solref and solimp of holds; by default a spring that closes a gap within one step."""
        stiff = (-1.0 / self.timestep**2, -1.0 / self.timestep)
        return {"solref": self.hold_solref or stiff, "solimp": self.hold_solimp}


class MujocoChainHose(ABC):
    """The `HoseModel` protocol for a chain of rigid segments; inextensible, axial_stiffness unused.

    Attributes:
        spec: what the hose is made of.
        segments: their number.
        model: the mjModel; made anew with every hold.
        data: its mjData.
        layout: arc lengths of the nodes.
        fallbacks: always 0; hoses with a solver of their own count here.
    """

    def __init__(self, spec: HoseSpec, settings: ChainSettings) -> None:
        for name in ("rest_strain", "rest_curvature", "drag"):
            if getattr(spec, name) != 0.0:
                raise InputError(name, getattr(spec, name), f"0 for a {type(self).__name__}")
        self.spec = spec
        self.segments = settings.segments
        self.fallbacks = 0
        self._settings = settings
        self._next_number = 0
        self._held: list[Held] = []
        self._loads: list[Load] = []
        self._lay_straight()

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        return self._settings.timestep

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return float(self.data.time)

    # What a kind of chain has to say about itself.

    @property
    @abstractmethod
    def _base_frame(self) -> Array:
        """Frame (4,) from which the first segment's is turned."""

    @property
    @abstractmethod
    def _stiffness(self) -> tuple[float, float]:
        """GJ, EI of the joints (N m^2)."""

    @abstractmethod
    def _make_chain(
        self, layout: ChainLayout, root: tuple[Array, Array] | None
    ) -> tuple[mujoco.MjSpec, list[Any]]:
        """Returns a model with the segments' bodies; `root` is the pose of a first one held fast."""

    @abstractmethod
    def _to_qpos(self, start: Array, frames: Array, rooted: bool) -> Array:
        """Joint coordinates of a chain that starts at a point with these frames (N, 4)."""

    @abstractmethod
    def _to_qvel(self, velocity: Array, spins: Array, frames: Array, rooted: bool) -> Array:
        """Joint velocities from the start's velocity and the spins (N, 3) in the world frame."""

    def _check_reachable(self, name: str, points: Array) -> None:
        """Raises `InputError` for points (k, 3) where this chain cannot be."""

    def _check_direction(self, name: str, direction: Array) -> None:
        """Raises `InputError` for a tangent that this chain cannot have."""

    # Shape, holds and loads.

    def reset(self, curve: Curve, velocity: Curve | None = None) -> None:
        """Lays the hose along a curve, at rest or with a velocity (m/s); drops holds and loads.

        The first node is on the curve; each segment points along the curve's chord there.
        """
        layout = ChainLayout(self.spec.length, self.segments)
        points = sample_curve(curve, self.spec.length, layout.nodes)
        self._check_new_curve(points)
        speeds = None if velocity is None else sample_velocity(velocity, layout)
        self._held, self._loads = [], []
        frames = transport_frames(points, self._base_frame)
        self._build(layout, points[0], frames, np.zeros(3), np.zeros((self.segments, 3)), 0.0)
        if speeds is not None:
            self._fit_velocity(speeds)

    def clamp(
        self,
        arc_length: float,
        position: ArrayLike | None = None,
        tangent: ArrayLike | None = None,
    ) -> Hold:
        """Holds a point, the tangent there, and (the cable's) twist; by default where they are.

        At s = 0 the first segment becomes part of the world until the clamp is moved, elsewhere a
        weld holds the segment. A clamp holds a whole segment: see `ChainLayout`.
        """
        s = float(check_arc_lengths(arc_length, self.spec.length)[0])
        where = self._check_target(s, position)
        index = int(self.layout.locate(np.array([s]))[0][0])
        frame = self._motion().frames[index]
        if tangent is not None:
            frame = turn_frame(frame, self._check_tangent(tangent))
        return self._add_hold(s, where, frame, fixes_tangent=True)

    def attach(self, arc_length: float, position: ArrayLike | None = None) -> Hold:
        """Holds a point and leaves the tangent free; by default where it is now."""
        s = float(check_arc_lengths(arc_length, self.spec.length)[0])
        where = self._check_target(s, position)
        return self._add_hold(s, where, np.array([1.0, 0.0, 0.0, 0.0]), fixes_tangent=False)

    def move(
        self, hold: Hold, position: ArrayLike | None = None, tangent: ArrayLike | None = None
    ) -> None:
        """Sets where a hold is to be at the end of the next step.

        A clamp at s = 0 that moves becomes a weld: MuJoCo takes a moved fixed body's children along
        without inertia.
        """
        place = self._find(hold)
        held = self._held[place]
        where, frame = held.position, held.frame
        if position is not None:
            where = self._check_target(hold.arc_length, position)
        if tangent is not None:
            if not hold.fixes_tangent:
                raise InputError("tangent of an attachment", tangent, "None: only a clamp has one")
            frame = turn_frame(frame, self._check_tangent(tangent))
        moved = held.moved(where, frame)
        if held.rigid and (np.any(where != held.position) or np.any(frame != held.frame)):
            self._rebuild([*self._held[:place], held.softened(), *self._held[place + 1 :]])
            moved = moved.softened()
        self._held[place] = moved

    def release(self, hold: Hold) -> None:
        """Lets go."""
        place = self._find(hold)
        self._rebuild(self._held[:place] + self._held[place + 1 :])

    def reaction(self, hold: Hold) -> Reaction:
        """Force and moment of a hold on the hose at the end of the last step."""
        held = self._held[self._find(hold)]
        self._update_forces()
        if held.rigid:
            return compute_root_reaction(self.data, held, self._bodies[0])
        return compute_equality_reaction(self.model, self.data, held, self._point(held.hold).body)

    def apply_force(self, arc_length: float, force: ArrayLike) -> None:
        """Adds a point force (3,) N in the world frame that acts until `clear_loads`."""
        s = float(check_arc_lengths(arc_length, self.spec.length)[0])
        self._add_load(Load(s, check_vector("force", force), np.zeros(3)))

    def apply_moment(self, arc_length: float, moment: ArrayLike) -> None:
        """Adds a point moment (3,) N m in the world frame that acts until `clear_loads`."""
        s = float(check_arc_lengths(arc_length, self.spec.length)[0])
        self._add_load(Load(s, np.zeros(3), check_vector("moment", moment)))

    def clear_loads(self) -> None:
        """Drops all point forces and moments; gravity stays."""
        self._loads = []
        self.data.xfrc_applied[:] = 0.0
        self._forget()

    # Motion.

    def step(self, n_steps: int = 1) -> None:
        """Advances the clock by n_steps time steps.

        Raises:
            StepError: MuJoCo met a NaN or a huge number; the state before the call is kept.
        """
        check_count("n_steps", n_steps, 1)
        before = self._get_state()
        self._write_targets()
        if not self._loads:
            mujoco.mj_step(self.model, self.data, n_steps)
        else:
            for _ in range(n_steps):
                self._write_loads()
                mujoco.mj_step(self.model, self.data)
        self._forget()
        self._check_warnings(before)

    def solve_static(self) -> None:
        """Moves the hose to static equilibrium under its holds and loads, velocity zero."""
        self._write_targets()
        qpos = chain_statics.solve_equilibrium(self._static_system())
        self.data.qpos[:] = qpos
        self.data.qvel[:] = 0.0
        self.data.qacc_warmstart[:] = 0.0
        self._forget()

    def linearize(self) -> Linearization:
        """Mass, tangent stiffness and constraints in MuJoCo's joint velocities, at rest."""
        return chain_statics.linearize(self._static_system())

    # Queries.

    def position(self, arc_length: ArrayLike) -> Array:
        """Centre line, shape (k, 3), m: straight between the nodes."""
        return self._motion().position(check_arc_lengths(arc_length, self.spec.length))

    def velocity(self, arc_length: ArrayLike) -> Array:
        """Velocity of the centre line, shape (k, 3), m/s."""
        return self._motion().velocity(check_arc_lengths(arc_length, self.spec.length))

    def tangent(self, arc_length: ArrayLike) -> Array:
        """Unit tangent, shape (k, 3): the segment's, at a node the mean of its neighbours'."""
        return self._motion().tangent(check_arc_lengths(arc_length, self.spec.length))

    def curvature(self, arc_length: ArrayLike) -> Array:
        """Angle of the joints over h (k,), 1/m: straight lines between and beyond the joints."""
        return self._motion().curvature(check_arc_lengths(arc_length, self.spec.length))

    def tension(self, arc_length: ArrayLike) -> Array:
        """Axial force in the joints (k,), N, positive in tension; between and beyond, as above."""
        s = check_arc_lengths(arc_length, self.spec.length)
        self._update_forces()
        tangents = self._motion().tangent(self.layout.nodes[1:-1])
        on_rest = self.data.cfrc_int[self._bodies[1:], 3:]
        return self.layout.interpolate(s, -np.einsum("ni,ni->n", on_rest, tangents))

    def energies(self) -> Energies:
        """Energies at the present state; `stretching` is 0."""
        return self._motion().energies(self._mass, self._stiffness, self.model.opt.gravity)

    def momentum(self) -> Momentum:
        """Linear and angular momentum at the present state."""
        return self._motion().momentum(self._mass)

    # State in and out.

    def snapshot(self) -> dict[str, Any]:
        """Holds (k, 11), loads (k, 7), the next hold's number and MuJoCo's integration state."""
        return {
            "holds": stack_rows(self._held, Held.WIDTH),
            "loads": stack_rows(self._loads, Load.WIDTH),
            "next_number": self._next_number,
            "state": self._get_state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot of this hose."""
        raise NotImplementedError
