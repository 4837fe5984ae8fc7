"""`GedsHose`: the spline hose behind the HoseModel protocol; a thin class over the kernels.

spline.py knows where the hose is in the world, body.py its state, constraints.py and loads.py what
acts on it, mechanics.py how the kernels are called.
"""

from __future__ import annotations

import operator
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import HoseWarning, InputError
from hose_mj.hoses.fluid import Fluid, check_fluid
from hose_mj.hoses.geds import integrators, mechanics, records
from hose_mj.hoses.geds.body import FOLDED, SplineBody
from hose_mj.hoses.geds.body_coupling import BodyCoupling
from hose_mj.hoses.geds.contacts import ContactSet
from hose_mj.hoses.geds.dynamics import MOST_LOAD_STEPS, Dynamics
from hose_mj.hoses.geds.fluid_load import FluidLoad
from hose_mj.hoses.geds.integrators import FALLBACKS, ITERATIONS, RETRIES, STEPS
from hose_mj.hoses.geds.loads import LoadSet
from hose_mj.hoses.geds.material_frames import check_rotation
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.health import Health, HealthWatch, Line
from hose_mj.hoses.inputs import check_count, check_records, check_rows, check_vector
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.paths import Rows, check_paths
from hose_mj.hoses.protocol import (
    Array,
    Curve,
    Equilibrium,
    Hold,
    Linearization,
    Reaction,
    warn_of_lost_moment,
)
from hose_mj.hoses.snapshots import take, take_array, take_count, undo
from hose_mj.hoses.spec import HoseSpec, check_number, check_spec
from hose_mj.hoses.springs import Spring

_TURN_TOLERANCE = 2e-3
"""What a change of theta (rad) may be when Newton's iteration stops."""
_MOVED = {
    "obstacles": "contacts.obstacles",
    "contact_arc_lengths": "contacts.arc_lengths",
    "add_floor": "contacts.add_floor",
    "move_obstacle": "contacts.move_obstacle",
    "set_distances": "contacts.set_distances",
    "contact_forces": "contacts.compute_forces",
    "contact_reactions": "contacts.list_reactions",
}
"""Names of the hose that the documents once had, and where they are now; for one release."""


