"""The tables [[holds]] of a user's file: where the hose is held, how holds move and turn."""

import math
from dataclasses import dataclass
from itertools import pairwise

from hose_mj.hoses.spec import HoseSpec
from hose_mj.toml_table import TomlTable

Vector = tuple[float, float, float]
PROFILES = ("smooth", "linear")
FARTHEST = 1e5  # positions are within this distance of the origin along each axis (m)
LONGEST = 3600.0  # movements end by then (s)
_APART = 1e-6  # holds are at least this fraction of the length apart


@dataclass(frozen=True)
class Timed:
    """A change over time."""

    start: float  # s
    duration: float  # s
    profile: str  # "smooth" (half a cosine: starts and ends at rest) or "linear"

    @property
    def end(self) -> float:
        """When it is over (s)."""
        return self.start + self.duration

    def progress(self, time: float) -> float:
        """Returns the share of it that is done at a time: 0 before, 1 after."""
        share = min(max((time - self.start) / self.duration, 0.0), 1.0)
        return share if self.profile == "linear" else 0.5 - 0.5 * math.cos(math.pi * share)


@dataclass(frozen=True)
class Movement(Timed):
    """A straight way to a place, and the least turn of a clamp's tangent; None leaves it."""

    to: Vector | None
    tangent: Vector | None


@dataclass(frozen=True)
class Spin(Timed):
    """Turns of a clamp about its tangent, right-handed."""

    turns: float

    @property
    def fastest(self) -> float:
        """Its largest rate (rad/s)."""
        even = math.tau * abs(self.turns) / self.duration
        return even if self.profile == "linear" else 0.5 * math.pi * even


@dataclass(frozen=True)
class Grasp:
    """One hold."""

    arc_length: float  # where along the hose (m)
    position: Vector  # where in the world at first (m)
    tangent: Vector | None  # unit tangent of a clamp at first; None for an attachment
    moves: tuple[Movement, ...] = ()  # one after the other
    spins: tuple[Spin, ...] = ()  # one after the other
    # Unit vector m1 of the material at a clamp at first, about which `bending_stiffness` bends;
    # None for one of our choice.
    director: Vector | None = None

    @property
    def changes(self) -> tuple[Timed, ...]:
        """All moves and spins."""
        return (*self.moves, *self.spins)

    def position_at(self, time: float) -> Vector:
        """Returns its place at a time (m)."""
        here = self.position
        for move in self.moves:
            if move.to is not None:
                share = move.progress(time)
                x, y, z = (a + (b - a) * share for a, b in zip(here, move.to, strict=True))
                here = (x, y, z)
        return here

    def tangent_at(self, time: float) -> Vector | None:
        """The unit tangent of a clamp at a time."""
        aim = self.tangent
        for move in self.moves:
            if move.tangent is not None and aim is not None:
                aim = turn_towards(aim, move.tangent, move.progress(time))
        return aim

    def angle_at(self, time: float) -> float:
        """Returns the angle by which a clamp has been turned about its tangent (rad)."""
        return math.tau * sum(spin.turns * spin.progress(time) for spin in self.spins)


def read_holds(table: TomlTable, spec: HoseSpec) -> tuple[Grasp, ...]:
    """Returns the holds of a file, by rising arc length.

    Raises:
        InputError: an unknown key, a value out of range, two holds at one place, a stretch of hose
            that would have to be longer than it is, or a clamp whose director is unknown.
    """
    length = spec.length
    read = [(part, _read_hold(part, spec)) for part in table.tables("holds")]
    read.sort(key=lambda pair: pair[1].arc_length)
    for (_, one), (where, other) in pairwise(read):
        gap = other.arc_length - one.arc_length
        if gap < _APART * length:
            raise where.fail("at", other.arc_length, "a place that no other hold is at")
        _check_reach(where, one, other, gap)
    return tuple(hold for _, hold in read)


def read_place(table: TomlTable, length: float) -> float:
    """The arc length at the key `at`: a number (m), "start" or "end"."""
    ends = {"start": 0.0, "end": length}
    if isinstance(table.value("at"), str):
        return ends[table.word("at", tuple(ends))]
    return table.number("at", least=0.0, most=length)


def _read_hold(table: TomlTable, spec: HoseSpec) -> Grasp:
    place = read_place(table, spec.length)
    table.require("kind", "clamp, which holds point and direction, or attach, which holds a point")
    clamped = table.word("kind", ("clamp", "attach")) == "clamp"
    table.require("position", "three numbers (m)")
    position = _read_position(table, "position")
    assert position is not None
    tangent = _read_tangent(table, clamped)
    if clamped and tangent is None:
        raise table.fail("tangent", None, "three numbers, the direction of rising arc length")
    hold = Grasp(
        place,
        position,
        tangent,
        tuple(_read_move(part, clamped) for part in table.tables("move")),
        tuple(_read_spin(part) for part in table.tables("spin")),
        _read_director(table, tangent, place, spec),
    )
    if hold.spins and not clamped:
        raise table.fail("spin", "given", "left out for kind = 'attach': only a clamp turns")
    for key, changes in (("move", hold.moves), ("spin", hold.spins)):
        for before, after in pairwise(changes):
            if after.start < before.end:
                valid = f"at or after the end of the one before, {before.end:g} s"
                raise table.fail(f"{key}.start", after.start, valid)
    table.finish()
    return hold


