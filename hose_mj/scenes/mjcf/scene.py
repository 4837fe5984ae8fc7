"""A scene in MJCF: where the hose begins, which robots hold it, where its tip is to go.

The conventions (docs/scenes.md): sites `hose_source` and `goal`; robots are bodies with a site
`hose_attach`, numbered along the hose from the tip (0) to the source (N - 1); the hose is described
by `<custom>` numerics and a named material. All else is plain MJCF that MuJoCo opens as it is.
"""

import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from hose_mj.errors import InputError
from hose_mj.hoses.materials import HOSE_KEYS, MATERIAL_KEYS, read_catalogue
from hose_mj.hoses.spec import HoseSpec
from hose_mj.scenes.hose_file.spec import LENGTHS, read_spec
from hose_mj.scenes.mjcf.catalogue import find_named, find_scene, list_scenes
from hose_mj.scenes.mjcf.files import read_files, shorten
from hose_mj.scenes.mjcf.model import probe
from hose_mj.toml_table import LARGEST_NUMBER, TomlTable

__all__ = ["Place", "Robot", "Scene", "find_scene", "list_scenes", "read_scene"]

SITE = "site"
SOURCE = "hose_source"
ATTACH = "hose_attach"
ORDER = "hose_robots"  # name of the tuple of sites that gives the robots' order, where names do not
_SEPARATORS = "/_.-"
_NUMBER = re.compile(r"\d{1,6}(?=\D*\Z)", re.ASCII)
GOAL = "goal"
ATTACHMENTS = "hose_attachments"
FRICTION = "hose_friction"
BOUNDS = "bounds"
CELL_SIZE = "cell_size"
DEFAULT_FRICTION = 0.3
CELLS_ALONG_HOSE = 16
"""Cells that the hose is long where the scene does not say how wide a cell is (thesis B.2)."""
_ROUNDING = 1e-9
_OUTER, _OLD_OUTER = "hose_outer_radius", "hose_radius"
_RADII = {_OUTER: "outer_diameter", "hose_inner_radius": "inner_diameter"}
_KEYS = tuple(
    key
    for key in dict.fromkeys((*MATERIAL_KEYS, *HOSE_KEYS))
    if key not in ("outer_radius", *_RADII.values())
)
_MAY_BE_NEGATIVE = ("hose_rest_strain", "hose_rest_curvature", "hose_rest_torsion")
_MAY_BE_ZERO = (
    *("hose_poisson_ratio", "hose_inner_radius", "hose_contents_density"),
    *("hose_damping_time", "hose_drag", "hose_torsional_stiffness"),
)
HOSE_NUMERICS = ("hose_length", *_RADII, *(f"hose_{key}" for key in _KEYS), _OLD_OUTER)
"""Names of the numerics that describe the hose itself, one number each, in SI units; the last one
is deprecated."""
HOSE_TEXT = "hose_material"
"""Name of the text that names a material or a ready hose of materials.toml."""
_RANGE = f"a number from {LENGTHS[0]:g} to {LENGTHS[1]:g} (m)"
_NUMERICS = (*HOSE_NUMERICS, ATTACHMENTS, FRICTION)

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Place:
    """A site in a body, where it is at the start (m), and whether the body can move."""

    site: str
    body: str
    position: tuple[float, float, float]
    moves: bool


@dataclass(frozen=True)
class Robot(Place):
    """A robot, by the site where it holds the hose."""

    name: str  # the prefix of its site ("robot0"), or its body's name where there is none
    arc_length: float  # where it holds the hose, from the source (m)


@dataclass(frozen=True)
class Scene:
    """A checked scene."""

    path: Path  # its file
    digest: str  # SHA-256 over all its files; equal digests are equal scenes
    spec: HoseSpec  # the hose; arc length 0 is at the source, the tip at its length
    robots: tuple[Robot, ...]  # along the hose, the tip's first
    source: Place  # the site that holds the hose's beginning
    goal: Place  # the site that the tip is to reach
    # Lowest and highest x, y, z for the robots (m); infinite where there is no bound.
    bounds: tuple[Vector, Vector]
    friction: float  # Coulomb friction coefficient between the hose and the scene
    timestep: float  # MuJoCo's step (s)
    cell_size: float  # width of the square cells around the source in which robots move (m)

    def make_spec(self) -> Any:
        """Returns the scene as a new `mujoco.MjSpec`, to be extended by a hose and compiled.

        Raises:
            InputError: its files are no longer those that were checked.
        """
        if read_files(self.path).digest != self.digest:
            raise InputError("file", str(self.path), "files unchanged since the scene was read")
        import mujoco

        return mujoco.MjSpec.from_file(str(self.path))


