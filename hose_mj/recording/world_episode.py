"""Holds what happened in a world, in memory: the scene, samples over time, and how it ended.

Plain data, whatever simulated it; nothing here reads or writes a file. World frame, SI units.
Samples are rows of one structured array: appending copies numbers and makes no objects.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hose_mj.errors import InputError
from hose_mj.recording.episode import Array, check_name, check_rising, check_shape, lock_array
from hose_mj.recording.scene_description import SceneDescription

NO_TURN = -1  # turn of a sample of an episode that has none


def make_row_type(scene: SceneDescription) -> np.dtype[Any]:
    """Returns the type of one sample's numbers.

    Fields: `time` (s), `turn`, `reward`; `positions` (B, 3) and `quaternions` (B, 4), w x y z, of
    the scene's bodies; `hose` (P, 3) and `tension` (P,), N, along it; `control_points` (C, 3);
    `attachments` (N + 1, 3) and `forces` (N + 1, 3), N, on the hose, the tip's robot first and the
    source last; `margins` (M,), NaN where there is none.
    """
    n_bodies, n_points, n_holds = len(scene.bodies), len(scene.arc_lengths), len(scene.robots) + 1
    single = np.float32
    return np.dtype(
        [
            ("time", np.float64),
            ("turn", np.int64),
            ("reward", np.float64),
            ("positions", single, (n_bodies, 3)),
            ("quaternions", single, (n_bodies, 4)),
            ("hose", single, (n_points, 3)),
            ("tension", single, (n_points,)),
            ("control_points", single, (scene.n_control_points, 3)),
            ("attachments", single, (n_holds, 3)),
            ("forces", single, (n_holds, 3)),
            ("margins", np.float64, (len(scene.margins),)),
        ]
    )


@dataclass(frozen=True, eq=False)
class Samples:
    """A stretch of an episode, k samples."""

    # See `make_row_type`, (k,), times rising, numbers finite but for the margins.
    rows: NDArray[Any]
    owners: tuple[str, ...]  # whose turn it was, "" for nobody's, (k,)
    vetoed: tuple[str, ...]  # the actions vetoed, in one text, "" for none, (k,)
    events: tuple[str, ...]  # what happened, in one text, "" for nothing, (k,)

    def __post_init__(self) -> None:
        check_rising("times of the samples", self.rows["time"])
        for name in self.rows.dtype.names or ():
            if name != "margins" and not np.all(np.isfinite(self.rows[name])):
                bad = int(np.argwhere(~np.isfinite(self.rows[name]))[0][0])
                raise InputError(f"{name} of sample {bad}", "not finite", "finite numbers")
        for name in ("owners", "vetoed", "events"):
            if len(getattr(self, name)) != len(self.rows):
                raise InputError(
                    f"number of {name}", len(getattr(self, name)), f"{len(self.rows)}, as samples"
                )
        self.rows.setflags(write=False)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def times(self) -> Array:
        """Returns the simulated times (k,), s."""
        return np.asarray(self.rows["time"], dtype=np.float64)

    @property
    def has_turns(self) -> bool:
        """Says whether agents move in turns that are counted."""
        return bool(self.rows["turn"][0] != NO_TURN)


@dataclass(frozen=True, eq=False)
class BreakMark:
    """A broken constraint: which, where and when."""

    kind: str  # "stretch", "collision", ...
    time: float  # s
    place: Array  # (3,), m
    text: str  # one line for the reader
    # All that is known of it, plain JSON values.
    record: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_name("kind of a break", self.kind)
        check_name("text of a break", self.text)
        check_shape("place of a break", lock_array(self, "place", "break"), (3,))
        if not np.isfinite(self.time):
            raise InputError("time of a break", self.time, "a finite number (s)")


@dataclass(frozen=True, eq=False)
class EpisodeEnding:
    """An ending of an episode: in words ("break", "goal", "duration"), and the break if one was."""

    ended_by: str
    mark: BreakMark | None = None


@dataclass(frozen=True, eq=False)
class WorldEpisode:
    """A whole episode."""

    scene: SceneDescription
    samples: Samples
    ending: EpisodeEnding

    def __post_init__(self) -> None:
        wanted = make_row_type(self.scene)
        if self.samples.rows.dtype != wanted:
            raise InputError("type of the samples", self.samples.rows.dtype, f"{wanted}")


class SampleBuffer:
    """Gathers samples in arrays that grow up to a bound.

    Args:
        scene: what the samples are of.
        most: samples kept at most. When they are reached, every second one is dropped and from then
            on only every second one kept, and so forth: a long episode is kept whole, coarser, and
            its last sample in any case.

    Raises:
        InputError: fewer than 2 samples.
    """

    def __init__(self, scene: SceneDescription, most: int = 20_000) -> None:
        if most < 2:
            raise InputError("most", most, "a whole number, at least 2")
        self._type, self._most = make_row_type(scene), most
        self._grow(min(64, most))
        self._texts: list[tuple[str, str, str]] = []
        self._stride, self._seen = 1, 0

    def __len__(self) -> int:
        return len(self._texts)

    @property
    def is_full(self) -> bool:
        """Says whether another sample would make it coarser."""
        return len(self) >= self._most

    def append(self, owner: str = "", vetoed: str = "", event: str = "", **numbers: Any) -> None:
        """Adds a sample; one at the time of the last sample replaces that.

        Args:
            owner: whose turn it is.
            vetoed: the actions vetoed.
            event: what happened.
            numbers: the fields of `make_row_type`.
        """
        if len(self) and numbers["time"] <= self._rows["time"][len(self) - 1]:
            self._texts.pop()
            self._seen -= 1
        elif len(self) and (self._seen - 1) % self._stride:
            self._texts.pop()
        self._make_room()
        self._seen += 1
        k = len(self)
        for name, value in numbers.items():
            self._fields[name][k] = value
        self._texts.append((owner, vetoed, event))

    def extend(self, samples: Samples) -> None:
        """Adds all of a stretch."""
        texts = zip(samples.owners, samples.vetoed, samples.events, strict=True)
        names = self._type.names or ()
        for row, (owner, vetoed, event) in zip(samples.rows, texts, strict=True):
            self.append(owner, vetoed, event, **{name: row[name] for name in names})

    def copy(self) -> Samples:
        """Returns the samples so far; at least one must be there."""
        owners, vetoed, events = (tuple(texts) for texts in zip(*self._texts, strict=True))
        rows = self._rows[: len(self)].copy()
        rows["margins"][~np.isfinite(rows["margins"])] = np.nan
        return Samples(rows, owners, vetoed, events)

    def take(self) -> Samples:
        """Returns the samples so far and forgets them."""
        taken = self.copy()
        self._texts.clear()
        self._seen = 0
        return taken

    def _make_room(self) -> None:
        if self.is_full:
            kept = (len(self) + 1) // 2
            self._rows[:kept] = self._rows[: len(self) : 2]
            self._texts = self._texts[::2]
            self._stride *= 2
        if len(self) == len(self._rows):
            rows = self._rows
            self._grow(min(2 * len(rows), self._most))
            self._rows[: len(rows)] = rows

    def _grow(self, length: int) -> None:
        self._rows = np.zeros(length, self._type)
        self._fields = {name: self._rows[name] for name in self._type.names or ()}
