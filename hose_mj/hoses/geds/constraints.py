"""`ConstraintSet`: the clamps and attachments of a hose, as rows of G x = g (thesis A.3).

An attachment is d rows, r(s) = position. A clamp has d - 1 more, r'(s) . e = 0 for unit vectors e
across the wanted tangent: the hose may stretch through it, but not turn. The rows' multipliers are
the forces that a hold does to the hose, in space and on r'. In space a clamp also holds the angle
of the material about the tangent: by a row for theta where there is one, else by the twist of the
segment to the next clamp (twist_segments.py). What joins the ends of a closed loop stands behind
all of them (loops.py).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds import loops, records, stepping, twist_loads, twist_segments
from hose_mj.hoses.geds.frames import transport_frames
from hose_mj.hoses.geds.span import make_span
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.geds.twist import Twist, find_owners
from hose_mj.hoses.geds.twist_loads import AppliedTorque, Stretch
from hose_mj.hoses.inputs import check_records, check_vector, read_numbers
from hose_mj.hoses.paths import HoldPath
from hose_mj.hoses.protocol import Array, Hold, Reaction
from hose_mj.hoses.snapshots import take, take_array, take_count, take_flag, take_list
from hose_mj.hoses.spec import check_number
from hose_mj.hoses.springs import Spring

_REMEMBERED = ("directors", "spin", "angle", "trial", "torque", "accepted")
"""What of the twist goes into a snapshot."""
_RIGID = Spring()
_FIRST_END, _LAST_END = -1, -2
"""Numbers of the clamps at s = 0 and s = L of a closed loop, which hold nothing (twist.py)."""


@dataclass
class _Held:
    """One hold: where it is wanted at the end of the next step, and its multipliers."""

    hold: Hold
    position: Array  # (3,)
    tangent: Array | None  # (3,), unit
    multipliers: Array  # (d,) or (2 d - 1,), one more with theta
    basis: Array  # N and two derivatives at its place, (3, 4)
    spring: Spring = _RIGID  # what it gives way by
    before: Array | None = None  # (d,), its target at the beginning of the next step
    first: int = 0  # its first row of G x = g


class ConstraintSet:
    """All holds of one hose.

    Args:
        spline: the hose's geometry.
        hose: its constants.
        x: its unknowns, read whenever something changes.

    Attributes:
        rows: what the kernels read and write; made anew by every change.
        is_closed: whether the hose is a closed loop.
        is_moved: whether a hold was made or moved since the last step.
        is_linked: whether twist plus writhe is kept: a closed loop, or clamps at both ends.
        spun: by how much the last clamp was spun more than the first (rad).

    The point moments on the hose are known here for their part along the tangent alone.
    """

    def __init__(self, spline: Spline, hose: records.Hose, x: Array) -> None:
        self._spline, self._hose = spline, hose
        self.is_closed = self.is_moved = False
        self.spun = 0.0
        self._held: list[_Held] = []
        self._compliant: list[Hold] = []
        self._clamps: list[int] = []  # numbers of the holds, as in rows.twist
        self._n_made = 0
        self._moments: list[tuple[float, Array]] = []  # arc length, (3,) N m
        self._shares: list[list[Stretch]] = []  # of each, where the twist carries it
        self._x = x
        self.rows = self._make_rows(twist_segments.make_twist(spline, hose, [], x))

    @property
    def n_rows(self) -> int:
        """Rows of G, and of the twist between clamps."""
        return len(self.rows.start) + len(self.rows.twist.angle)

    @property
    def is_free(self) -> bool:
        """True where nothing holds the hose in space."""
        return not self._held

    def list_all(self) -> list[Hold]:
        """All holds, the oldest first."""
        return [held.hold for held in self._held]

    def clear(self, director: Array | None = None) -> None:
        """Drops all holds and opens a loop; numbers are not used again. The frames begin anew.

        Args:
            director: of the material where the hose begins, (3,); any by default.
        """
        self._held, self._clamps, self.is_closed, self.spun = [], [], False, 0.0
        self._moments, self._shares = [], []
        twist = twist_segments.make_twist(self._spline, self._hose, [], self._x)
        if self._spline.has_theta:
            start = twist_segments.make_directors(self._spline, np.zeros(1), self._x)[0]
            twist.frames[0, 6:9] = start[3:] if director is None else director
            axes, tables = self._spline.axes, self._hose.tables
            transport_frames(axes, tables, twist, self._x, make_span(), twist.frames)
            twist.accepted[:] = twist.frames
        self.rows = self._make_rows(twist)

    def add(
        self,
        arc_length: float,
        position: ArrayLike | None,
        tangent: Array | None,
        spring: Spring | None = None,
    ) -> Hold:
        """Adds a hold.

        Args:
            arc_length: where on the hose (m).
            position: wanted place (3,) m; None for where the hose is now.
            tangent: wanted unit tangent (3,) of a clamp; None for an attachment.
            spring: what it gives way by; None for a rigid hold.

        Raises:
            InputError: a place off the hose or that another hold is at, a position off its plane, a
                tangent more than 90 degrees from where the hose points, what is no spring, more
                holds than the spline has unknowns for.
        """
        spline = self._spline
        if not isinstance(spring, Spring | None):
            raise InputError("spring", spring, "a Spring, or None for a rigid hold")
        s = spline.check_place(arc_length)
        for held in self._held:
            apart = abs(held.hold.arc_length - s)
            if self.is_closed:
                apart = min(apart, spline.length - apart)
            if apart < 1e-9 * spline.length:
                raise InputError("arc_length", s, "a place that no other hold is at")
        if position is None:
            point = spline.evaluate(np.array([s]), self._x)[0] + spline.offset
        else:
            point = spline.check_position(position)
        if tangent is not None:
            _check_ahead(tangent, spline.evaluate(np.array([s]), self._x, 1)[0])
        hold = Hold(self._n_made, s, tangent is not None)
        n_rows = spline.dimension
        if tangent is not None:
            n_rows += spline.dimension - 1 + spline.has_theta
        in_all = len(self.rows.start) + n_rows
        if in_all > spline.size:
            valid = (
                f"at most {spline.size}, the unknowns of {spline.n_control_points} control points"
            )
            raise InputError("number of rows of all holds", in_all, valid)
        self._n_made += 1
        self.is_moved = True
        self._held.append(self._make_held(hold, point, tangent, np.zeros(n_rows), spring))
        self._rebuild()
        return hold

    def _make_held(
        self,
        hold: Hold,
        position: Array,
        tangent: Array | None,
        multipliers: Array,
        spring: Spring | None,
    ) -> _Held:
        values = self._spline.compute_basis(np.array([hold.arc_length]))[1][0]
        return _Held(hold, position, tangent, multipliers, values, spring or _RIGID)

    def move(
        self,
        hold: Hold,
        position: ArrayLike | None,
        tangent: ArrayLike | None,
        spin: float,
    ) -> None:
        """Sets where a hold is to be at the end of the next step; see `HoseModel.move`.

        Raises:
            InputError: a hold that is not here, a vector out of the plane, a tangent or a spin for
                an attachment, a spin in a plane, a tangent turned by more than 90 degrees at once;
                nothing has changed then.
        """
        held = self._find(hold)
        check_number("spin", spin, may_be_negative=True)
        if spin != 0.0 and (held.tangent is None or self._spline.dimension == 2):
            raise InputError("spin", spin, "0 for an attachment and for a hose in a plane")
        if tangent is not None and held.tangent is None:
            raise InputError("tangent", tangent, "None for an attachment (use clamp)")
        point = held.position if position is None else self._spline.check_position(position)
        aim = held.tangent if tangent is None else self._spline.check_direction(tangent)
        if aim is not None and held.tangent is not None:
            _check_ahead(aim, held.tangent)
        held.position, held.tangent = point, aim
        self.is_moved = True
        self._aim(held, turns=tangent is not None)
        if spin != 0.0:
            self.rows.twist.spin[self._clamps.index(hold.number), 0] += spin
            self._count_spin(hold, spin)

    def _count_spin(self, hold: Hold, spin: float) -> None:
        """Counts a spin (rad) of a clamp at either end."""
        ends = hold.arc_length == self._spline.length, hold.arc_length == 0.0
        self.spun += spin * (float(ends[0]) - float(ends[1]))

    def measure_jump(self) -> float:
        """The farthest that a hold goes within the next step (m)."""
        d, rows = self._spline.dimension, self.rows
        ways = [
            rows.after[h.first : h.first + d] - rows.before[h.first : h.first + d]
            for h in self._held
        ]
        return max((float(np.linalg.norm(way)) for way in ways), default=0.0)

    def make_path(self, paths: Mapping[Hold, HoldPath], n_steps: int) -> stepping.Path:
        """Returns paths of n steps as the kernels read them.

        Raises:
            InputError: as `move` for any of their rows.
        """
        d, width = self._spline.dimension, 4 * self._spline.n_dof
        rows, slopes, yields = list[int](), list[int](), list[float]()
        places, coefficients = [np.zeros((n_steps, 0))], [np.zeros((n_steps, 0, width))]
        for hold, path in paths.items():
            held = self._find(hold)
            if path.positions is not None:
                off = path.positions - self._spline.offset
                for way in off if d == 2 else ():
                    self._spline.check_in_plane("position", way, 1e-9 * self._spline.length)
                places.append(off[:, self._spline.dims])
                rows += range(held.first, held.first + d)
            if path.tangents is not None and held.tangent is not None:
                aims = [held.tangent, *map(self._spline.check_direction, path.tangents)]
                for aim, now in zip(aims[1:], aims, strict=False):
                    _check_ahead(aim, now)
                turned = [self._make_slope_rows(held, aim).reshape(-1, width) for aim in aims[1:]]
                coefficients.append(np.array(turned))
                slopes += range(held.first + d, held.first + 2 * d - 1)
                yields += [float(held.spring.turn_stiffness < np.inf)] * (d - 1)
        whole = np.array(rows, dtype=np.int64), np.concatenate(places, axis=1)
        turns = np.array(slopes, dtype=np.int64), np.concatenate(coefficients, axis=1)
        return stepping.Path(*whole, *turns, np.array(yields, dtype=np.float64))

    def follow(self, paths: Mapping[Hold, HoldPath], k: int) -> None:
        """Remembers that holds are where step k of their paths ends; the rows know."""
        for hold, path in paths.items():
            held = self._find(hold)
            if path.positions is not None:
                held.position = path.positions[k].copy()
            if path.tangents is not None:
                held.tangent = self._spline.check_direction(path.tangents[k])

    def check_director(self, director: ArrayLike, tangent: Array) -> Array:
        """Returns the part of a director (3,) across a unit tangent, as a unit vector.

        Raises:
            InputError: three numbers that are not, one along the tangent, any for a planar hose
                or one whose theta has no frames.
        """
        vector = check_vector("director", director)
        if self._spline.dimension == 2:
            raise InputError("director", vector.tolist(), "None for a hose in a plane")
        if self._hose.elasticity.frenet:
            raise InputError("director", vector.tolist(), "None with twist='frenet'")
        across = vector - (vector @ tangent) * tangent
        length = float(np.linalg.norm(across))
        if length < 1e-9 * float(np.linalg.norm(vector)) or length == 0.0:
            raise InputError("director", vector.tolist(), "a vector across the tangent")
        return np.asarray(across / length)

    def turn_to(self, hold: Hold, director: Array) -> None:
        """Lets the material at a clamp turn to a director within the next step."""
        held = self._find(hold)
        clamp, twist = self._clamps.index(hold.number), self.rows.twist
        assert held.tangent is not None
        if self._spline.has_theta:
            row = 3 * len(self._hose.tables.first) + clamp
            theta = float(self._spline.evaluate_theta(np.array([hold.arc_length]), self._x)[0])
            tangent, base = twist.accepted[row, :3], twist.accepted[row, 6:9]
            now = np.cos(theta) * base + np.sin(theta) * np.cross(tangent, base)
        else:
            tangent, now = twist.directors[clamp, :3], twist.directors[clamp, 3:]
        now = twist_segments.transport_director(tangent, held.tangent, now)
        angle = float(np.arctan2(np.cross(now, director) @ held.tangent, now @ director))
        if self._spline.has_theta or len(self._clamps) > 1:
            twist.spin[clamp, 0] = angle
            self._count_spin(hold, angle)
        else:
            # Nothing else knows the angle of a hose without theta.
            twist_segments.turn_director(twist, clamp, angle)

    def set_compliance(
        self,
        holds: Sequence[Hold],
        positions: ArrayLike | None = None,
        compliance: ArrayLike | None = None,
    ) -> np.ndarray:
        """Sets the answer of bodies at attachments to the next step; see `BodyCoupling.try_step`.

        Returns:
            the first row of each, (k,). Without positions that is all it does.

        Raises:
            InputError: a clamp, a hold that is not here, wrong shapes, numbers that are not finite.
        """
        given = list(check_records("holds", holds, Hold))
        if given != self._compliant:
            for hold in given:
                held = self._find(hold)
                if held.tangent is not None or held.spring != _RIGID:
                    valid = "an attachment without a spring: what holds it gives way"
                    raise InputError("hold", hold, valid)
            self._compliant = given
            self._compliant_first = np.array([self._find(h).first for h in given], dtype=np.int64)
            d = self._spline.dimension
            self._compliant_rows = (self._compliant_first[:, None] + np.arange(d)).ravel()
            self.rows = self.rows._replace(response=records.make_response(len(self.rows.start)))
        if positions is not None:
            k, dims = len(holds), self._spline.dims
            places = read_numbers("positions", positions, "finite numbers", np.inf)
            matrix = read_numbers("compliance", compliance, "finite numbers", np.inf)
            if places.shape != (k, 3) or matrix.shape != (3 * k, 3 * k):
                valid = f"({k}, 3) and ({3 * k}, {3 * k})"
                shapes = (places.shape, matrix.shape)
                raise InputError("shapes of positions and compliance", shapes, valid)
            if not (np.isfinite(places).all() and np.isfinite(matrix).all()):
                raise InputError("positions and compliance", places.tolist(), "finite numbers")
            within = (3 * np.arange(k)[:, None] + dims).ravel()
            rows = self._compliant_rows
            self.rows.after[rows] = (places - self._spline.offset)[:, dims].ravel()
            self.rows.response.compliance[rows[:, None], rows] = matrix[within[:, None], within]
        return self._compliant_first

    def compute_mean_forces(self) -> Array:
        """Mean forces over the last step of the holds on bodies, (k, 3), N, world frame."""
        forces = np.zeros((len(self._compliant), 3))
        if not self._compliant:
            return forces
        found = self.rows.response.force[self._compliant_rows]
        forces[:, self._spline.dims] = found.reshape(len(forces), -1)
        return forces

    def compute_positions(self, x: Array) -> Array:
        """Where unknowns x put the holds on bodies, (k, 3), m, world frame."""
        places = np.array([hold.arc_length for hold in self._compliant])
        return self._spline.evaluate(places, x) + self._spline.offset

    def release(self, hold: Hold) -> None:
        """Drops one hold; raises `InputError` for one that is not here."""
        self._held.remove(self._find(hold))
        self._rebuild()

    def close(self, spin: float) -> None:
        """Joins s = L to s = 0, its material turned by `spin` (rad) about the tangent before.

        Raises:
            InputError: a hose that is closed, held at both ends or whose ends do not meet; a spin
                in a plane.
        """
        check_number("spin", spin, may_be_negative=True)
        if spin != 0.0 and self._spline.dimension == 2:
            raise InputError("spin", spin, "0 for a hose in a plane")
        if self.is_closed:
            raise InputError.about("cannot close a hose that is closed: open it first")
        loops.check_ends(self._spline, [one.hold.arc_length for one in self._held], self._x)
        self.is_closed = True
        self._rebuild(spin=spin)

    def open(self) -> None:
        """Parts the ends of a closed loop; raises `InputError` for a hose that is open."""
        if not self.is_closed:
            raise InputError.about("cannot open a hose that is not closed")
        self.is_closed = False
        self._rebuild()

    def reaction(self, hold: Hold) -> Reaction:
        """Force and moment of a hold on the hose at the end of the last step, world frame."""
        held = self._find(hold)
        d = self._spline.dimension
        force = np.zeros(3)
        force[self._spline.dims] = held.multipliers[:d]
        moment = np.zeros(3)
        if held.tangent is not None:
            # A force f on r' works like the moment r' x f.
            slope = self._spline.evaluate(np.array([hold.arc_length]), self._x, 1)[0]
            across = held.multipliers[d : 2 * d - 1] @ self._across(held.tangent)
            moment = np.cross(slope, across) + self._compute_torque(held) * held.tangent
        return Reaction(force, moment)

    def _compute_torque(self, held: _Held) -> float:
        """Moment of a clamp on the hose about the tangent."""
        if self._spline.dimension == 2:
            return 0.0
        if self._spline.has_theta:
            return float(held.multipliers[-1])
        twist, clamp = self.rows.twist, self._clamps.index(held.hold.number)
        torque = twist.torque[find_owners(twist)]
        arriving = float(torque[twist.ends[:, 1] == clamp].sum())
        arriving -= float(torque[twist.ends[:, 0] == clamp].sum())
        if len(twist.load_starts) == 0:
            return arriving
        place = held.hold.arc_length
        # A moment at the clamp itself goes straight into it.
        own = [k for k, (at, _) in enumerate(self._moments) if at == place]
        arriving += self.tabulate_applied().measure_jump(place)
        return arriving - float(self._measure_moments()[own].sum())

    # -- moments along the tangent -------------------------------------------------------------

    def set_moments(self, moments: Sequence[tuple[float, Array]]) -> None:
        """Replaces the point moments (3,), N m, with their arc lengths; theta needs none here."""
        self._moments = list(moments)
        self.rows = self.rows._replace(twist=self._load(self.rows.twist))

    def measure_unbalanced_torque(self) -> float:
        """Returns the sum of the moments about the tangent (N m) where no clamp takes it up.

        Zero where one does, and for what is no more than rounding.
        """
        moments = self.rows.twist.load_moments
        if len(moments) == 0 or any(held.tangent is not None for held in self._held):
            return 0.0
        rest = float(self._measure_moments().sum())
        return rest if abs(rest) > 1e-6 * float(np.abs(moments).sum()) else 0.0

    def tabulate_applied(self) -> AppliedTorque:
        """Returns what the point moments make of the moment about the tangent."""
        stretches = [
            Stretch(one.start, one.end, along * one.first, along * one.last)
            for shares, along in zip(self._shares, self._measure_moments(), strict=True)
            for one in shares
        ]
        return AppliedTorque.add_up(self._spline.length, stretches)

    def find_director(self) -> tuple[float, Array]:
        """Returns where a hose with scalar twist knows a director, and that (3,).

        At its first clamp; without clamps any at s = 0.
        """
        twist, length = self.rows.twist, self._hose.tables.span_length
        for clamp, number in enumerate(self._clamps):
            if number >= 0:
                return float(twist.places[clamp]) * length, twist.directors[clamp, 3:].copy()
        slope = self._spline.evaluate(np.zeros(1), self._x, 1)[0]
        unit = slope / max(float(np.linalg.norm(slope)), 1e-12)
        return 0.0, twist_segments.compute_normal(unit)

    def measure_turns(self, start: float, places: Array) -> Array:
        """Returns the twist (k,), rad, from one arc length to others."""
        twist, applied = self.rows.twist, self.tabulate_applied()
        n_spans = len(self._hose.tables.first)
        torque = (twist.angle / twist.compliance)[find_owners(twist)]
        ends = twist.places[twist.ends] * self._hose.tables.span_length
        turns = np.zeros(len(places))
        for k, place in enumerate(places):
            low, high = min(start, float(place)), max(start, float(place))
            angle = applied.integrate(self._spline, self._hose, low, high)
            for (first, last), moment in zip(ends, torque, strict=True):
                if low < last and first < high:
                    part = (self._spline, n_spans, max(low, first), min(high, last))
                    weights = twist_segments.make_weights(*part)
                    angle += moment * twist_segments.measure_compliance(self._hose, weights)
            turns[k] = angle if place >= start else -angle
        return turns

    def _measure_moments(self) -> Array:
        """The point moments' parts along the tangent that twist, (k,), N m."""
        places = np.array([place for place, _ in self._moments[: len(self._shares)]])
        tangents = self._spline.evaluate(places, self._x, 1)
        tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-12)
        return np.asarray(np.sum(tangents * self.rows.twist.load_moments, axis=1))

    def _load(self, twist: Twist) -> Twist:
        """Returns the twist with the point moments of now on its clamps."""
        carries = twist_segments.has_scalar_twist(self._spline, self._hose)
        moments = self._moments if carries else []
        self._shares = [
            twist_loads.list_shares(self._spline, self._hose, twist, place, self.is_closed)
            for place, _ in moments
        ]
        weights = [twist_loads.weigh_shares(self._spline, self._hose, one) for one in self._shares]
        places = np.array([place for place, _ in moments])
        vectors = np.array([vector for _, vector in moments]).reshape(-1, 3)
        shares = np.array(weights).reshape(-1, *twist.applied.shape)
        return twist_loads.make_loaded(self._spline, twist, places, vectors, shares)

    # -- state ---------------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """All of it as arrays, plain numbers and containers of them."""
        held = [
            {
                "number": one.hold.number,
                "arc_length": one.hold.arc_length,
                "position": one.position.copy(),
                "tangent": None if one.tangent is None else one.tangent.copy(),
                "spring": list(astuple(one.spring)),
            }
            for one in self._held
        ]
        return {
            "held": held,
            "n_made": self._n_made,
            "is_closed": self.is_closed,
            "before": self.rows.before.copy(),
            "after": self.rows.after.copy(),
            "multipliers": self.rows.multipliers.copy(),
            "twist": {name: getattr(self.rows.twist, name).copy() for name in _REMEMBERED},
            "compliant": [hold.number for hold in self._compliant],
            "mean_force": self.rows.response.force.copy(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot; raises `InputError` for one of another hose, half restored."""
        held = [self._read_held(one) for one in take_list(state, "held")]
        is_closed = take_flag(state, "is_closed")
        self._check_apart(held, is_closed)
        was_closed, self.is_closed = self.is_closed, is_closed
        if was_closed != self.is_closed or _list_clamps(held) != _list_clamps(self._held):
            # Other clamps may have the same numbers: nothing goes on from those of now.
            self._held, self._clamps, self._moments, self._shares = [], [], [], []
            twist = twist_segments.make_twist(self._spline, self._hose, [], self._x)
            self.rows = self._make_rows(twist)
        self._held = held
        self._n_made = max(self._n_made, take_count(state, "n_made"))
        self._rebuild()
        rows, twist = self.rows, take(state, "twist")
        for name in ("before", "after", "multipliers"):
            getattr(rows, name)[:] = take_array(state, name, getattr(rows, name).shape)
        for name in _REMEMBERED:
            part = getattr(rows.twist, name)
            part[:] = take_array(twist, name, part.shape)
        rows.twist.frames[:] = rows.twist.accepted
        compliant, forces = take_list(state, "compliant"), take_array(state, "mean_force", (None,))
        if compliant:
            numbers = {one.hold.number: one.hold for one in self._held}
            self.set_compliance([numbers[number] for number in compliant])
            self.rows.response.force[:] = forces

    def _check_apart(self, held: Sequence[_Held], is_closed: bool) -> None:
        """Raises `InputError` for holds of a snapshot that no hose can have together."""
        places = sorted(one.hold.arc_length for one in held)
        if is_closed and places:
            places.append(places[0] + self._spline.length)
        if is_closed and self._spline.has_theta:
            raise InputError("is_closed of a snapshot", is_closed, "False for a hose with theta")
        if np.any(np.diff(places) < 1e-9 * self._spline.length):
            raise InputError("arc lengths of the holds of a snapshot", places, "places apart")

    def _read_held(self, one: Any) -> _Held:
        """Returns a hold from its entry of a snapshot."""
        place = float(take_array(one, "arc_length", ()))
        is_clamp = take(one, "tangent") is not None
        tangent = take_array(one, "tangent", (3,)) if is_clamp else None
        d = self._spline.dimension
        n_rows = d + is_clamp * (d - 1 + self._spline.has_theta)
        hold = Hold(take_count(one, "number"), self._spline.check_place(place), is_clamp)
        position = self._spline.check_position(take_array(one, "position", (3,)))
        spring = Spring(*take_array(one, "spring", (4,), is_finite=False).tolist())
        return self._make_held(hold, position, tangent, np.zeros(n_rows), spring)

    # -- inside --------------------------------------------------------------------------------

    def _find(self, hold: Hold) -> _Held:
        if isinstance(hold, Hold):
            for held in self._held:
                if held.hold == hold:
                    return held
        raise InputError("hold", hold, "a hold of this hose that was not released")

    def _across(self, tangent: Array) -> Array:
        """Unit vectors of the hose's space that are normal to a tangent, (d - 1, 3)."""
        if self._spline.dimension == 2:
            return twist_segments.cross(self._spline.normal, tangent)[None]
        first = twist_segments.compute_normal(tangent)
        return np.array([first, twist_segments.cross(tangent, first)])

    def _rebuild(self, spin: float = 0.0) -> None:
        """Makes everything anew from the list of holds; the material stays as it lies.

        `spin`: what the last end of a loop is turned by (rad).
        """
        held = sorted(
            (one for one in self._held if one.tangent is not None),
            key=lambda one: one.hold.arc_length,
        )
        numbers = [one.hold.number for one in held]
        places = [one.hold.arc_length for one in held]
        if self.is_closed:
            numbers = [_FIRST_END, *numbers, _LAST_END]
            places = [0.0, *places, self._spline.length]
        if self._spline.dimension == 2 or numbers == self._clamps:
            self.rows = self._make_rows(self.rows.twist)
            return
        same = {k: self._clamps.index(n) for k, n in enumerate(numbers) if n in self._clamps}
        twist = twist_segments.make_twist(self._spline, self._hose, places, self._x)
        if self._spline.has_theta:
            n_spans = len(self._hose.tables.first)
            twist_segments.take_over_frames(twist, self.rows.twist, same, n_spans)
        else:
            applied = self.tabulate_applied()
            measure = partial(applied.integrate, self._spline, self._hose)
            twist_now = self.rows.twist
            old = twist_segments.part_ends(self._spline, self._hose, twist_now, self._x, measure)
            twist_segments.take_over_twist(
                self._spline, self._hose, twist, old, same, self._x, measure
            )
            if self.is_closed:
                twist = twist_segments.join_ends(twist, spin)
            twist_segments.settle(twist)
        self._clamps = numbers
        self.rows = self._make_rows(self._load(twist))

    def _make_rows(self, twist: Twist) -> records.Constraints:
        """Makes the rows of G x = g: positions first, then slopes across, then theta.

        `before` is what x meets now, so a hold that was moved goes its way within the next step
        and not before it begins.
        """
        d, width = self._spline.dimension, 4 * self._spline.n_dof
        m = sum(len(held.multipliers) for held in self._held) + 2 * d * self.is_closed
        start = np.zeros(m, dtype=np.int64)
        coefficients = np.zeros((m, width * (1 + self.is_closed)))
        before, after, multipliers = np.zeros((3, m))
        first = 0
        for held in self._held:
            own = slice(first, first + len(held.multipliers))
            place = self._spline.compute_basis(np.array([held.hold.arc_length]))[0][0]
            start[own] = place
            coefficients[own, :width] = self._make_own_rows(held)
            before[own] = coefficients[own, :width] @ self._x[place : place + width]
            after[first : first + d] = (held.position - self._spline.offset)[self._spline.dims]
            if held.tangent is not None and self._spline.has_theta:
                after[own.stop - 1] = before[own.stop - 1]
                twist.turn_rows[self._clamps.index(held.hold.number)] = own.stop - 1
            multipliers[own] = held.multipliers
            # Views: what the kernels write belongs to the hold.
            held.multipliers, held.first = multipliers[own], first
            target = slice(first, first + d)
            if held.spring.stiffness < np.inf:
                before[target] = after[target] if held.before is None else held.before
            if held.tangent is not None and held.spring.turn_stiffness < np.inf:
                before[first + d : first + 2 * d - 1] = 0.0
            held.before = before[target]
            first = own.stop
        if self.is_closed:
            coefficients[first:] = loops.make_joint_rows(self._spline)
            before[first:] = coefficients[first:, :width] @ self._x[:width]
            before[first:] += coefficients[first:, width:] @ self._x[-width:]
        self._compliant = []
        places = {one.hold.arc_length for one in self._held if one.tangent is not None}
        self.is_linked = self.is_closed or {0.0, self._spline.length} <= places
        whole = (start, coefficients, before, after, multipliers, twist, records.make_response(0))
        return records.Constraints(*whole, self._make_springs(m))

    def _make_springs(self, n_rows: int) -> records.Springs:
        """Makes the springs of the holds that have one."""
        d, sprung = self._spline.dimension, [one for one in self._held if one.spring != _RIGID]
        rows = [(one.first, (d - 1) * (one.tangent is not None)) for one in sprung]
        numbers = np.array([astuple(one.spring) for one in sprung], dtype=np.float64)
        places = np.array(rows, dtype=np.int64).reshape(-1, 2)
        return records.make_springs(places, numbers.reshape(-1, 4), n_rows)

    def list_stiffnesses(self) -> Array:
        """The stiffness of each row, (m,), N/m of a place or N m of a slope; infinite for rigid."""
        d, found = self._spline.dimension, np.full(len(self.rows.start), np.inf)
        for one in self._held:
            found[one.first : one.first + d] = one.spring.stiffness
            if one.tangent is not None:
                slopes = slice(one.first + d, one.first + 2 * d - 1)
                found[slopes] = one.spring.turn_stiffness
        return found

    def ready_springs(self) -> None:
        """Readies springs for `newton.is_positive`: each at rest and below its limit."""
        springs = self.rows.springs
        springs.softness[:] = 1.0 / springs.numbers[:, [0, 0, 3]]
        springs.direction[:], springs.scale[:] = 0.0, 1.0
        springs.weight[:] = 0.5 * self.list_stiffnesses()

    def _aim(self, held: _Held, turns: bool) -> None:
        """What `_rebuild` does for a hold with another position or, if it turns, tangent."""
        d, rows = self._spline.dimension, self.rows
        start, width = rows.start[held.first], 4 * self._spline.n_dof
        if turns and held.tangent is not None:
            slopes = slice(held.first + d, held.first + 2 * d - 1)
            rows.rows[slopes, :width] = self._make_slope_rows(held, held.tangent).reshape(-1, width)
            # Added up in order, as kernels do; what does not turn stands where a step has left it.
            made = rows.rows[slopes, :width] * self._x[start : start + width]
            is_rigid = held.spring.turn_stiffness == np.inf
            rows.before[slopes] = np.cumsum(made, axis=1)[:, -1] if is_rigid else 0.0
        wanted = (held.position - self._spline.offset)[self._spline.dims]
        rows.after[held.first : held.first + d] = wanted

    def _make_own_rows(self, held: _Held) -> Array:
        """Coefficients of one hold's rows."""
        d, n_dof, values = self._spline.dimension, self._spline.n_dof, held.basis
        rows = np.zeros((len(held.multipliers), 4, n_dof))
        for c in range(d):
            rows[c, :, c] = values[0]
        if held.tangent is not None:
            rows[d : 2 * d - 1] = self._make_slope_rows(held, held.tangent)
            if self._spline.has_theta:
                rows[-1, :, 3] = values[0]
        return rows.reshape(len(rows), 4 * n_dof)

    def _make_slope_rows(self, held: _Held, tangent: Array) -> Array:
        """Those of its coefficients that keep r' from leaving a tangent, (d - 1, 4, n_dof)."""
        rows = np.zeros((self._spline.dimension - 1, 4, self._spline.n_dof))
        across = self._across(tangent)[:, None, self._spline.dims]
        rows[:, :, : self._spline.dimension] = held.basis[1][None, :, None] * across
        return rows


def _list_clamps(held: Sequence[_Held]) -> list[Hold]:
    return [one.hold for one in held if one.tangent is not None]


def _check_ahead(aim: Array, now: Array) -> None:
    """Raises `InputError` for a tangent (3,) that points back: r' . e = 0 cannot tell its sign."""
    if aim @ now < 0.0:
        valid = "a direction within 90 degrees of the hose's there; turn a clamp further in steps"
        raise InputError("tangent", aim.tolist(), valid)
