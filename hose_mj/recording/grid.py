"""An episode on a grid, in memory: what stands where at each turn, rewards, events; see `rerun`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hose_mj.errors import InputError
from hose_mj.recording.palette import Rgb

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GridTrack:
    """Something that stands on a cell, over time."""

    name: str  # unique in its episode ("robot_0")
    label: str  # shown beside it
    color: Rgb  # red, green, blue, 0 to 255
    points: Array  # where it is at each turn, in cells, x to the right and y upwards (k, 2)


@dataclass(frozen=True, eq=False)
class GridEpisode:
    """One episode of k turns, the starting state counted as the first.

    Raises:
        InputError: not as many entries as turns, turns that do not rise, or two tracks of one name.
    """

    title: str  # of the task
    turns: NDArray[np.int64]  # moves since the start, rising (k,)
    lines: Array  # of the grid and its walls, each two points, in cells (n, 2, 2)
    tracks: tuple[GridTrack, ...]  # what stands on the grid
    hose: Array | None  # corners of the hose (k, m, 2); None without one
    rewards: Array  # of the step that led to each turn (k,)
    events: tuple[str, ...]  # names of what happened in that step, in one text (k,)

    def __post_init__(self) -> None:
        if len(self.turns) == 0 or np.any(np.diff(self.turns) <= 0):
            raise InputError("turns", self.turns.tolist(), "one or more rising numbers")
        lengths = {track.name: len(track.points) for track in self.tracks}
        if len(lengths) < len(self.tracks):
            raise InputError("tracks", [track.name for track in self.tracks], "names that differ")
        lengths |= {"rewards": len(self.rewards), "events": len(self.events)}
        if self.hose is not None:
            lengths["hose"] = len(self.hose)
        for name, length in lengths.items():
            if length != len(self.turns):
                valid = f"{len(self.turns)}, one for each turn"
                raise InputError(f"length of {name}", length, valid)
