"""Holds what was simulated, in memory: hoses and numbers over time, and the scene around them.

Nothing here reads or writes a file. Arrays are copied, made float64 and locked on construction.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hose_mj.errors import InputError
from hose_mj.recording.palette import Rgb

Array = NDArray[np.float64]
_SCENE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True, eq=False)
class HoseTrack:
    """One hose over time."""

    name: str  # what the reader calls it ("geds, 16 points"); unique in its scene
    arc_lengths: Array  # where the points sit along the hose at rest, (m,), rising, m >= 2 (m)
    times: Array  # simulated time of each sample, (k,), rising (s)
    points: Array  # centre line in the world frame, (k, m, 3) (m)
    radius: float  # of the hose (m)
    color: Rgb  # red, green, blue, 0 to 255; see `palette`
    tension: Array | None = None  # axial force, positive in tension, (k, m), or None (N)

    def __post_init__(self) -> None:
        what = f"track {self.name!r}"
        check_name("name of a track", self.name)
        arc_lengths = lock_array(self, "arc_lengths", what)
        check_rising(f"{what}: arc_lengths", arc_lengths, at_least=2)
        times = lock_array(self, "times", what)
        check_rising(f"{what}: times", times)
        shape = (len(times), len(arc_lengths))
        check_shape(f"{what}: points", lock_array(self, "points", what), (*shape, 3))
        if self.tension is not None:
            check_shape(f"{what}: tension", lock_array(self, "tension", what), shape)
        if not (np.isfinite(self.radius) and self.radius > 0.0):
            raise InputError(f"{what}: radius", self.radius, "a finite number above 0 (m)")
        check_color(what, self.color)


@dataclass(frozen=True, eq=False)
class Series:
    """One number over time, such as the distance between two models."""

    # What the reader calls it; unique in its scene. It takes the colour of the model that it starts
    # with, if any.
    name: str
    times: Array  # (k,), rising (s)
    values: Array  # (k,), finite
    unit: str = ""  # "m", "N", ..., "" for a plain number. Series of one unit share a plot
    limit: float | None = None  # a bound drawn as a line, or None
    color: Rgb | None = None  # overrides the colour that goes with the name

    def __post_init__(self) -> None:
        what = f"series {self.name!r}"
        check_name("name of a series", self.name)
        times = lock_array(self, "times", what)
        check_rising(f"{what}: times", times)
        check_shape(f"{what}: values", lock_array(self, "values", what), (len(times),))
        if self.limit is not None and not np.isfinite(self.limit):
            raise InputError(f"{what}: limit", self.limit, "a finite number or None")
        if self.color is not None:
            check_color(what, self.color)


@dataclass(frozen=True, eq=False)
class Scene:
    """Hoses and numbers that are shown together: one case of a comparison, or one episode."""

    name: str  # short and stable, letters, digits, ".", "_" and "-" ("tip-load")
    title: str  # for the reader
    tracks: tuple[HoseTrack, ...]  # the hoses, overlaid; at least one
    series: tuple[Series, ...] = ()  # the numbers below them
    note: str = ""  # a few sentences in Markdown on what is to be seen

    def __post_init__(self) -> None:
        if not _SCENE_NAME.fullmatch(self.name):
            raise InputError(
                "name of a scene", self.name, "letters, digits, '.', '_', '-', none of them first"
            )
        object.__setattr__(self, "tracks", tuple(self.tracks))
        object.__setattr__(self, "series", tuple(self.series))
        if not self.tracks:
            raise InputError(f"tracks of scene {self.name!r}", self.tracks, "at least one")
        check_unique(f"tracks of scene {self.name!r}", [track.name for track in self.tracks])
        check_unique(f"series of scene {self.name!r}", [series.name for series in self.series])


def check_name(what: str, name: str) -> None:
    """Raises `InputError` for a name that is blank or has control characters."""
    if not name.strip() or not name.isprintable():
        raise InputError(what, name, "a printable text that is not blank")


def check_unique(what: str, names: list[str]) -> None:
    """Raises `InputError` where a name comes twice."""
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise InputError(what, repeated, "names that differ")


def check_shape(what: str, values: Array, shape: tuple[int, ...]) -> None:
    """Raises `InputError` unless `values` has exactly this shape."""
    if values.shape != shape:
        raise InputError(f"shape of {what}", values.shape, f"{shape}")


def check_rising(what: str, values: Array, at_least: int = 1) -> None:
    """Raises `InputError` unless `values` is a strictly increasing vector of enough numbers."""
    if values.ndim != 1 or len(values) < at_least:
        raise InputError(f"shape of {what}", values.shape, f"(k,) with k >= {at_least}")
    steps = np.diff(values)
    if np.any(steps <= 0.0):
        bad = int(np.argmax(steps <= 0.0)) + 1
        raise InputError(f"{what}[{bad}]", float(values[bad]), "more than the one before it")


def check_color(what: str, color: Rgb) -> None:
    """Raises `InputError` unless `color` is three integers in 0 to 255."""
    parts: tuple[object, ...] = tuple(color)
    if len(parts) != 3 or not all(isinstance(c, int) and 0 <= c <= 255 for c in parts):
        raise InputError(f"{what}: color", color, "three integers, 0 to 255")


def lock_array(owner: object, field: str, what: str) -> Array:
    """Replaces a field of a frozen dataclass by a read-only float64 copy; refuses NaN, infinity."""
    value: ArrayLike = getattr(owner, field)
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: {field}", type(value).__name__, "an array of numbers") from None
    if not np.all(np.isfinite(array)):
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{what}: {field}{list(place)}", float(array[place]), "a finite number")
    array.setflags(write=False)
    object.__setattr__(owner, field, array)
    return array
