"""A hose that is a chain of rigid segments inside an mjModel of its own.

`CableHose` and `HingeChainHose` say what the joints are; all else is here. What holds the hose is
part of the mjModel, so every clamp, attachment and release makes the model anew and carries the
state over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.chain_holds import (
    Held,
    Load,
    check_segments,
    compute_equality_reaction,
    compute_root_reaction,
    stack_rows,
)
from hose_mj.hoses.chain_kind import ChainKind
from hose_mj.hoses.chain_layout import ChainLayout, rotation_matrix, transport_frames, turn_frame
from hose_mj.hoses.chain_model import ChainModel
from hose_mj.hoses.chain_settings import ChainSettings
from hose_mj.hoses.inputs import (
    check_arc_lengths,
    check_count,
    check_curve_points,
    check_vector,
    sample_curve,
    sample_velocity,
)
from hose_mj.hoses.model import Array, Curve, Energies, Hold, Linearization, Momentum, Reaction
from hose_mj.hoses.spec import HoseSpec


class MujocoChainHose:
    """The `HoseModel` protocol for a chain of rigid segments; inextensible, axial_stiffness unused.

    Moving holds follow within some 1e-4 of the way per step for a hose with little damping. All of
    MuJoCo's integrators but "discrete" leave implicit damping out of their constraint forces, so
    where timestep times joint damping exceeds a segment's moment of inertia clamps turn late.

    Attributes:
        spec: what the hose is made of.
        settings: numerics.
        fallbacks: always 0; hoses with a solver of their own count here.
    """

    def __init__(self, spec: HoseSpec, kind: ChainKind, settings: ChainSettings) -> None:
        for name in ("rest_strain", "rest_curvature", "rest_torsion", "drag"):
            if getattr(spec, name) != 0.0:
                raise InputError(name, getattr(spec, name), f"0 for a {type(self).__name__}")
        if spec.fittings or not spec.is_isotropic:
            name = "fittings" if spec.fittings else "second_bending_stiffness"
            raise InputError(name, getattr(spec, name), f"none for a {type(self).__name__}")
        self.spec, self.settings, self.fallbacks = spec, settings, 0
        self._kind = kind
        self._next_number = 0
        straight = rotation_matrix(kind.base_frame)[:, 0]
        self.reset(lambda s: s[:, None] * straight)

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        return self.settings.timestep

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return float(self.data.time)

    @property
    def segments(self) -> int:
        """Number of rigid segments."""
        return self.settings.segments

    @property
    def model(self) -> mujoco.MjModel:
        """The mjModel; another one after each change of holds."""
        return self._chain.model

    @property
    def data(self) -> mujoco.MjData:
        """The mjData; another one after each change of holds."""
        return self._chain.data

    @property
    def layout(self) -> ChainLayout:
        """Arc lengths of the nodes; another one after each change of holds."""
        return self._chain.layout

    # Shape, holds and loads.

    def reset(self, curve: Curve, velocity: Curve | None = None) -> None:
        """Lays the hose along a curve, at rest or with a velocity (m/s); drops holds and loads.

        The first node is on the curve; each segment points along the curve's chord there.
        """
        layout = ChainLayout(self.spec.length, self.segments)
        points = sample_curve(curve, self.spec.length, layout.nodes)
        check_curve_points(points)
        self._kind.check_points("curve", points)
        speeds = (
            None if velocity is None else sample_velocity(velocity, layout.length, layout.nodes)
        )
        self._held: list[Held] = []
        self._loads: list[Load] = []
        self._chain = ChainModel(self._kind, self.spec, self.settings, [])
        frames = transport_frames(points, self._kind.base_frame)
        still = np.zeros((self.segments, 3))
        self._chain.set_state(points[0], frames, still[0], still)
        if speeds is not None:
            self._chain.fit_velocity(speeds)

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
        frame = self._chain.motion().frames[index]
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
        moved = replace(held, position=where, frame=frame)
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
        self._chain.update_forces(self._loads)
        if held.rigid:
            return compute_root_reaction(self.data, held, int(self._chain.bodies[0]))
        if hold.number in self._chain.settled:
            exact = self._chain.settled[hold.number]
            return Reaction(exact.force.copy(), exact.moment.copy())
        body = self._chain.point(hold.arc_length).body
        return compute_equality_reaction(self.model, self.data, held, body)

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
        self._chain.write_loads([])
        self._chain.forget()

    # Motion.

    def step(self, n_steps: int = 1) -> None:
        """Advances the clock by n_steps time steps.

        Raises:
            StepError: MuJoCo met a NaN or a huge number; the state before the call is kept.
        """
        if check_count("n_steps", n_steps, 0) == 0:
            return
        self._chain.step(n_steps, self._held, self._loads)
        self._held = [held.arrived() for held in self._held]

    def solve_static(self) -> None:
        """Moves the hose to static equilibrium under its holds and loads, velocity zero.

        Holds are exact here. Unstable equilibria are left, but not by a shape exactly in one, and
        not where a moment acts.

        Raises:
            InputError: a chain with obstacles, which must come to rest by itself.
            StepError: no equilibrium was found; the state before is kept.
        """
        if self.settings.obstacles:
            raise InputError("obstacles", len(self.settings.obstacles), "none in a chain's statics")
        self._chain.settle(self._held, self._loads)

    def linearize(self) -> Linearization:
        """Mass, tangent stiffness and constraints at rest.

        Coordinates: the first node and the rotation vectors of the segments, in the world frame,
        without those of a first segment that is part of the world.
        """
        return self._chain.linearize(self._held, self._loads)

    # Queries.

    def position(self, arc_length: ArrayLike) -> Array:
        """Centre line, shape (k, 3), m: straight between the nodes."""
        return self._chain.motion().position(self._arc_lengths(arc_length))

    def velocity(self, arc_length: ArrayLike) -> Array:
        """Velocity of the centre line, shape (k, 3), m/s."""
        return self._chain.motion().velocity(self._arc_lengths(arc_length))

    def tangent(self, arc_length: ArrayLike) -> Array:
        """Unit tangent, shape (k, 3): the segment's, at a node the mean of its neighbours'."""
        return self._chain.motion().tangent(self._arc_lengths(arc_length))

    def curvature(self, arc_length: ArrayLike) -> Array:
        """Angle of the joints over h (k,), 1/m: straight lines between and beyond the joints."""
        return self._chain.motion().curvature(self._arc_lengths(arc_length))

    def tension(self, arc_length: ArrayLike) -> Array:
        """Axial force in the joints (k,), N, positive in tension; between and beyond, as above."""
        s = self._arc_lengths(arc_length)
        self._chain.update_forces(self._loads)
        tangents = self._chain.motion().tangent(self.layout.nodes[1:-1])
        on_rest = self.data.cfrc_int[self._chain.bodies[1:], 3:]
        return self.layout.interpolate(s, -np.einsum("ni,ni->n", on_rest, tangents))

    def energies(self) -> Energies:
        """Energies at the present state; `stretching` is 0."""
        gravity = self.model.opt.gravity
        return self._chain.motion().energies(self._chain.mass, self._kind.stiffness, gravity)

    def momentum(self) -> Momentum:
        """Linear and angular momentum at the present state."""
        return self._chain.motion().momentum(self._chain.mass)

    # State in and out.

    def snapshot(self) -> dict[str, Any]:
        """Holds (k, 11), loads (k, 7), the next hold's number and MuJoCo's integration state."""
        return {
            "holds": stack_rows(self._held, Held.WIDTH),
            "loads": stack_rows(self._loads, Load.WIDTH),
            "next_number": self._next_number,
            "numbers": self._chain.get_numbers(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot of this hose."""
        missing = {"holds", "loads", "next_number", "numbers"} - state.keys()
        if missing:
            raise InputError("state", sorted(state), f"a snapshot; {sorted(missing)} missing")
        held = [Held.from_numbers(row) for row in np.asarray(state["holds"])]
        chain = ChainModel(self._kind, self.spec, self.settings, held)
        chain.set_numbers(np.asarray(state["numbers"]))
        self._chain, self._held = chain, held
        self._loads = [Load.from_numbers(row) for row in np.asarray(state["loads"])]
        self._next_number = int(state["next_number"])

    # Details.

    def _arc_lengths(self, arc_length: ArrayLike) -> Array:
        return check_arc_lengths(arc_length, self.spec.length)

    def _check_target(self, arc_length: float, position: ArrayLike | None) -> Array:
        """Where a hold is to be; by default where its point is now."""
        if position is None:
            return np.asarray(self.position(arc_length)[0])
        where = check_vector("position", position)
        self._kind.check_points("position", where[None])
        return where

    def _check_tangent(self, tangent: ArrayLike) -> Array:
        direction = check_vector("tangent", tangent)
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise InputError("tangent", tangent, "a vector that is not zero")
        self._kind.check_tangent(direction / length)
        return np.asarray(direction / length)

    def _find(self, hold: Hold) -> int:
        """Place of a hold among those that act now."""
        for place, held in enumerate(self._held):
            if held.hold == hold:
                return place
        raise InputError("hold", hold, f"one of {[held.hold for held in self._held]}")

    def _add_hold(self, s: float, where: Array, frame: Array, fixes_tangent: bool) -> Hold:
        hold = Hold(self._next_number, s, fixes_tangent)
        rigid = fixes_tangent and s == 0.0
        self._rebuild([*self._held, Held(hold, where, frame, where, frame, rigid)])
        self._next_number += 1
        return hold

    def _add_load(self, load: Load) -> None:
        self._loads.append(load)
        self._chain.forget()

    def _rebuild(self, held: Sequence[Held]) -> None:
        """Makes the model for these holds and lays it where the present one is."""
        chain = ChainModel(self._kind, self.spec, self.settings, held)
        check_segments(chain.layout, held)
        chain.take_over(self._chain.motion(), held)
        chain.data.time = self.time
        self._chain, self._held = chain, list(held)