def read_scene(path: str | Path) -> Scene:
    """Reads and checks a scene; MuJoCo sees it first in a child process with limits.

    Args:
        path: an MJCF file, or the name of a scene (`list_scenes`).

    Raises:
        InputError: the first thing that is wrong: file, element, value and what would be valid.
    """
    files = read_files(find_named(path) or Path(path))
    facts = probe(files.path)
    file = shorten(files.path.name)
    numerics = facts["numerics"]
    _check_names(numerics, facts["texts"], file)
    spec = read_hose(numerics, facts["texts"], file)
    places = [Place(s["name"], s["body"], tuple(s["position"]), s["moves"]) for s in facts["sites"]]
    source = find_one(places, SOURCE, file)
    goal = find_one(places, GOAL, file)
    if source.moves:
        raise InputError(f"{file}: site {source.site}", source.body, "in a body that cannot move")
    robots = find_robots(places, facts["tuples"], numerics.get(ATTACHMENTS), spec.length, file)
    _check_reach(source, goal, robots, spec.length, file)
    friction = numerics.get(FRICTION, [DEFAULT_FRICTION])
    if len(friction) != 1 or not 0.0 <= friction[0] <= 10.0:
        raise InputError(f"{file}: numeric {FRICTION}", friction[0], "one number from 0 to 10")
    bounds = _read_bounds(numerics.get(BOUNDS), file)
    _check_inside(bounds, (*robots, goal), file)
    return Scene(
        path=files.path,
        digest=files.digest,
        spec=spec,
        robots=robots,
        source=source,
        goal=goal,
        bounds=bounds,
        friction=float(friction[0]),
        timestep=facts["timestep"],
        cell_size=_read_cell_size(numerics.get(CELL_SIZE), spec.length, file),
    )


def _check_names(numerics: Mapping[str, Any], texts: Mapping[str, str], file: str) -> None:
    """A mistyped name would silently be no data at all."""
    for kind, names, known in (("numeric", numerics, _NUMERICS), ("text", texts, (HOSE_TEXT,))):
        for name in names:
            if name.startswith("hose_") and name not in known:
                thing = f"{file}: {kind}"
                raise InputError(thing, shorten(name), "one of " + ", ".join(known))


def _check_reach(
    source: Place, goal: Place, robots: Sequence[Robot], length: float, file: str
) -> None:
    """Each robot and the goal must be within reach of the source, neighbours of each other."""
    for robot in robots:
        what = "from the source, the hose up to this robot"
        _check_distance(file, robot, source, robot.arc_length, what)
    for robot, behind in pairwise(robots):
        slack = robot.arc_length - behind.arc_length
        _check_distance(file, robot, behind, slack, f"from {behind.site}, the hose between them")
    _check_distance(file, goal, source, length, "from the source, the whole hose")


def _check_distance(file: str, place: Place, other: Place, most: float, what: str) -> None:
    distance = math.dist(place.position, other.position)
    if not distance <= most + _ROUNDING:
        thing = f"{file}: distance of {SITE} {place.site}"
        raise InputError(thing, round(distance, 6), f"at most {most:g} m {what}")


def _read_cell_size(data: Sequence[float] | None, length: float, file: str) -> float:
    if data is None:
        return length / CELLS_ALONG_HOSE
    if len(data) != 1 or not 0.0 < data[0] <= length:
        valid = f"one number above 0, at most the hose's length {length:g} (m)"
        raise InputError(f"{file}: numeric {CELL_SIZE}", tuple(data[:4]), valid)
    return float(data[0])


def _read_bounds(data: Sequence[float] | None, file: str) -> tuple[Vector, Vector]:
    if data is None:
        return (-math.inf,) * 3, (math.inf,) * 3
    valid = (
        "x_min y_min x_max y_max, or x_min y_min z_min x_max y_max z_max, each min below its max"
    )
    n = len(data) // 2
    if len(data) not in (4, 6) or not all(a < b for a, b in zip(data[:n], data[n:], strict=True)):
        raise InputError(f"{file}: numeric {BOUNDS}", tuple(data[:6]), valid)
    low = (data[0], data[1], data[2] if n == 3 else -math.inf)
    high = (data[n], data[n + 1], data[5] if n == 3 else math.inf)
    return low, high