class GedsHose(SplineBody):
    """Geometrically Exact Dynamic Splines (thesis appendix A) with an implicit integrator.

    Queries (position, tension, energies, ...) are those of `SplineBody`.

    Args:
        spec: the hose.
        timestep: length of a step (s).
        gravity: (3,) m/s^2.
        control_points: n; the cost of a step is linear in it.
        plane: None for space; "xy", "xz" or "yz" for a hose that stays in that plane, at a fraction
            of the cost.
        twist: "scalar" for one angle between two clamps, "theta" for an angle at every control
            point; None for what the spec needs: theta in space where the hose is curved at rest or
            bends unequally. "frenet" is the literal strain of GEDS, to reproduce how it fails
            (docs/frenet.md): theta is then the angle from the Frenet normal, a clamp holds that
            angle, and `reset` sets theta = 0, so that the hose is twisted by its curve's torsion.
        scheme: "bdf2" (default), "backward-euler", "sdirk2", "midpoint" or "verlet".
        tolerance: Newton goes on while it moves a control point by more than this fraction of L.
        force_tolerance: Newton goes on while it leaves more than this fraction of the force scale:
            loads, inertia and what holds the hose, in sum. It is what stiff, slack hoses need.
        max_iterations: Newton iterations in a stage before the careful fallback.
        obstacles: what the hose may touch; `set_obstacles` changes it.
        contact_law: numbers of the contact; None for the defaults.
        fluid: water or air about the hose, whose weight then counts less what it displaces; None
            for none.
        strict: whether what `health` warns of is a `StepError` instead.

    Attributes:
        spec, gravity, scheme, fluid: as given.
        contacts: obstacles and contact forces.
        coupling: steps with bodies that feel the hose.

    Raises:
        InputError: a value outside its valid set, named.
    """

    def __init__(
        self,
        spec: HoseSpec,
        *,
        timestep: float = 0.005,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        control_points: int = 16,
        plane: str | None = None,
        twist: str | None = None,
        scheme: str = "bdf2",
        tolerance: float = 2e-4,
        force_tolerance: float = 5e-3,
        max_iterations: int = 20,
        obstacles: Sequence[Obstacle] = (),
        contact_law: ContactLaw | None = None,
        fluid: Fluid | None = None,
        strict: bool = False,
    ) -> None:
        check_spec(spec)
        check_number("timestep", timestep)
        check_number("tolerance", tolerance)
        check_number("force_tolerance", force_tolerance)
        check_count("max_iterations", max_iterations, 1)
        has_theta = mechanics.check_twist(twist, spec, plane)
        self.fluid = check_fluid(fluid)
        mechanics.check_scheme(scheme, spec, has_theta, fluid is not None)
        spline = Spline(control_points, spec.length, plane, has_theta)
        super().__init__(spec, spline, gravity, twist == "frenet")
        self.scheme = scheme
        move = tolerance * spec.length
        turn_length = move / _TURN_TOLERANCE
        limits = records.Limits(
            move, turn_length, max_iterations, np.inf, False, 0.0, force_tolerance
        )
        self.contacts = ContactSet(spline, spec, move, float(timestep), self._state, scheme)
        load = FluidLoad(spline, spec, self._hose.tables, self.fluid)
        self._weight += load.compute_buoyancy(self.gravity)
        self._loads = LoadSet(spline, self._weight, self.contacts, load)
        self._counts = np.zeros(4, dtype=np.int64)
        self._links: Line | None = None
        self._has_ends = False
        self._watch = HealthWatch(spec.length, strict)
        self._dynamics = Dynamics(
            *(self._axes, self._hose, self._constraints, self._loads, limits),
            *(scheme, float(timestep), self._state, self._counts, self._watch),
        )
        self.coupling = BodyCoupling(self._dynamics)
        if check_records("obstacles", obstacles, Obstacle) or contact_law is not None:
            self.set_obstacles(obstacles, contact_law)
        self.reset(lambda s: np.outer(s, np.eye(3)[self._spline.dims[0]]))

    # -- state -----------------------------------------------------------------------------------

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        return self._dynamics.timestep

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return self._dynamics.time

    @property
    def iterations(self) -> int:
        """Newton iterations so far."""
        return int(self._counts[ITERATIONS])

    @property
    def fallbacks(self) -> int:
        """How often a solve needed the Gauss-Newton matrix or the careful iteration so far."""
        return int(self._counts[FALLBACKS])

    def reset(
        self, curve: Curve, velocity: Curve | None = None, director: ArrayLike | None = None
    ) -> None:
        """Puts the hose along a curve (thesis A.3), at rest or moving; drops holds and loads.

        The curve is followed at an even pace, whatever its own: the strain is the same all along,
        and a `HoseWarning` says so where it is above 1 %. The material is free of torque, but for
        twist="frenet" (docs/frenet.md). A closed loop is open again.

        Args:
            curve: points (k, 3) m, or a function of arc lengths (k,) that returns them.
            velocity: m/s, world frame: (3,), or rows (k, 3) spread evenly over the arc length, or a
                function of arc lengths (k,) that returns (k, 3); None for rest.
            director: m1 where the hose begins, (3,), its part along the tangent ignored; only a
                hose with theta reads it. None for any.

        Raises:
            InputError: a curve or a velocity that is not finite, has a wrong shape or leaves the
                plane of a planar hose; a curve far from the hose's length. Nothing changed then.
        """
        start = None if director is None else check_vector("director", director)
        self._set_shape(curve, velocity)
        self._start(start)
        strains = self._measure_strains()[:, 0]
        largest = float(strains[np.argmax(np.abs(strains))])
        self._watch.check_laid(largest, self.spec.axial_stiffness)

    def set_control_points(self, points: ArrayLike) -> None:
        """Puts the control points at (n, 3) m, at rest, however odd; drops holds and loads.

        Meant for tests of odd states; `reset` is for use. A planar hose takes its plane from the
        first point.

        Raises:
            InputError: a wrong shape, a number that is not finite, points out of the plane.
        """
        self._set_points(points)
        self._start()

    def snapshot(self) -> dict[str, Any]:
        """All that `restore` needs to continue bit by bit: arrays, numbers, containers of them."""
        return {
            "state": {name: part.copy() for name, part in self._state._asdict().items()},
            "offset": self._spline.offset.copy(),
            "steps": int(self._counts[STEPS]),
            "holds": self._constraints.snapshot(),
            "loads": self._loads.snapshot(),
            "contacts": self.contacts.snapshot(),
            "iterations": self.iterations,
            "fallbacks": self.fallbacks,
            "retries": int(self._counts[RETRIES]),
            "first_energy": self._find_first(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot of this hose, or of one with as many control points and unknowns.

        Raises:
            InputError: what is no snapshot, or one of a hose with another number of unknowns;
                nothing has changed then.
        """
        before = self.snapshot()
        with undo(lambda: self._restore(before)):
            self._restore(state)

    def _restore(self, state: dict[str, Any]) -> None:
        parts = take(state, "state")
        size = len(take_array(parts, "x", (None,)))
        if size != self._spline.size:
            valid = f"{self._spline.size}, as in this hose"
            raise InputError("number of unknowns in the snapshot", size, valid)
        shapes = {name: part.shape for name, part in self._state._asdict().items()}
        read = {name: take_array(parts, name, shape) for name, shape in shapes.items()}
        offset = take_array(state, "offset", (3,))
        names = ("steps", "iterations", "fallbacks", "retries")
        counts = [take_count(state, name) for name in names]
        self._set_state(integrators.State(**read))
        self._spline.offset = offset
        self._counts[:] = counts
        self._watch.resume(counts[0], counts[3])
        self._loads.restore(take(state, "loads"))
        self._constraints.restore(take(state, "holds"))
        self._constraints.set_moments(self._loads.list_moments())
        contacts = take(state, "contacts")
        for name, part in self.contacts.snapshot().items():
            if isinstance(part, np.ndarray):
                rows = take_array(contacts, name, (None, *part.shape[1:]), is_finite=False)
                contacts = contacts | {name: rows}
        self.contacts.restore(contacts)
        self.contacts.set_closed(self.is_closed)
        first_energy = take_array(state, "first_energy", (), is_finite=False)
        if np.isnan(first_energy):
            raise InputError("first_energy of a snapshot", first_energy, "a number (J)")
        self._dynamics.first_energy, self._links, self._has_ends = float(first_energy), None, False
        self.contacts.works = False

    # -- holds and loads ---------------------------------------------------------------------------

    def clamp(
        self,
        arc_length: float,
        position: ArrayLike | None = None,
        tangent: ArrayLike | None = None,
        director: ArrayLike | None = None,
        spring: Spring | None = None,
    ) -> Hold:
        """Holds a point, the tangent and the material's angle there; by default where they are now.

        Position (3,) m, tangent (3,) and director (3,), of any length above 0, are in the world
        frame; the director is where m1 is to point, its part along the tangent ignored, reached by
        a turn of less than half. With a spring the hold gives way by it, place and tangent, and
        `move` moves its target. Raises `InputError` for a place off the hose or taken, for vectors
        out of a planar hose's plane, and for a spring with an explicit scheme.
        """
        self._check_spring(spring)
        place = self._spline.check_place(arc_length)
        aim = self._spline.check_direction(self.tangent(place)[0] if tangent is None else tangent)
        across = None if director is None else self._constraints.check_director(director, aim)
        hold = self._constraints.add(arc_length, position, aim, spring)
        if across is not None:
            self._constraints.turn_to(hold, across)
        return hold

    def attach(
        self, arc_length: float, position: ArrayLike | None = None, spring: Spring | None = None
    ) -> Hold:
        """Holds a point and leaves the tangent free; by default where it is now. See `clamp`."""
        self._check_spring(spring)
        return self._constraints.add(arc_length, position, None, spring)

    def move(
        self,
        hold: Hold,
        position: ArrayLike | None = None,
        tangent: ArrayLike | None = None,
        spin: float = 0.0,
        frame: ArrayLike | None = None,
    ) -> None:
        """Sets where a hold is to be at the end of the next step: position (3,) m, tangent (3,).

        A clamp's material goes along by the smallest rotation to the new tangent and is turned by
        `spin` (rad, right-handed about the tangent, any number of turns) on top. A `frame` says all
        of that at once: a rotation matrix (3, 3) as `frame` gives it, to which the material turns
        by less than half a turn. Raises `InputError` for a hold that was released, a tangent, a
        spin or a frame for an attachment, vectors out of a planar hose's plane, a frame that is no
        rotation or comes with a tangent or a spin.
        """
        if frame is None:
            self._constraints.move(hold, position, tangent, spin)
            self._turn_hold(tangent is not None, spin != 0.0)
            return
        axes = check_rotation("frame", frame)
        self._turn_hold(True, True)
        if tangent is not None or spin != 0.0:
            raise InputError.about(
                "a clamp moved by a frame takes no tangent and no spin beside it"
            )
        if self._spline.dimension == 2:
            self._constraints.move(hold, position, axes[:, 0], 0.0)
            return
        across = self._constraints.check_director(axes[:, 1], axes[:, 0])
        self._constraints.move(hold, position, axes[:, 0], 0.0)
        self._constraints.turn_to(hold, across)

    @property
    def holds(self) -> list[Hold]:
        """All clamps and attachments, the oldest first."""
        return self._constraints.list_all()

    def release(self, hold: Hold) -> None:
        """Lets go; raises `InputError` for a hold that was released before."""
        self._constraints.release(hold)

    def reaction(self, hold: Hold) -> Reaction:
        """Force (N) and moment (N m) of a hold on the hose at the end of the last step.

        Both in the world frame. Raises `InputError` for a hold that was released.
        """
        return self._constraints.reaction(hold)

    def close(self, spin: float = 0.0) -> None:
        """Joins the end of the hose to its beginning: an O-ring, a belt, a rubber band.

        Place and r' go on across the joint from the end of the next step on, and so does the
        material: its end is turned by `spin` (rad, right-handed about the tangent, any number of
        turns) and then glued. Lay the hose along a closed curve first (`loops.make_circle`).
        `open` and `reset` part the ends.

        Raises:
            InputError: a hose with theta, one that is closed or held at both ends, ends that do not
                meet, a spin in a plane. Nothing changed then.
        """
        if self._spline.has_theta:
            raise InputError("twist", "theta", "scalar for a hose that is to be closed")
        self._constraints.close(spin)
        self._turn_hold(False, spin != 0.0)
        self.contacts.set_closed(True)

    def open(self) -> None:
        """Parts the ends that `close` has joined; raises `InputError` for an open hose."""
        self._constraints.open()
        self.contacts.set_closed(False)

    @property
    def is_closed(self) -> bool:
        """Whether the ends are joined."""
        return self._constraints.is_closed

    def apply_force(self, arc_length: float, force: ArrayLike) -> None:
        """Adds a point force (3,) N that acts until `clear_loads` (thesis A.27)."""
        self._loads.add_force(arc_length, force)

    def apply_moment(self, arc_length: float, moment: ArrayLike) -> None:
        """Adds a point moment (3,) N m until `clear_loads`; its part along the tangent twists.

        A hose without torsional stiffness carries no such part, and says so (`HoseWarning`).
        """
        self._loads.add_moment(arc_length, moment)
        self._dynamics.first_energy = np.inf
        self._constraints.set_moments(self._loads.list_moments())
        if self.spec.torsional_stiffness == 0.0 and self._spline.dimension == 3:
            place, vector = self._loads.list_moments()[-1]
            warn_of_lost_moment(vector, self.tangent(place)[0], place, stacklevel=3)

    def set_push(self, arc_lengths: ArrayLike, forces: ArrayLike) -> None:
        """Replaces the forces (k, 3), N, by which a neighbour pushes at arc lengths (k,), m.

        They act beside those of `apply_force` until the next call or a reset.
        """
        self._loads.set_push(arc_lengths, forces)

    def set_obstacles(self, obstacles: Sequence[Obstacle], law: ContactLaw | None = None) -> None:
        """Replaces what the hose may touch; see `ContactSet.set_obstacles`."""
        self.contacts.set_obstacles(obstacles, law)

    def clear_loads(self) -> None:
        """Drops all point forces and moments; gravity stays."""
        self._loads.clear()
        self._constraints.set_moments([])

    # -- motion ------------------------------------------------------------------------------------

    def step(self, n_steps: int = 1) -> None:
        """Advances the clock by n_steps steps.

        Raises:
            InputError: n_steps is not a whole number at or above 0.
            StepError: a step that no fallback finished; the last step that worked is kept.
        """
        if check_count("n_steps", n_steps, 0) == 0:
            return
        self._warn_of_spin()
        self._begin_links()
        self._dynamics.advance(int(n_steps))

    def follow(self, positions: Rows, tangents: Rows | None = None) -> None:
        """Takes as many steps as paths have rows; see `HoseModel.follow`. One compiled call.

        Bit by bit what `move` and `step` do in turn, but that all rows are looked at first: one
        that is refused, or a jump with `strict`, changes nothing.
        """
        n_steps, paths = check_paths(positions, tangents)
        if n_steps > 0:
            self._warn_of_spin()
            self._begin_links()
            if tangents:
                self._links = None
            self._dynamics.follow(paths, n_steps)

    @property
    def health(self) -> Health:
        """How well it went since the last reset."""
        steps, _, _, retries = self._counts.tolist()
        found = self.contacts.deepest, self.contacts.crossings, self.contacts.measure_turn()
        gained = self._measure_energy() - self._find_first() - float(self._state.work[0])
        rest = (gained if np.isfinite(gained) else np.nan, self._draw_line(), self._links)
        return self._watch.report(steps, retries, *found, self.measure_least_stretch, *rest)

    @contextmanager
    def unwatched(self) -> Iterator[None]:
        """Leaves `health` as it is, and says nothing, while something is tried and taken back."""
        with self._watch.pause():
            before = self.contacts.snapshot_findings()
            try:
                yield
            finally:
                self.contacts.restore_findings(before)

    def solve_static(self, load_steps: int = 1) -> Equilibrium:
        """Moves the hose to static equilibrium under its holds and loads; velocity becomes zero.

        The loads grow in `load_steps` equal steps, in two, four, ... times as many if that fails.
        An equilibrium that is unstable or folded is said by a `HoseWarning` too. It counts as
        unstable where a disturbance grows faster than some hundredth of the slowest bending motion.
        A moment that acts in space has no energy, nor has a current's drag, which is left out: the
        symmetric part of the stiffness decides then, which may err, and no warning is given.

        Raises:
            InputError: load_steps is not a whole number from 1 to 64; a closed loop that nothing
                holds.
            StepError: no equilibrium was found; the state before is kept.
        """
        check_count("load_steps", load_steps, 1, MOST_LOAD_STEPS)
        if self.is_closed and self._constraints.is_free:
            valid = "a clamp, or attachments: a loop that nothing holds is at rest anywhere"
            raise InputError("holds of a closed loop", "none", valid)
        self._warn_of_spin()
        self._dynamics.solve_static(int(load_steps))
        self._constraints.is_moved = False
        self.contacts.forget()
        self._forget_work()
        least = self.measure_least_stretch()
        found = Equilibrium(self._dynamics.check_stability(), least < FOLDED, least)
        turns = self._spline.dimension == 3 and bool(self._loads.list_moments())
        if found.is_folded or not (turns or self._loads.fluid.moves):
            found.warn(stacklevel=3)
        return found

    def linearize(self) -> Linearization:
        """Mass, tangent stiffness and constraint rows in the control points' n d coordinates."""
        return self._dynamics.linearize()

    def compute_required_forces(self, acceleration: ArrayLike) -> Array:
        """Forces on the control points for wanted accelerations of theirs (inverse dynamics).

        Thesis A.25 with the sign of its P derived from the energy: F_p = M A + dU/dp + C v - F_e.

        Args:
            acceleration: of the control points, (n, 3), m/s^2.

        Returns:
            (n, 3) N; for robots at arc lengths s it is J_pr(s) F_r where that can be met exactly.

        Raises:
            InputError: a wrong shape or a number that is not finite.
        """
        wanted = check_rows("acceleration", acceleration, self._spline.n_control_points)
        work = self._dynamics.build_tangent()
        drag = self._hose.drag_rate * self._state.v
        flat = self._spline.from_world(wanted)
        self._dynamics.add_fluid(flat, work)
        inertia = self._multiply_mass(flat + drag)
        internal = work.gradient[: self._spline.size]
        return self._spline.to_world(inertia + internal - self._loads.loads.force)

    # -- inside ------------------------------------------------------------------------------------

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Finds a name that has moved to a part of the hose, with a warning that says where."""
            if name not in _MOVED:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            moved = _MOVED[name]
            warnings.warn(
                f"GedsHose.{name} is now GedsHose.{moved}", DeprecationWarning, stacklevel=2
            )
            return operator.attrgetter(moved)(self)

    def _check_spring(self, spring: Spring | None) -> None:
        if spring is not None and self.scheme == "verlet":
            raise InputError("scheme", self.scheme, "an implicit scheme for a hold with a spring")

    def _warn_of_spin(self) -> None:
        """Says that moments about the tangent have nothing that would balance them, if so."""
        rest = self._constraints.measure_unbalanced_torque()
        if rest != 0.0:
            warnings.warn(
                f"nothing holds the hose against turning about its axis by {rest:.3g} N m: it "
                "would spin ever faster, which the scalar twist does not show; clamp it, or make "
                'it with twist="theta"',
                HoseWarning,
                stacklevel=3,
            )

    def _start(self, director: Array | None = None) -> None:
        self._counts[STEPS] = 0
        self._watch.reset(int(self._counts[RETRIES]))
        self.contacts.set_closed(False)
        self.contacts.forget()
        self._loads.clear()
        self._constraints.clear(director)
        self._forget_work()

    def _forget_work(self) -> None:
        """Begins to count work and links anew."""
        self._state.work[0], self._links, self._has_ends = 0.0, None, False
        self._dynamics.first_energy = self._measure_energy()

    def _turn_hold(self, is_turned: bool, is_spun: bool) -> None:
        """Counts no links from where a hold was turned, and no work where it was spun."""
        if is_turned:
            self._links = None
        if is_spun:
            self._dynamics.first_energy = np.inf

    def _find_first(self) -> float:
        """Energy where the count of work begins (J); infinite where work is not known any more."""
        return np.inf if self.contacts.works else self._dynamics.first_energy

    def _measure_energy(self) -> float:
        """Kinetic and elastic energy (J): gravity counts as a load."""
        found = self.energies()
        return found.total - found.gravitational

    def _draw_line(self) -> Line:
        """The centre line of now."""
        length, radius = self.spec.length, self.spec.outer_radius
        pauses = round(min(max(length / (2.0 * radius), 4.0 * len(self._hose.tables.first)), 240.0))
        twist = float(self.twist((np.arange(16) + 0.5) / 16.0 * length).mean()) * length
        turns = (twist - self._constraints.spun) / (2.0 * np.pi)
        points = self.position(np.linspace(0.0, length, pauses + 1))
        return Line(points, length, radius, self.is_closed, turns)

    def _begin_links(self) -> None:
        """Remembers the centre line from which links are counted, once both ends are held."""
        if self._has_ends != self._constraints.is_linked:
            self._has_ends = not self._has_ends
            self._links = self._draw_line() if self._has_ends else None
