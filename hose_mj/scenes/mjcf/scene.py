"""A scene in MJCF: where the hose begins, which robots hold it, where its tip is to go.

The conventions (docs/scenes.md): sites `hose_source` and `goal`; robots are bodies with a site
`hose_attach`, numbered along the hose from the tip (0) to the source (N - 1); the hose is described
by `<custom>` numerics and a named material. All else is plain MJCF that MuJoCo opens as it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from hose_mj.assets import find_assets
from hose_mj.errors import InputError
from hose_mj.hoses.spec import HoseSpec
from hose_mj.scenes.mjcf.files import read_files, shorten
from hose_mj.scenes.mjcf.hose import HOSE_NUMERICS, HOSE_TEXT, read_hose
from hose_mj.scenes.mjcf.probe import probe
from hose_mj.scenes.mjcf.robots import SITE, SOURCE, Place, Robot, find_one, find_robots

GOAL = "goal"
ATTACHMENTS = "hose_attachments"
FRICTION = "hose_friction"
BOUNDS = "bounds"
CELL_SIZE = "cell_size"
DEFAULT_FRICTION = 0.3
CELLS_ALONG_HOSE = 16
"""Cells that the hose is long where the scene does not say how wide a cell is (thesis B.2)."""
_NUMERICS = (*HOSE_NUMERICS, ATTACHMENTS, FRICTION)
_ROUNDING = 1e-9

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Scene:
    """A checked scene.

    Attributes:
        path: its file.
        digest: SHA-256 over all its files; equal digests are equal scenes.
        spec: the hose; arc length 0 is at the source, the tip at its length.
        robots: along the hose, the tip's first.
        source: the site that holds the hose's beginning.
        goal: the site that the tip is to reach.
        bounds: lowest and highest x, y, z for the robots (m); infinite where there is no bound.
        friction: Coulomb friction coefficient between the hose and the scene.
        timestep: MuJoCo's step (s).
        cell_size: width of the square cells around the source in which robots move (m).
    """

    path: Path
    digest: str
    spec: HoseSpec
    robots: tuple[Robot, ...]
    source: Place
    goal: Place
    bounds: tuple[Vector, Vector]
    friction: float
    timestep: float
    cell_size: float

    def make_spec(self) -> Any:
        """Returns the scene as a new `mujoco.MjSpec`, to be extended by a hose and compiled.

        Raises:
            InputError: its files are no longer those that were checked.
        """
        if read_files(self.path).digest != self.digest:
            raise InputError("file", str(self.path), "files unchanged since the scene was read")
        import mujoco

        return mujoco.MjSpec.from_file(str(self.path))


def find_scene(name: str | Path) -> Path:
    """Returns the path of a shipped scene by its name ("floor_4"), or of a file that is there.

    Raises:
        InputError: neither.
    """
    path = Path(name)
    shipped = find_assets() / "scenes" / f"{name}.xml"
    if path.suffix != ".xml" and len(path.parts) == 1 and shipped.is_file():
        return shipped
    if path.is_file():
        return path
    raise InputError("scene", str(name), f"an MJCF file, or one of {', '.join(list_scenes())}")


def list_scenes() -> tuple[str, ...]:
    """Names of the shipped scenes."""
    return tuple(sorted(path.stem for path in (find_assets() / "scenes").glob("*.xml")))


def read_scene(path: str | Path) -> Scene:
    """Reads and checks a scene; MuJoCo sees it first in a child process with limits.

    Args:
        path: an MJCF file.

    Raises:
        InputError: the first thing that is wrong: file, element, value and what would be valid.
    """
    files = read_files(Path(path))
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
