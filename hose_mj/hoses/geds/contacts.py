"""`ContactSet`: what a hose may touch and what it feels there, `hose.contacts`; see contact.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds import basis, contact, contact_law, self_contact, shapes
from hose_mj.hoses.geds.integrators import State
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.inputs import check_count, check_records, read_numbers
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.protocol import Array, Reaction
from hose_mj.hoses.spec import HoseSpec, check_number

_CODES = {
    "plane": shapes.PLANE,
    "sphere": shapes.SPHERE,
    "capsule": shapes.CAPSULE,
    "cylinder": shapes.CYLINDER,
    "box": shapes.BOX,
}
_HARDENING = 0.1
"""From this part of the radius on the default law hardens: twice as hard there, five times at two
such depths, so that what breaks the hose does not cut it."""
_SELF_SCALE, _SELF_WIDTH = 0.1, 0.1
"""Of the stiffness, and of the radius: what meets along less than a radius is softer."""
_MOST_SOFT = 512
"""Soft rows of a hose on itself at most, of which the solve costs the square."""
_FINDINGS = [contact_law.DEEPEST, contact_law.CROSSINGS]
_SPARE = 64
"""Room for pairs beyond two surfaces at every contact point."""


class ContactSet:
    """Obstacles, distances handed in and a neighbouring hose, with the contact law.

    Args:
        spline: the hose's geometry.
        spec: the hose.
        tolerance: how far a control point may still move when Newton's iteration ends (m).
        timestep: s.
        state: the hose's, read where forces are asked for.
        scheme: the hose's integrator: contact is too stiff for an explicit one.

    Attributes:
        contact: what the kernels read; made anew by every change but a move.
        obstacles: the shapes; their places here are the numbers that `move_obstacle` takes.
        law: numbers of the contact law.
        arc_lengths: where along the hose contact is looked for, (Q,), m.
        order: the world axes in the order of the hose's coordinates.
        works: whether what is touched has moved since the last reset.
    """

    contact: contact_law.Contact
    obstacles: tuple[Obstacle, ...]
    arc_lengths: Array
    _points: Array
    _first: np.ndarray
    _memory: Array
    _slides: Array
    _pairs: Array
    _block: Array
    _found: Array
    _changes: Array
    _room: Array
    _mates: Array
    _strands: Array

    def __init__(
        self,
        spline: Spline,
        spec: HoseSpec,
        tolerance: float,
        timestep: float,
        state: State,
        scheme: str = "bdf2",
    ) -> None:
        self._spline, self._spec, self._timestep = spline, spec, timestep
        self._state, self._scheme, self._tolerance = state, scheme, tolerance
        self._is_closed = self.works = False
        # The hose's coordinates first: a reflection where that is an odd permutation.
        rest = [c for c in range(3) if c not in spline.dims]
        self.order = [*spline.dims, *rest]
        self._parity = float(np.linalg.det(np.eye(3)[self.order]))
        self._found = np.zeros(7)  # outlives what may be touched
        self._set((), ContactLaw())

    # -- what may be touched ---------------------------------------------------------------------

    def set_obstacles(self, obstacles: Sequence[Obstacle], law: ContactLaw | None = None) -> None:
        """Replaces what the hose may touch; it stays through `reset`. An empty list costs nothing.

        Drops distances handed in and the neighbour.

        Args:
            obstacles: rigid shapes.
            law: numbers of the contact law; None for the defaults.

        Raises:
            InputError: something that is not an obstacle; a friction profile longer than the hose;
                the explicit scheme.
        """
        self._check_implicit()
        if law is not None and not isinstance(law, ContactLaw):
            raise InputError("law", law, "a ContactLaw or None")
        for stretch in () if law is None else law.friction_profile:
            if stretch[1] > self._spline.length * (1.0 + 1e-9):
                valid = f"stretches of the hose, from 0 to {self._spline.length:g} (m)"
                raise InputError("friction_profile", stretch, valid)
        self._set(check_records("obstacles", obstacles, Obstacle), law or ContactLaw())

    def add_floor(self, height: float = 0.0, friction: float = 0.5) -> int:
        """Adds a horizontal floor below the hose at z = height (m); returns its number."""
        floor = Obstacle(kind="plane", position=(0.0, 0.0, height), friction=friction)
        self.set_obstacles([*self.obstacles, floor], self.law)
        return len(self.obstacles) - 1

    def move_obstacle(
        self,
        number: int,
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
    ) -> None:
        """Sets where an obstacle is at the end of the next step, and how fast; see `Obstacle`.

        Only the velocities that are given rub: they are not derived from the places.

        Raises:
            InputError: a number that no obstacle has, a value outside its range.
        """
        check_count("obstacle", number, 0, len(self.obstacles) - 1)
        self.works = True
        changes = {"position": position, "rotation": rotation}
        changes |= {"velocity": velocity, "angular_velocity": angular_velocity}
        wanted: dict[str, Any] = {name: v for name, v in changes.items() if v is not None}
        moved = replace(self.obstacles[number], **wanted)
        self.obstacles = (*self.obstacles[:number], moved, *self.obstacles[number + 1 :])
        self.contact.geoms[number] = self._make_row(moved)

    def place_obstacles(
        self, numbers: np.ndarray, positions: Array, rotations: Array, twists: Array
    ) -> None:
        """Moves obstacles at once and unchecked, for worlds; `obstacles` keeps what was set.

        Args:
            numbers: of the obstacles, (k,).
            positions: of each at the end of the next step, (k, 3), m.
            rotations: (k, 3, 3).
            twists: velocity and angular velocity, (k, 6), m/s, rad/s.
        """
        self.works = True
        rows, order, k = self.contact.geoms, self.order, len(numbers)
        at = shapes.POSITION
        rows[numbers, at : at + 3] = (positions - self._spline.offset)[:, order]
        at = shapes.ROTATION
        rows[numbers, at : at + 9] = rotations[:, order].reshape(k, 9)
        at = shapes.VELOCITY
        rows[numbers, at : at + 3] = twists[:, order]
        at = shapes.SPIN
        rows[numbers, at : at + 3] = self._parity * twists[:, 3:][:, order]

    def set_distances(
        self,
        distances: ArrayLike | None,
        normals: ArrayLike = (0.0, 0.0, 1.0),
        friction: ArrayLike = 0.5,
        velocities: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Hands in signed distances for the steps to come, for shapes that are no `Obstacle`.

        They are kept fixed until the next call: hand in fresh ones before each step.

        Args:
            distances: from the centre line at `arc_lengths` to the surface, (Q,), m; above a radius
                for no contact. None for none.
            normals: outward unit normals there, (Q, 3) or one for all.
            friction: coefficients, (Q,) or one.
            velocities: of the surface, (Q, 3) or one, m/s.

        Raises:
            InputError: a wrong shape, a number that is not finite; the explicit scheme.
        """
        self._check_implicit()
        self.works = True
        q = 0 if distances is None else len(self.arc_lengths)
        given = np.zeros((q, contact_law.GIVEN))
        if distances is not None:
            gaps = read_numbers("distances", distances, "finite numbers (m)")
            turned = read_numbers("normals", normals, "finite numbers")
            speeds = read_numbers("velocities", velocities, "finite numbers (m/s)")
            rough = read_numbers("friction", friction, "finite numbers at or above 0")
            try:
                given[:, 0] = gaps
                given[:, 1:4] = turned[..., self.order]
                given[:, 4] = rough
                given[:, 5:8] = speeds[..., self.order]
            except (ValueError, IndexError):
                valid = f"distances ({q},), normals and velocities ({q}, 3), friction ({q},)"
                raise InputError("shapes of the distances", gaps.shape, valid) from None
            if not np.all(np.isfinite(given)) or np.any(given[:, 4] < 0.0):
                raise InputError("distances", distances, "finite numbers, friction at or above 0")
            place = self._spline.evaluate(self.arc_lengths, self._state.x)
            given[:, 8:11] = place[:, self.order]
        self._given = given
        self._rebuild()

    def set_neighbour(
        self,
        points: ArrayLike,
        velocities: ArrayLike,
        radius: float,
        friction: float,
        stiffness: float,
    ) -> None:
        """Hands in another hose as moving capsules, for the steps to come; see `HosePair`.

        Args:
            points: ends of the capsules (m + 1, 3), m.
            velocities: of these ends (m + 1, 3), m/s.
            radius: m.
            friction: Coulomb's coefficient.
            stiffness: of this contact (N/m^2); the rest of the law is the hose's.

        Raises:
            InputError: a wrong shape or a value outside its range; the explicit scheme.
        """
        self._check_implicit()
        self.works = True
        places = read_numbers("neighbour", points, "finite places (m)")
        speeds = read_numbers("velocities of the neighbour", velocities, "finite numbers (m/s)")
        if places.ndim != 2 or places.shape[1:] != (3,) or len(places) < 2:
            raise InputError("shape of the neighbour", places.shape, "(m + 1, 3) with m >= 1")
        if speeds.shape != places.shape:
            raise InputError("shape of the neighbour's velocities", speeds.shape, str(places.shape))
        if not np.all(np.isfinite(places)) or not np.all(np.isfinite(speeds)):
            raise InputError("neighbour", places, "finite places and velocities")
        check_number("radius", radius)
        check_number("friction", friction, may_be_zero=True)
        check_number("stiffness", stiffness)
        ends = (places - self._spline.offset)[:, self.order]
        self._capsules = _make_capsules(ends, speeds[:, self.order], radius)
        self._capsules[:, shapes.FRICTION] = friction
        self._capsules[:, shapes.SCALE] = stiffness / self._numbers[contact_law.STIFFNESS]
        self._rebuild()

    def forget(self) -> None:
        """Lets go of what friction holds, and of the greatest depth."""
        self._memory[:] = 0.0
        self._strands[:] = 0.0
        self._strands[:, :, 0] = -1.0
        self._found[:] = 0.0
        self.works = False

    @property
    def deepest(self) -> float:
        """The greatest depth of a contact since the last reset, in radii; 0 where nothing sank."""
        return float(self._found[contact_law.DEEPEST])

    @property
    def n_soft(self) -> int:
        """How many soft rows contact may add to the matrix."""
        return min(6 * len(self._mates), _MOST_SOFT)

    @property
    def crossings(self) -> int:
        """How often a contact point was beyond the middle of another part of the hose."""
        return int(self._found[contact_law.CROSSINGS])

    def measure_turn(self) -> float:
        """By how much the tangent turns within a span round what pushes at it, at most (rad).

        For small turns: it is the change of the unit tangent against the span's contact force.
        """
        touching = self.contact.pairs[: int(self._found[contact_law.TOUCHED])]
        if len(touching) == 0:
            return 0.0
        d, n_dof = self._spline.dimension, self._spline.n_dof
        tangents = self._knot_slopes @ self._state.x.reshape(-1, n_dof)[:, :d]
        tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-12)
        forces = np.zeros((len(tangents) - 1, d))
        np.add.at(forces, touching[:, 14].astype(np.int64), touching[:, 2 : 2 + d])
        sizes = np.maximum(np.linalg.norm(forces, axis=1), 1e-300)
        turns = -np.sum(np.diff(tangents, axis=0) * forces, axis=1) / sizes
        return float(max(turns.max(), 0.0))

    @cached_property
    def _knot_slopes(self) -> Array:
        """What the control points count for in r' where spans meet, (S + 1, n), 1/m."""
        n_spans = self._spline.n_control_points - basis.DEGREE
        return self._spline.compute_jacobian(
            np.linspace(0.0, self._spline.length, n_spans + 1), 1
        ).T

    def set_closed(self, is_closed: bool) -> None:
        """Says whether the hose is a closed loop, whose ends do not touch each other."""
        self._is_closed = is_closed
        self._numbers = self._make_law()
        self._rebuild()

    def compute_stiffness(self) -> float:
        """What a contact's force per length grows by with the depth within one step, N/m^2.

        Its damping counts as what it adds to that in an implicit step.
        """
        damping = 2.0 * self._numbers[contact_law.DAMPING] / self._timestep
        return float(self._numbers[contact_law.STIFFNESS] * (1.0 + damping))

    def make_shapes(self, obstacles: Sequence[Obstacle]) -> Array:
        """Returns obstacles as kernels read them, rows of shapes.py, (G, ROW)."""
        rows = np.zeros((len(obstacles), shapes.ROW))
        for row, obstacle in zip(rows, obstacles, strict=True):
            row[:] = self._make_row(obstacle)
        return rows

    def measure_obstacles(self, points: ArrayLike) -> Array:
        """Signed distances of points (k, 3), m, from each obstacle, (G, k), m.

        Raises:
            InputError: points that are not finite or of another shape.
        """
        places = read_numbers("points", points, "finite numbers, shape (k, 3)")
        if places.ndim != 2 or places.shape[1] != 3 or not np.all(np.isfinite(places)):
            raise InputError("points", places.shape, "finite numbers, shape (k, 3)")
        local = np.ascontiguousarray((places - self._spline.offset)[:, self.order])
        found = np.zeros((len(self.obstacles), len(places)))
        normals = np.zeros_like(local)
        for g, row in enumerate(found):
            shapes.measure_points(self.contact.geoms, g, local, row, normals)
        return found

    # -- forces ----------------------------------------------------------------------------------

    def compute_forces(self) -> Array:
        """Contact forces on the hose at `arc_lengths`, (Q, 3), N, world frame."""
        return self._to_world(self._compute_local(self.contact)[0])

    def compute_given_forces(self) -> Array:
        """The part of `compute_forces` that comes from distances handed in, (Q, 3), N."""
        alone = self.contact._replace(geoms=np.zeros((0, shapes.ROW)))
        return self._to_world(self._compute_local(alone)[0])

    def compute_reactions(self) -> Array:
        """What the hose does to each obstacle, (G, 6): force (N), moment about its position."""
        found = self._compute_local(self.contact)[1][: len(self.obstacles)]
        return np.concatenate(self._split(found), axis=1)

    def list_reactions(self) -> list[Reaction]:
        """`compute_reactions` as one record for each obstacle."""
        return [Reaction(row[:3], row[3:]) for row in self.compute_reactions()]

    def compute_neighbour_forces(self) -> Array:
        """What the hose does to the ends of the neighbour's capsules, (m + 1, 3), N, world frame.

        A moment about a capsule's middle becomes a couple of forces at its ends; what lies along
        its axis is lost.
        """
        found = self._compute_local(self.contact)[1][len(self.obstacles) :]
        forces, moments = self._split(found)
        turned = self._capsules[:, shapes.ROTATION + 2 : shapes.ROTATION + 9 : 3]
        axes = self._to_world(turned) * (2.0 * self._capsules[:, [shapes.SIZE + 1]])
        couple = np.cross(moments, axes) / np.sum(axes**2, axis=1, keepdims=True)
        ends = np.zeros((len(found) + 1, 3))
        ends[:-1] += 0.5 * forces - couple
        ends[1:] += 0.5 * forces + couple
        return ends

    # -- state -----------------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """All of it as arrays, plain numbers and containers of them."""
        return {
            "obstacles": [
                {f.name: _copy(getattr(one, f.name)) for f in fields(one)} for one in self.obstacles
            ],
            "law": asdict(self.law),
            "given": self._given.copy(),
            "capsules": self._capsules.copy(),
            "memory": self._memory.copy(),
            "strands": self._strands.copy(),
            "sight": float(self._found[contact_law.SIGHT]),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot."""
        self._set([Obstacle(**one) for one in state["obstacles"]], ContactLaw(**state["law"]))
        self._given = state["given"].copy()
        self._capsules = state["capsules"].copy()
        self._memory[:] = state["memory"]
        self._strands[:] = state["strands"]
        self._found[contact_law.SIGHT] = state["sight"]
        self._rebuild()

    def snapshot_findings(self) -> Array:
        """Returns `deepest` and `crossings`, which are no part of a snapshot."""
        return np.array(self._found[_FINDINGS])

    def restore_findings(self, findings: Array) -> None:
        """Returns to what `snapshot_findings` gave."""
        self._found[_FINDINGS] = findings

    # -- inside ----------------------------------------------------------------------------------

    def _check_implicit(self) -> None:
        if self._scheme == "verlet":
            valid = "an implicit scheme for a hose with obstacles"
            raise InputError("scheme", self._scheme, valid)

    def _set(self, obstacles: Sequence[Obstacle], law: ContactLaw) -> None:
        self.obstacles, self.law = tuple(obstacles), law
        self._given = np.zeros((0, contact_law.GIVEN))
        self._capsules = np.zeros((0, shapes.ROW))
        self._numbers = self._make_law()
        self._make_points()
        self._rebuild()

    def _rebuild(self) -> None:
        """Makes what the kernels read."""
        geoms = np.concatenate([self.make_shapes(self.obstacles), self._capsules])
        knots = self._spline.knots
        self.contact = contact_law.Contact(
            points=self._points,
            first=self._first,
            slopes=basis.DEGREE / (knots[4:-1] - knots[1:-4]),
            geoms=geoms,
            given=self._given,
            law=self._numbers,
            arcs=self.arc_lengths,
            memory=self._memory,
            slides=self._slides,
            pairs=self._pairs,
            block=self._block,
            found=self._found,
            changes=self._changes,
            room=self._room,
            mates=self._mates,
            strands=self._strands,
            forces=np.zeros((len(self._points), 3)),
            reactions=np.zeros((len(geoms), 6)),
        )

    def _compute_local(self, touched: contact_law.Contact) -> tuple[Array, Array]:
        """Forces on the hose (Q, 3) and on the geoms (G, 6) in the hose's coordinates."""
        forces = np.zeros((len(self._points), 3))
        reactions = np.zeros((len(touched.geoms), 6))
        x, v = self._state.x, self._state.v
        contact.compute_forces(self._spline.axes, touched, x, v, forces, reactions)
        return forces, reactions

    def _split(self, rows: Array) -> tuple[Array, Array]:
        """Forces and moments (k, 3) in the world frame from the geoms' rows (k, 6)."""
        return self._to_world(rows[:, :3]), self._parity * self._to_world(rows[:, 3:])

    def _make_law(self) -> Array:
        spec, radius = self._spec, self._spec.outer_radius
        law = self.law.complete(spec)
        hardens = self.law.stiffness is None
        numbers = np.zeros(contact_law.N_NUMBERS)
        numbers[contact_law.ROUND] = self._spline.length if self._is_closed else np.inf
        numbers[contact_law.STIFFNESS] = law.stiffness
        numbers[contact_law.WIDTH] = law.width
        numbers[contact_law.HARDENING] = _HARDENING * radius if hardens else np.inf
        numbers[contact_law.DAMPING] = law.damping_time
        numbers[contact_law.STICK] = law.stick_stiffness
        numbers[contact_law.RADIUS] = radius
        numbers[contact_law.MARGIN] = 2.0 * self._tolerance
        numbers[contact_law.OBSTACLES] = len(self.obstacles)
        numbers[contact_law.TIMESTEP] = self._timestep
        if law.self_contact:
            numbers[contact_law.SELF_SCALE] = _SELF_SCALE
            numbers[contact_law.SELF_WIDTH] = _SELF_WIDTH * radius
            numbers[contact_law.SELF_FRICTION] = law.self_friction
        return numbers

    def _make_points(self) -> None:
        """Places contact points at most a radius apart, or evenly in each span, both ends included.

        They lie at fixed rest arc lengths, with the trapezoid rule's weights.
        """
        spline = self._spline
        n_spans = spline.n_control_points - basis.DEGREE
        if self.law.points_per_span is None:
            count = int(np.ceil(spline.length / self._spec.outer_radius))
        else:
            count = n_spans * self.law.points_per_span
        count = max(count, n_spans)
        at = np.linspace(0.0, spline.length, count + 1)
        spans, values = basis.compute_basis(spline.knots, at)
        share = np.full(count + 1, spline.length / count)
        share[[0, -1]] *= 0.5
        self.arc_lengths = at
        self._points = np.column_stack([values[:, 0], share, self.law.find_friction_factors(at)])
        self._first = np.searchsorted(spans, np.arange(n_spans + 1))
        self._memory = np.zeros((count + 1, contact_law.SLOTS, 4))
        self._slides = np.zeros((count + 1, contact_law.SLOTS, 5))
        self._pairs = np.zeros((2 * (count + 1) + _SPARE, 15))
        self._block = np.zeros((10, 6))
        self._changes = np.ascontiguousarray(values[:, 1])
        self._room = np.zeros((count + 1 + n_spans, 6))
        most = 4 * (count + 1) if self.law.self_contact else 0
        self._mates = np.zeros((most, self_contact.MATE_ROW))
        self._strands = np.zeros((count + 1, self_contact.MATES, self_contact.STRAND_ROW))
        self._strands[:, :, 0] = -1.0

    def _make_row(self, obstacle: Obstacle) -> Array:
        order, row = self.order, np.zeros(shapes.ROW)
        row[shapes.KIND] = _CODES[obstacle.kind]
        row[shapes.FRICTION] = obstacle.friction
        row[shapes.BOUND] = obstacle.find_bound()
        row[shapes.SIZE : shapes.SIZE + 3] = obstacle.size
        place = np.asarray(obstacle.position) - self._spline.offset
        row[shapes.POSITION : shapes.POSITION + 3] = place[order]
        row[shapes.ROTATION : shapes.ROTATION + 9] = np.asarray(obstacle.rotation)[order].ravel()
        row[shapes.VELOCITY : shapes.VELOCITY + 3] = np.asarray(obstacle.velocity)[order]
        spin = self._parity * np.asarray(obstacle.angular_velocity)[order]
        row[shapes.SPIN : shapes.SPIN + 3] = spin
        row[shapes.SCALE] = obstacle.stiffness_factor
        row[shapes.SKIP_FROM], row[shapes.SKIP_TO] = obstacle.skips
        return row

    def _to_world(self, rows: Array) -> Array:
        world = np.zeros_like(rows)
        world[:, self.order] = rows
        return world


def _copy(value: Any) -> Any:
    return value.copy() if isinstance(value, np.ndarray) else value


def _make_capsules(ends: Array, speeds: Array, radius: float) -> Array:
    """Rows of shapes.py (m, ROW) of capsules joined at their ends (m + 1, 3), without friction."""
    chords = np.diff(ends, axis=0)
    # No length: an axis of zeros would have no normal.
    lengths = np.maximum(np.linalg.norm(chords, axis=1, keepdims=True), 1e-12)
    axes = chords / lengths
    away = np.eye(3)[np.argmin(np.abs(axes), axis=1)]
    first = np.cross(axes, away)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    rows = np.zeros((len(chords), shapes.ROW))
    rows[:, shapes.KIND] = shapes.CAPSULE
    rows[:, shapes.SIZE] = radius
    rows[:, shapes.SIZE + 1] = 0.5 * lengths[:, 0]
    rows[:, shapes.BOUND] = radius + 0.5 * lengths[:, 0]
    rows[:, shapes.POSITION : shapes.POSITION + 3] = 0.5 * (ends[1:] + ends[:-1])
    for column, axis in enumerate((first, np.cross(axes, first), axes)):
        rows[:, shapes.ROTATION + column : shapes.ROTATION + 9 : 3] = axis
    rows[:, shapes.VELOCITY : shapes.VELOCITY + 3] = 0.5 * (speeds[1:] + speeds[:-1])
    turn = np.cross(axes, np.diff(speeds, axis=0)) / lengths
    rows[:, shapes.SPIN : shapes.SPIN + 3] = turn
    rows[:, shapes.SKIP_FROM], rows[:, shapes.SKIP_TO] = np.inf, -np.inf
    return rows
