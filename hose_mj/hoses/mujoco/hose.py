"""The protocol for a hose inside an mjModel of its own, whatever its bodies are.

What holds the hose is part of the mjModel, so every clamp, attachment and release makes the model
anew and carries the state over.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses import inputs
from hose_mj.hoses.inputs import check_arc_lengths, check_vector
from hose_mj.hoses.laying import even_out
from hose_mj.hoses.mujoco import chain_layout
from hose_mj.hoses.mujoco.chain_holds import Held, Load, stack_rows
from hose_mj.hoses.mujoco.chain_settings import ChainSettings
from hose_mj.hoses.mujoco.flex_layout import FlexMotion
from hose_mj.hoses.mujoco.model import MujocoModel
from hose_mj.hoses.paths import Rows, follow_in_steps
from hose_mj.hoses.protocol import (
    Array,
    Curve,
    Energies,
    Equilibrium,
    Hold,
    Linearization,
    Momentum,
    Reaction,
    warn_of_lost_moment,
)
from hose_mj.hoses.snapshots import take_array, take_count, undo
from hose_mj.hoses.spec import HoseSpec, check_number


class MujocoHose(ABC):
    """The `HoseModel` protocol on top of a `MujocoModel`; at first it lies along `straight` (3,).

    `fallbacks` is always 0; hoses with a solver of their own count here.
    """

    settings: ChainSettings
    _model: MujocoModel[chain_layout.ChainMotion] | MujocoModel[FlexMotion]
    _loads: list[Load]

    def __init__(self, spec: HoseSpec, straight: Array) -> None:
        self.spec, self.fallbacks = spec, 0
        self._next_number = 0
        self.reset(lambda s: s[:, None] * straight)

    @abstractmethod
    def _make_model(self, held: Sequence[Held]) -> MujocoModel[Any]:
        """Compiles the hose with these holds; `InputError` if they are too close to each other."""

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        return self.settings.timestep

    @property
    def layout(self) -> Any:
        """Arc lengths of the nodes; another one after each change of holds."""
        return self._model.layout

    @property
    def twists(self) -> bool:
        """Whether the hose can turn about its tangent against itself."""
        return False

    # Queries.

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return float(self.data.time)

    @property
    def model(self) -> mujoco.MjModel:
        """The mjModel; another one after each change of holds."""
        return self._model.model

    @property
    def data(self) -> mujoco.MjData:
        """The mjData; another one after each change of holds."""
        return self._model.data

    def position(self, arc_length: ArrayLike) -> Array:
        """Centre line, shape (k, 3), m: straight between the nodes."""
        return self._model.motion().position(self._arc_lengths(arc_length))

    def velocity(self, arc_length: ArrayLike) -> Array:
        """Velocity of the centre line, shape (k, 3), m/s."""
        return self._model.motion().velocity(self._arc_lengths(arc_length))

    def tangent(self, arc_length: ArrayLike) -> Array:
        """Unit tangent, shape (k, 3): the segment's, at a node the mean of its neighbours'."""
        return self._model.motion().tangent(self._arc_lengths(arc_length))

    def frame(self, arc_length: ArrayLike) -> Array:
        """Rotation matrices (k, 3, 3) of the segments; columns: tangent and two directors.

        Of a hose without twist the directors are any.
        """
        places = self._arc_lengths(arc_length)
        frames = [self._model.motion().frame(float(s)) for s in places]
        return np.array([chain_layout.rotation_matrix(one) for one in frames]).reshape(-1, 3, 3)

    def curvature(self, arc_length: ArrayLike) -> Array:
        """Bending per length at the nodes (k,), 1/m: straight lines between and beyond them."""
        return self._model.motion().curvature(self._arc_lengths(arc_length))

    def twist(self, arc_length: ArrayLike) -> Array:
        """Turn about the tangent per length (k,), rad/m; between and beyond the nodes as above."""
        return self._model.motion().twist(self._arc_lengths(arc_length))

    def tension(self, arc_length: ArrayLike) -> Array:
        """Axial force (k,), N, positive in tension; between where it is known as above."""
        s = self._arc_lengths(arc_length)
        self._model.update_forces(self._loads)
        return self._model.tension(s)

    def torque(self, arc_length: ArrayLike) -> Array:
        """Moment about the tangent at the nodes (k,), N m; between and beyond as above."""
        s = self._arc_lengths(arc_length)
        self._model.update_forces(self._loads)
        return self._model.torque(s)

    def energies(self) -> Energies:
        """Energies at the present state."""
        return self._model.energies()

    def momentum(self) -> Momentum:
        """Linear and angular momentum at the present state."""
        return self._model.momentum()

    def _arc_lengths(self, arc_length: ArrayLike) -> Array:
        return check_arc_lengths(arc_length, self.spec.length)

    # Shape, holds and loads.

    def reset(self, curve: Curve, velocity: Curve | None = None) -> None:
        """Lays the hose along a curve, at rest or with a velocity (m/s); drops holds and loads."""
        made = self._make_model([])
        even = even_out(curve, self.spec.length)
        points = inputs.sample_curve(even, self.spec.length, made.layout.nodes)
        inputs.check_curve_points(points)
        points = self._check_points("curve", points)
        speeds = None
        if velocity is not None:
            speeds = inputs.sample_velocity(velocity, self.spec.length, made.layout.nodes)
        made.lay(points, speeds)
        self._model, self._held, self._loads = made, list[Held](), list[Load]()

    def clamp(
        self,
        arc_length: float,
        position: ArrayLike | None = None,
        tangent: ArrayLike | None = None,
    ) -> Hold:
        """Holds a point, the tangent and, where there is any, the twist; by default as they are."""
        s = inputs.check_place(arc_length, self.spec.length)
        where = self._check_target(s, position)
        frame = self._model.motion().frame(s)
        if tangent is not None:
            frame = chain_layout.turn_frame(frame, self._check_tangent(tangent))
        return self._add_hold(s, where, frame, fixes_tangent=True)

    def attach(self, arc_length: float, position: ArrayLike | None = None) -> Hold:
        """Holds a point and leaves the tangent free; by default where it is now."""
        s = inputs.check_place(arc_length, self.spec.length)
        where = self._check_target(s, position)
        return self._add_hold(s, where, np.array([1.0, 0.0, 0.0, 0.0]), fixes_tangent=False)

    def move(
        self,
        hold: Hold,
        position: ArrayLike | None = None,
        tangent: ArrayLike | None = None,
        spin: float = 0.0,
    ) -> None:
        """Sets where a hold is to be at the end of the next step; see `HoseModel.move`.

        A part of the world that is to move becomes an equality constraint first: MuJoCo takes a
        moved fixed body's children along without inertia.

        Raises:
            InputError: a tangent or spin for an attachment, a spin for a hose without twist, or
                spins that add up to pi or more in one step: a weld would go the shorter way.
        """
        place = self._find(hold)
        check_number("spin", spin, may_be_negative=True)
        held = self._held[place]
        where, frame = held.position, held.frame
        if position is not None:
            where = self._check_target(hold.arc_length, position)
        if not hold.fixes_tangent and (tangent is not None or spin != 0.0):
            name, value = ("spin", spin) if tangent is None else ("tangent", tangent)
            raise InputError(f"{name} of an attachment", value, "only a clamp's to set")
        if tangent is not None:
            frame = chain_layout.turn_frame(frame, self._check_tangent(tangent))
        spun = held.spun + self._check_spin(held, spin)
        if spin != 0.0:
            frame = chain_layout.multiply(
                chain_layout.exponential(spin * chain_layout.rotation_matrix(frame)[:, 0]), frame
            )
        moved = replace(held, position=where, frame=frame, spun=spun)
        if held.rigid and (np.any(where != held.position) or np.any(frame != held.frame)):
            moved = replace(moved, rigid=False)
            start = replace(held, rigid=False)
            self._rebuild([*self._held[:place], start, *self._held[place + 1 :]])
        self._held[place] = moved

    def release(self, hold: Hold) -> None:
        """Lets go."""
        place = self._find(hold)
        self._rebuild(self._held[:place] + self._held[place + 1 :])

    def reaction(self, hold: Hold) -> Reaction:
        """Force and moment of a hold on the hose at the end of the last step."""
        held = self._held[self._find(hold)]
        self._model.update_forces(self._loads)
        if hold.number in self._model.settled:
            exact = self._model.settled[hold.number]
            return Reaction(exact.force.copy(), exact.moment.copy())
        return self._model.reaction(held)

    def apply_force(self, arc_length: float, force: ArrayLike) -> None:
        """Adds a point force (3,) N in the world frame that acts until `clear_loads`."""
        s = inputs.check_place(arc_length, self.spec.length)
        self._add_load(Load(s, check_vector("force", force), np.zeros(3)))

    def apply_moment(self, arc_length: float, moment: ArrayLike) -> None:
        """Adds a point moment (3,) N m in the world frame that acts until `clear_loads`.

        A hose without twist, or without torsional stiffness, says by a `HoseWarning` what it loses.
        """
        s = inputs.check_place(arc_length, self.spec.length)
        vector = check_vector("moment", moment)
        self._add_load(Load(s, np.zeros(3), vector))
        if not self.twists or self.spec.torsional_stiffness == 0.0:
            warn_of_lost_moment(vector, self.tangent(s)[0], s, stacklevel=3)

    def clear_loads(self) -> None:
        """Drops all point forces and moments; gravity stays."""
        self._loads = []
        self._model.write_loads([])
        self._model.forget()

    # Motion.

    def step(self, n_steps: int = 1) -> None:
        """Advances the clock by n_steps time steps.

        Raises:
            StepError: MuJoCo met a NaN or a huge number; the state before the call is kept.
        """
        if inputs.check_count("n_steps", n_steps, 0) == 0:
            return
        self._model.step(n_steps, self._held, self._loads)
        self._held = [held.arrived() for held in self._held]

    def follow(self, positions: Rows, tangents: Rows | None = None) -> None:
        """Takes as many steps as paths have rows; see `HoseModel.follow`.

        A row that `move` refuses ends it there.
        """
        follow_in_steps(self, positions, tangents)

    def solve_static(self) -> Equilibrium:
        """Moves the hose to static equilibrium under its holds and loads, velocity zero.

        Holds are exact here. Unstable equilibria are left, but not by a shape exactly in one, and
        not where a moment acts; a `HoseWarning` says so. A moment has no energy: the verdict is
        then of the stiffness's symmetric part, may err, and gives no warning. A chain of rigid
        parts cannot fold within.

        Raises:
            InputError: a chain with obstacles.
            StepError: no equilibrium was found; the state before is kept.
        """
        self._check_static()
        found = Equilibrium(self._model.settle(self._held, self._loads), False, 1.0)
        self._held = [held.arrived() for held in self._held]
        if not any(np.any(load.moment) for load in self._loads):
            found.warn(stacklevel=3)
        return found

    def linearize(self) -> Linearization:
        """Mass, tangent stiffness and constraints at rest, in the model's own coordinates."""
        return self._model.linearize(self._held, self._loads)

    # State in and out.

    def snapshot(self) -> dict[str, Any]:
        """Holds (k, 19), loads (k, 7), the next hold's number and MuJoCo's integration state.

        And that before the last step where it moved holds, for what is read off of their forces.
        """
        return {
            "holds": stack_rows(self._held, Held.WIDTH),
            "loads": stack_rows(self._loads, Load.WIDTH),
            "next_number": self._next_number,
            "numbers": self._model.get_numbers(),
            "replay": self._model.replay.copy(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot of this hose.

        Raises:
            InputError: what is no snapshot of this hose; nothing has changed then.
        """
        with undo(lambda: None):
            rows = take_array(state, "holds", (None, Held.WIDTH))
            held = [Held.from_numbers(row) for row in rows]
            check_arc_lengths([item.hold.arc_length for item in held], self.spec.length)
            rows = take_array(state, "loads", (None, Load.WIDTH))
            loads = [Load.from_numbers(row) for row in rows]
            check_arc_lengths([load.arc_length for load in loads], self.spec.length)
            next_number = take_count(state, "next_number")
            made = self._make_model(held)
            made.set_numbers(take_array(state, "numbers", (None,)))
            replay = take_array(state, "replay", (None,))
            if len(replay) not in (0, len(made.get_numbers())):
                raise InputError(
                    "size of replay of a snapshot", len(replay), "that of numbers or 0"
                )
            made.replay = replay
        self._model, self._held, self._loads = made, held, loads
        self._next_number = next_number

    # What a kind of hose may say for itself.

    def _check_points(self, name: str, points: Array) -> Array:
        """Returns points (k, 3), m; raises `InputError` for one where this hose cannot be."""
        return points

    def _check_direction(self, tangent: Array) -> Array:
        """Returns a unit tangent (3,); raises `InputError` for one that this hose cannot have."""
        return tangent

    def _check_static(self) -> None:
        """Raises `InputError` for a hose that cannot be solved for its equilibrium."""
        return None

    def _is_root(self, arc_length: float) -> bool:
        """Whether a clamp there makes a part of the hose part of the world while it is at rest."""
        return False

    # Details.

    def _check_target(self, arc_length: float, position: ArrayLike | None) -> Array:
        """Where a hold is to be; by default where its point is now."""
        if position is None:
            return np.asarray(self.position(arc_length)[0])
        where = check_vector("position", position)
        return np.asarray(self._check_points("position", where[None])[0])

    def _check_tangent(self, tangent: ArrayLike) -> Array:
        direction = check_vector("tangent", tangent)
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise InputError("tangent", tangent, "a vector that is not zero")
        return self._check_direction(direction / length)

    def _check_spin(self, held: Held, spin: float) -> float:
        """Returns a spin (rad) that is possible here and below pi with those before."""
        if spin != 0.0 and not self.twists:
            raise InputError("spin", spin, f"0 for a {type(self).__name__}, which has no twist")
        if abs(held.spun + spin) >= np.pi:
            raise InputError("spin", spin, "turns (rad) that add up to less than pi in one step")
        return spin

    def _find(self, hold: Hold) -> int:
        """Place of a hold among those that act now."""
        for place, held in enumerate(self._held):
            if isinstance(hold, Hold) and held.hold == hold:
                return place
        raise InputError("hold", hold, f"one of {[held.hold for held in self._held]}")

    def _add_hold(self, s: float, where: Array, frame: Array, fixes_tangent: bool) -> Hold:
        hold = Hold(self._next_number, s, fixes_tangent)
        rigid = fixes_tangent and self._is_root(s)
        self._rebuild([*self._held, Held(hold, where, frame, where, frame, rigid)])
        self._next_number += 1
        return hold

    def _add_load(self, load: Load) -> None:
        self._loads.append(load)
        self._model.forget()

    def _rebuild(self, held: Sequence[Held]) -> None:
        """Makes the model for these holds and lays it where the present one is."""
        made = self._make_model(held)
        made.take_over(self._model.motion(), held)
        made.data.time = self.time
        self._model, self._held = made, list(held)