def _read_times(table: TomlTable) -> tuple[float, float, str]:
    """The numbers of a `Timed`."""
    start = table.number("start", 0.0, least=0.0, most=LONGEST)
    duration = table.number("duration", least=1e-4, most=LONGEST)
    return start, duration, table.word("profile", PROFILES, "smooth")


def _read_move(table: TomlTable, clamped: bool) -> Movement:
    times = _read_times(table)
    to, tangent = _read_position(table, "to"), _read_tangent(table, clamped)
    if to is None and tangent is None:
        raise table.fail("to", None, "three numbers (m), or a tangent, or both")
    table.finish()
    return Movement(*times, to, tangent)


def _read_spin(table: TomlTable) -> Spin:
    spin = Spin(*_read_times(table), table.number("turns", least=-1e4, most=1e4))
    table.finish()
    return spin


def _read_position(table: TomlTable, key: str) -> Vector | None:
    place: Vector | None = table.vector(key)
    if place is not None and max(map(abs, place)) > FARTHEST:
        raise table.fail(key, list(place), f"three numbers within {FARTHEST:g} m of the origin")
    return place


def _read_tangent(table: TomlTable, clamped: bool) -> Vector | None:
    aim: Vector | None = table.vector("tangent")
    if aim is None:
        return None
    if not clamped:
        raise table.fail("tangent", list(aim), "left out for kind = 'attach'")
    if math.hypot(*aim) < 1e-9:
        raise table.fail("tangent", list(aim), "three numbers that are not all zero")
    return _scale(aim)


def _read_director(
    table: TomlTable, tangent: Vector | None, place: float, spec: HoseSpec
) -> Vector | None:
    """m1 across the tangent; what is laid is laid from its beginning on, where we can choose."""
    given: Vector | None = table.vector("director")
    if given is None:
        if tangent is not None and place > 0.0 and not spec.is_isotropic:
            valid = "three numbers: a coil or ribbon needs it at a clamp beyond its start"
            raise table.fail("director", None, valid)
        return None
    if tangent is None:
        raise table.fail("director", list(given), "left out for kind = 'attach'")
    if spec.is_isotropic:
        valid = "left out for a hose that is straight at rest and bends alike to all sides"
        raise table.fail("director", list(given), valid)
    across = _subtract(given, tangent, sum(a * b for a, b in zip(given, tangent, strict=True)))
    if math.hypot(*across) <= 1e-6 * math.hypot(*given):
        raise table.fail("director", list(given), "three numbers, a direction across the tangent")
    return _scale(across)


def _check_reach(table: TomlTable, one: Grasp, other: Grasp, gap: float) -> None:
    """The distance of two holds stays within the length of hose between them."""
    times = {0.0}
    for change in (*one.changes, *other.changes):
        times |= {change.start + change.duration * k / 64 for k in range(65)}
    for time in sorted(times):
        apart = math.dist(one.position_at(time), other.position_at(time))
        if apart > gap * (1.0 + 1e-6):
            valid = f"within {gap:g} m, the hose between them, of the hold at {one.arc_length:g} m"
            where = "position" if time == 0.0 else f"position at {time:g} s"
            raise table.fail(where, [round(x, 6) for x in other.position_at(time)], valid)


def turn_towards(one: Vector, other: Vector, share: float) -> Vector:
    """A unit vector turned by a share of the way to another, on the great circle through both.

    Opposite ones have no such circle; the turn then goes by way of the axis most across them.
    """
    cosine = min(max(sum(a * b for a, b in zip(one, other, strict=True)), -1.0), 1.0)
    across = _subtract(other, one, cosine)
    if math.hypot(*across) < 1e-9:
        if cosine > 0.0:
            return one
        least = min(range(3), key=lambda k: abs(one[k]))
        axis = (float(least == 0), float(least == 1), float(least == 2))
        across = _subtract(axis, one, one[least])
    size = math.hypot(*across)
    angle = share * math.acos(cosine)
    c, s = math.cos(angle), math.sin(angle) / size
    x, y, z = (c * a + s * b for a, b in zip(one, across, strict=True))
    return x, y, z


def _scale(vector: Vector) -> Vector:
    size = math.hypot(*vector)
    return vector[0] / size, vector[1] / size, vector[2] / size


def _subtract(vector: Vector, along: Vector, amount: float) -> Vector:
    x, y, z = (a - amount * b for a, b in zip(vector, along, strict=True))
    return x, y, z