def _check_inside(bounds: tuple[Vector, Vector], places: Sequence[Place], file: str) -> None:
    low, high = bounds
    for place in places:
        if not all(a <= x <= b for a, x, b in zip(low, place.position, high, strict=True)):
            at = tuple(round(x, 6) for x in place.position)
            thing = f"{file}: position of {SITE} {place.site}"
            raise InputError(thing, at, f"within the bounds, {low} to {high} (m)")


def find_one(places: Sequence[Place], name: str, file: str) -> Place:
    """Returns the one site of a name, with any prefix; `InputError` for none or several."""
    found = [place for place in places if _split(place.site, name) is not None]
    if len(found) != 1:
        valid = f"one <site name='{name}'/>, a prefix such as 'arena/' allowed"
        raise InputError(f"{file}: sites {name}", [shorten(p.site) for p in found[:8]], valid)
    return found[0]


def find_robots(
    places: Sequence[Place],
    tuples: Mapping[str, Sequence[str]],
    attachments: Sequence[float] | None,
    length: float,
    file: str,
) -> tuple[Robot, ...]:
    """Returns the robots, the tip's first.

    The order is that of the sites in the tuple `hose_robots` where the scene has it. Otherwise each
    robot's number is the last number in the prefix of its site or, without one, in its body's name,
    and the numbers are 0 to N - 1; a single robot needs none. Robot i holds the hose at L (N - i) /
    N from the source, so that the segments are equal, or at the i-th of `attachments`. `InputError`
    is raised for no robots, a robot that cannot move or has two sites, numbers that are not 0 to N
    - 1, attachments that do not fall from the tip to the source.
    """
    found = {p.site: p for p in places if _split(p.site, ATTACH) is not None}
    if not found:
        valid = f"one in each robot's body, <site name='{ATTACH}'/>, prefixes allowed"
        raise InputError(f"{file}: sites {ATTACH}", None, valid)
    bodies: dict[str, str] = {}
    for place in found.values():
        thing = f"{file}: site {shorten(place.site)}"
        if not place.moves:
            raise InputError(thing, shorten(place.body), "in a body that joints let move")
        if place.body and place.body in bodies:
            valid = f"one in a body; {shorten(bodies[place.body])} is in this one too"
            raise InputError(thing, shorten(place.body), valid)
        bodies[place.body] = place.site
    order = tuples.get(ORDER)
    ordered = _order_by_number(found, file) if order is None else _order_by(order, found, file)
    arcs = _check_attachments(attachments, len(ordered), length, file)
    return tuple(
        Robot(p.site, p.body, p.position, p.moves, _split(p.site, ATTACH) or p.body, arc)
        for p, arc in zip(ordered, arcs, strict=True)
    )


def _split(site: str, name: str) -> str | None:
    """The prefix of a site without its separator; None for a site of another name."""
    prefix = site.removesuffix(name)
    if prefix == site or (prefix and prefix[-1] not in _SEPARATORS):
        return None
    return prefix[:-1]


def _order_by(order: Sequence[str], found: Mapping[str, Place], file: str) -> list[Place]:
    if sorted(order) != sorted(found):
        valid = "each of the sites " + ", ".join(map(shorten, found)) + " once"
        raise InputError(f"{file}: tuple {ORDER}", [shorten(s) for s in order[:8]], valid[:500])
    return [found[site] for site in order]


def _order_by_number(found: Mapping[str, Place], file: str) -> list[Place]:
    if len(found) == 1:
        return list(found.values())
    numbered: dict[int, Place] = {}
    for place in found.values():
        match = _NUMBER.search(_split(place.site, ATTACH) or place.body)
        number = int(match.group()) if match else None
        if number is None or number >= len(found) or number in numbered:
            thing = f"{file}: number of the robot with site {shorten(place.site)}"
            valid = f"each of 0 (tip) to {len(found) - 1} (next to the source) once, or a tuple"
            raise InputError(thing, number, f"{valid} {ORDER}")
        numbered[number] = place
    return [numbered[i] for i in range(len(found))]


