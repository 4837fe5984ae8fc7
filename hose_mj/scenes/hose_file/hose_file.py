"""A user's own hose in TOML: the hose, where it is held, what loads it, what is asked of it.

docs/own_hose.md lists every key with its unit; assets/hoses/ has examples.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from hose_mj.assets import find_assets
from hose_mj.errors import InputError
from hose_mj.hoses.spec import HoseSpec
from hose_mj.scenes.hose_file import grasps
from hose_mj.scenes.hose_file.grasps import FARTHEST, Vector
from hose_mj.scenes.hose_file.spec import read_spec
from hose_mj.toml_table import TomlTable, read_toml

STARTS = ("equilibrium", "as-laid")
GRAVITY: Vector = (0.0, 0.0, -9.81)
ERRORS = (0.01, 0.001)
BUDGET = 30.0
_SHAPE_SLACK = 0.01


@dataclass(frozen=True)
class PointLoad:
    """A force (N) and a moment (N m) at an arc length (m), in the world's directions."""

    arc_length: float
    force: Vector
    moment: Vector


@dataclass(frozen=True)
class Floor:
    """A horizontal plane at a height (m) with Coulomb's coefficient of friction."""

    height: float
    friction: float


@dataclass(frozen=True, kw_only=True)
class UserHose:
    """A user's hose as its file describes it."""

    title: str  # one line
    spec: HoseSpec  # the hose
    holds: tuple[grasps.Grasp, ...]  # by rising arc length
    loads: tuple[PointLoad, ...]  # point forces and moments
    gravity: Vector  # m/s^2
    floor: Floor | None  # None without one
    # Points that the hose is laid along (m); None for a shape of our choice.
    shape: tuple[Vector, ...] | None
    duration: float | None  # simulated time (s); None where only the rest shape is asked for
    start: str  # of a motion, one of `STARTS`
    errors: tuple[float, ...]  # wanted errors as fractions of the length, falling
    budget: float  # wall time that the comparison may take, about (s)

    @property
    def moves(self) -> bool:
        """Says whether a hold is moved or turned."""
        return any(hold.changes for hold in self.holds)

    @property
    def spins(self) -> bool:
        """Says whether a clamp is turned about its tangent."""
        return any(hold.spins for hold in self.holds)


def find_hose_file(path: Path) -> Path:
    """Returns a user's file, or the example of that name that comes with hose_mj.

    Raises:
        InputError: there is neither.
    """
    examples = find_assets() / "hoses"
    example = examples / f"{path}.toml"
    if path.exists():
        return path
    if not example.is_file():
        names = ", ".join(sorted(file.stem for file in examples.glob("*.toml")))
        raise InputError("my_hose", str(path), f"a TOML file, or an example: {names}")
    return example


def read_hose_file(path: Path) -> UserHose:
    """Reads a user's hose.

    Raises:
        InputError: the file cannot be read, or one thing in it is wrong: it names the file, the
            key, the value and what would be valid.
    """
    file = read_toml(path)
    title = file.text("title", Path(path).stem.replace("_", " "))
    hose = file.table("hose")
    if hose is None:
        raise file.fail("hose", None, "a table [hose] with length and material or stiffnesses")
    spec = read_spec(hose)
    holds = grasps.read_holds(file, spec)
    gravity, loads = _read_loads(file.table("loads"), spec.length)
    floor = _read_floor(file.table("floor"))
    shape = file.points("shape")
    study = file.table("study") or TomlTable({}, path.name, "study")
    duration, start = _read_times(study, holds)
    errors = study.numbers("errors", ERRORS, above=1e-6, most=0.5)
    budget = study.number("budget", BUDGET, least=1.0, most=grasps.LONGEST)
    study.finish()
    file.finish()
    user = UserHose(
        title=title,
        spec=spec,
        holds=holds,
        loads=loads,
        gravity=gravity,
        floor=floor,
        shape=shape,
        duration=duration,
        start=start,
        errors=tuple(sorted(set(errors), reverse=True)),
        budget=budget,
    )
    if not holds and (duration is None or start == "equilibrium"):
        raise file.fail("holds", None, "one hold or more, or study.start = 'as-laid'")
    _check_shape(user, file)
    _check_floor(user, file)
    return user


