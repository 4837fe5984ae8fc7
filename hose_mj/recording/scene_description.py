"""Describes the scene of an episode in a world: all that is to be seen and does not change.

Plain data in the world frame, SI units. Quaternions are w, x, y, z.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from hose_mj.errors import InputError
from hose_mj.recording.episode import (
    Array,
    check_name,
    check_rising,
    check_shape,
    check_unique,
    lock_array,
)
from hose_mj.recording.palette import Rgb

GEOM_KINDS = ("plane", "box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh")
WORLD = -1  # body of what does not move
Rgba = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class Geom:
    """One shape, in the frame of a body."""

    name: str  # unique in its scene
    kind: str  # one of `GEOM_KINDS`
    # As MuJoCo has it, (3,), m: box, plane and ellipsoid half sizes; sphere radius; capsule and
    # cylinder radius and half length (along z); mesh none.
    size: Array
    color: Rgba  # red, green, blue, opacity, 0 to 255
    body: int  # index into the scene's bodies, or `WORLD`
    position: Array  # (3,), m
    quaternion: Array  # (4,)
    vertices: Array | None = None  # of a mesh, (v, 3), m; None for other kinds
    # Triangles of a mesh, indices of vertices (f, 3); None for other kinds.
    faces: Array | None = None

    def __post_init__(self) -> None:
        what = f"geom {self.name!r}"
        check_name("name of a geom", self.name)
        if self.kind not in GEOM_KINDS:
            raise InputError(f"{what}: kind", self.kind, f"one of {', '.join(GEOM_KINDS)}")
        for name, length in (("size", 3), ("position", 3), ("quaternion", 4)):
            check_shape(f"{what}: {name}", lock_array(self, name, what), (length,))
        if len(self.color) != 4 or not all(0 <= part <= 255 for part in self.color):
            raise InputError(f"{what}: color", self.color, "four integers, 0 to 255")
        if self.kind == "mesh":
            self._check_mesh(what)

    def _check_mesh(self, what: str) -> None:
        if self.vertices is None or self.faces is None:
            raise InputError(f"{what}: vertices, faces", None, "arrays, as it is a mesh")
        vertices, faces = lock_array(self, "vertices", what), lock_array(self, "faces", what)
        check_shape(f"{what}: vertices", vertices, (len(vertices), 3))
        check_shape(f"{what}: faces", faces, (len(faces), 3))
        if faces.size and not (faces.min() >= 0 and faces.max() < len(vertices)):
            raise InputError(f"{what}: faces", faces.max(), f"indices of {len(vertices)} vertices")


@dataclass(frozen=True)
class Margin:
    """A distance to a limit, which is at 0; positive is fine."""

    name: str  # for the reader ("stretch 0"); unique in its scene
    kind: str  # which constraint it watches
    unit: str  # "N" or "m"
    limit: str = ""  # what 0 means, in words ("at most 120 N"); may be empty

    def __post_init__(self) -> None:
        check_name("name of a margin", self.name)
        check_name(f"kind of margin {self.name!r}", self.kind)


class KindStyle(NamedTuple):
    """The look of a kind of constraint in plots; a kind without a style takes a spare colour."""

    name: str  # of the kind, as `Margin.kind` has it
    unit: str  # of its margins, "N" or "m"
    color: Rgb  # of its lines


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """Everything of an episode in a world that is seen and stays as it is."""

    name: str  # of the hose model, or whatever tells two episodes apart; unique where two are shown
    title: str  # for the reader
    geoms: tuple[Geom, ...]  # the scene's shapes; names unique
    bodies: tuple[str, ...]  # names of the bodies that move and have geoms, unique (B,)
    robots: tuple[str, ...]  # names, the tip's robot first (N,)
    goal: Geom  # shape of the goal, in no body
    arc_lengths: Array  # where the hose is sampled, rising (P,), m
    hose_radius: float  # m
    tension_limit: float  # what the hose may bear, N; the scale of its colours
    margins: tuple[Margin, ...]  # what the constraint monitor measures (M,)
    n_control_points: int  # C, 0 if the hose has none
    # low, high: corners of the space worth looking at, (3,) each, finite, m.
    low: Array
    high: Array
    # Lowest and highest place for the robots, (2, 3), infinite where there is no bound.
    bounds: Array
    source: Array  # where the hose begins, (3,), m
    settings: dict[str, str] = field(default_factory=dict)  # shown beside it, in this order
    cell: float = 0.0  # width of the squares drawn on the ground around the source, m; 0 for none
    kinds: tuple[KindStyle, ...] = ()  # how the kinds of the margins are shown

    def __post_init__(self) -> None:
        check_name("name of a scene", self.name)
        what = f"scene {self.name!r}"
        check_unique(f"geoms of {what}", [geom.name for geom in self.geoms])
        check_unique(f"bodies of {what}", list(self.bodies))
        check_unique(f"margins of {what}", [margin.name for margin in self.margins])
        for geom in self.geoms:
            if not WORLD <= geom.body < len(self.bodies):
                raise InputError(
                    f"body of geom {geom.name!r}", geom.body, f"-1 to {len(self.bodies) - 1}"
                )
        check_rising(f"{what}: arc_lengths", lock_array(self, "arc_lengths", what), at_least=2)
        for name in ("low", "high", "source"):
            check_shape(f"{what}: {name}", lock_array(self, name, what), (3,))
        if not np.all(self.low < self.high):
            raise InputError(f"{what}: low", self.low.tolist(), f"below {self.high.tolist()}")
        bounds = np.array(self.bounds, dtype=np.float64)
        check_shape(f"{what}: bounds", bounds, (2, 3))
        for name in ("hose_radius", "tension_limit"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"{what}: {name}", value, "a finite number above 0")
        object.__setattr__(self, "bounds", bounds)
        object.__setattr__(self, "settings", dict(self.settings))

    @property
    def size(self) -> float:
        """Returns the largest extent of the space worth looking at (m)."""
        return float(np.max(self.high - self.low))

    @property
    def ground(self) -> float:
        """Returns the height of the highest plane, or of the lowest thing without one (m)."""
        planes = [geom.position[2] for geom in self.geoms if geom.kind == "plane"]
        return float(max(planes, default=self.low[2]))

    @property
    def is_planar(self) -> bool:
        """Says whether it is much wider than high."""
        extent = self.high - self.low
        return bool(extent[2] < 0.4 * max(extent[:2]))