def _check_attachments(
    given: Sequence[float] | None, n: int, length: float, file: str
) -> tuple[float, ...]:
    if given is None:
        return tuple(length * ((n - i) / n) for i in range(n))
    ends = (*given, 0.0)
    falls = all(a > b for a, b in pairwise(ends))
    if len(given) != n or not falls or given[0] > length:
        valid = f"{n} numbers, the tip's first, falling, above 0 and at most {length:g} (m)"
        raise InputError(f"{file}: numeric hose_attachments", tuple(given[:8]), valid)
    return tuple(given)


def read_hose(
    numerics: Mapping[str, Sequence[float]], texts: Mapping[str, str], file: str
) -> HoseSpec:
    """Returns the hose that a scene's numerics and texts, by name, describe; `file` names it.

    A named material or ready hose gives numbers first, and the scene's numerics replace them.
    `InputError` is raised for a number out of range, too few of them, or an unknown material.
    """
    given = {
        name: _check_numeric(name, numerics[name], file)
        for name in HOSE_NUMERICS
        if name in numerics
    }
    if _OLD_OUTER in given:
        _warn_of_radius(given, file)
    if "hose_length" not in given:
        valid = f"<custom><numeric name='hose_length' data='...'/>, {_RANGE}"
        raise InputError(f"{file}: numeric hose_length", None, valid)
    radius, inner = given.get(_OUTER), given.get("hose_inner_radius")
    if inner is not None and radius is not None and inner >= radius:
        valid = f"below {_OUTER}, {radius:g} m"
        raise InputError(f"{file}: numeric hose_inner_radius", inner, valid)
    values: dict[str, object] = {"length": given["hose_length"]}
    values |= {key: given[f"hose_{key}"] for key in _KEYS if f"hose_{key}" in given}
    values |= {key: 2.0 * given[name] for name, key in _RADII.items() if name in given}
    values |= _find_material(texts, file)
    try:
        return read_spec(TomlTable(values, file))
    except InputError as error:
        raise _rename_error(error, given, file) from error


def _warn_of_radius(given: dict[str, float], file: str) -> None:
    """Takes the old name of the outer radius, for one release."""
    if _OUTER in given:
        valid = f"left out where {_OUTER} is given"
        raise InputError(f"{file}: numeric {_OLD_OUTER}", given[_OLD_OUTER], valid)
    text = f"{file}: numeric {_OLD_OUTER} is deprecated: write {_OUTER}"
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    given[_OUTER] = given.pop(_OLD_OUTER)


def _check_numeric(name: str, data: Sequence[float], file: str) -> float:
    thing = f"{file}: numeric {name}"
    if len(data) != 1:
        raise InputError(thing, tuple(data[:4]), "one number")
    value = float(data[0])
    if name == "hose_length":
        valid, is_valid = _RANGE, LENGTHS[0] <= value <= LENGTHS[1]
    elif name in _MAY_BE_NEGATIVE:
        valid, is_valid = "a finite number", True
    elif name in _MAY_BE_ZERO:
        valid, is_valid = "a finite number at or above 0", value >= 0.0
    else:
        valid, is_valid = "a finite number above 0", value > 0.0
    if not (is_valid and math.isfinite(value) and abs(value) <= LARGEST_NUMBER):
        raise InputError(thing, value, valid)
    return value


def _find_material(texts: Mapping[str, str], file: str) -> dict[str, str]:
    name = texts.get(HOSE_TEXT)
    if name is None:
        return {}
    catalogue = read_catalogue()
    if name in catalogue.hoses:
        return {"like": name}
    if name in catalogue.materials:
        return {"material": name}
    valid = "one of " + ", ".join((*catalogue.hoses, *catalogue.materials))
    raise InputError(f"{file}: text {HOSE_TEXT}", name[:80], valid)


def _rename_error(error: InputError, given: Mapping[str, float], file: str) -> InputError:
    """Says the same in the words of a scene: numerics for TOML's keys, radii for diameters."""
    key = error.thing.rsplit(" ", 1)[-1].rsplit(".", 1)[-1]
    names = {key: name for name, key in _RADII.items()}
    name = names.get(key, f"hose_{key}")
    valid = error.valid.replace("outer_diameter", _OUTER)
    return InputError(f"{file}: numeric {name}", given.get(name, error.value), valid)