def _read_loads(table: TomlTable | None, length: float) -> tuple[Vector, tuple[PointLoad, ...]]:
    if table is None:
        return GRAVITY, ()
    gravity: Vector = table.vector("gravity", GRAVITY)
    if max(map(abs, gravity)) > 1e4:
        raise table.fail("gravity", list(gravity), "three numbers up to 1e4 m/s^2")
    loads = []
    for part in table.tables("points"):
        at = grasps.read_place(part, length)
        force: Vector = part.vector("force", (0.0, 0.0, 0.0))
        moment: Vector = part.vector("moment", (0.0, 0.0, 0.0))
        if not any((*force, *moment)):
            raise part.fail("force", None, "a force or a moment that is not zero")
        part.finish()
        loads.append(PointLoad(at, force, moment))
    table.finish()
    return gravity, tuple(loads)


def _read_floor(table: TomlTable | None) -> Floor | None:
    if table is None:
        return None
    height = table.number("height", 0.0, least=-FARTHEST, most=FARTHEST)
    floor = Floor(height, table.number("friction", 0.0, least=0.0, most=10.0))
    table.finish()
    return floor


def _read_times(study: TomlTable, holds: tuple[grasps.Grasp, ...]) -> tuple[float | None, str]:
    """Duration and start; what moves is by default followed to the end of its last movement."""
    last = max((change.end for hold in holds for change in hold.changes), default=None)
    duration = last
    if "duration" in study:
        duration = study.number("duration", above=0.0, most=grasps.LONGEST)
    start: str = study.word("start", STARTS, "as-laid" if last is None else "equilibrium")
    if duration is None and "start" in study:
        raise study.fail("start", start, "left out without a duration: a rest shape has no start")
    if duration is not None and last is None and start == "equilibrium":
        raise study.fail("start", start, "'as-laid' where no hold moves: else nothing happens")
    return duration, start


def _check_shape(user: UserHose, file: TomlTable) -> None:
    """The points are as long as the hose, and the holds are on their line."""
    if user.shape is None:
        return
    if max(abs(x) for point in user.shape for x in point) > FARTHEST:
        raise file.fail("shape", "a far point", f"points within {FARTHEST:g} m of the origin")
    length = sum(math.dist(a, b) for a, b in pairwise(user.shape))
    if abs(length - user.spec.length) > _SHAPE_SLACK * user.spec.length:
        valid = f"points along {user.spec.length:g} m, within {100 * _SHAPE_SLACK:g} %"
        raise file.fail("shape", f"a line of {length:g} m", valid)
    for hold in user.holds:
        here = compute_place_on_line(user.shape, hold.arc_length / user.spec.length)
        if math.dist(here, hold.position) > _SHAPE_SLACK * user.spec.length:
            valid = f"a line that passes the hold at {hold.arc_length:g} m at its position"
            raise file.fail("shape", [round(x, 6) for x in here], valid)


def _check_floor(user: UserHose, file: TomlTable) -> None:
    """Holds and the line of the user stay above the floor, by the hose's radius at least."""
    if user.floor is None:
        return
    least = user.floor.height + user.spec.outer_radius
    held = [hold.position for hold in user.holds]
    held += [move.to for hold in user.holds for move in hold.moves if move.to is not None]
    for key, places in (("holds", held), ("shape", user.shape or ())):
        for place in places:
            if place[2] < least - 1e-9:
                valid = f"at or above z = {least:g} m, a radius above the floor"
                raise file.fail(key, list(place), valid)


def compute_place_on_line(points: tuple[Vector, ...], share: float) -> Vector:
    """The place at a share of the length of a line through points."""
    left = share * sum(math.dist(a, b) for a, b in pairwise(points))
    for one, other in pairwise(points):
        piece = math.dist(one, other)
        if piece >= left > 0.0:
            x, y, z = (a + (b - a) * left / piece for a, b in zip(one, other, strict=True))
            return x, y, z
        left -= piece
    return points[0] if share <= 0.0 else points[-1]
