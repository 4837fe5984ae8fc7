"""`Renderer`: shows an episode in a render mode; loads what it needs at the first frame."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hose_mj.envs.episode import Episode, sum_signals
from hose_mj.envs.picture import Picture, draw_picture, write_picture
from hose_mj.envs.pictures import make_picture
from hose_mj.errors import InputError
from hose_mj.recording.grid import Array, GridEpisode, GridTrack
from hose_mj.tasks.kernels import STEPS, Integers
from hose_mj.tasks.task import Task

RENDER_MODES = ["human", "ansi", "rgb_array", "rerun"]
"""human: text on the terminal after each step; ansi: the text; rgb_array: an image (h, w, 3);
rerun: a Rerun recording (.rrd, bytes) of the episode so far."""


class Moment(NamedTuple):
    """The state after a reset or a step, with the step's events and the team's reward."""

    state: Integers
    events: int
    reward: float


def look_at(episode: Episode) -> Moment:
    """Returns the moment that an episode is at."""
    reward = float(sum_signals(episode.compute_team_signals(), episode.chosen))
    return Moment(episode.state.copy(), episode.events, reward)


class Renderer:
    """Draws the episodes of one environment.

    Args:
        task: what is played.
        mode: one of `RENDER_MODES`, or None to draw nothing.

    Raises:
        InputError: an unknown mode.
    """

    def __init__(self, task: Task, mode: str | None) -> None:
        if mode is not None and mode not in RENDER_MODES:
            raise InputError("render_mode", mode, f"None or one of {', '.join(RENDER_MODES)}")
        self.task, self.mode = task, mode
        self._history: list[Moment] = []

    def follow(self, episode: Episode) -> None:
        """Is told of every reset and step."""
        if self.mode == "human":
            sys.stdout.write(self._write(episode) + "\n\n")
        if self.mode == "rerun":
            if episode.steps == 0:
                self._history = []
            self._history.append(look_at(episode))

    def render(self, episode: Episode) -> Any:
        """Returns what the mode asks for; None in mode human or without one.

        Raises:
            InputError: nothing to show yet.
        """
        if self.mode is not None and not episode.begun:
            raise InputError("episode", "not begun", "one that runs; call reset() first")
        if self.mode == "ansi":
            return self._write(episode)
        if self.mode == "rgb_array":
            return draw_picture(make_picture(self.task, episode.state, episode.events))
        if self.mode == "rerun":
            return encode_moments(self.task, self._history)
        return None

    def close(self) -> None:
        """Ends the drawing."""

    def _write(self, episode: Episode) -> str:
        return write_picture(make_picture(self.task, episode.state, episode.events))


def encode_moments(task: Task, moments: Sequence[Moment]) -> bytes:
    """Returns the Rerun recording of an episode (.rrd)."""
    from hose_mj.recording.rerun import encode_grid_episode

    return encode_grid_episode(make_grid_episode(task, moments))


def make_grid_episode(task: Task, moments: Sequence[Moment]) -> GridEpisode:
    """Makes the record of an episode from its moments."""
    pictures = [make_picture(task, moment.state) for moment in moments]
    first = pictures[0]
    tracks = [
        GridTrack(
            f"{mark.kind}_{place}",
            mark.label or mark.kind,
            mark.color,
            np.array([picture.marks[place].at for picture in pictures], np.float64),
        )
        for place, mark in enumerate(first.marks)
    ]
    return GridEpisode(
        title=task.id,
        turns=np.array([moment.state[STEPS] for moment in moments]),
        lines=list_lines(first),
        tracks=tuple(tracks),
        hose=np.array([picture.hose for picture in pictures], np.float64) if first.hose else None,
        rewards=np.array([moment.reward for moment in moments]),
        events=tuple(", ".join(task.name_events(moment.events)) or "-" for moment in moments),
    )


def list_lines(picture: Picture) -> Array:
    """Lists the walls, or the lines of a grid without walls, each two points (n, 2, 2)."""
    if picture.walls:
        return np.array(picture.walls, np.float64)
    left, bottom = picture.corner[0] - 0.5, picture.corner[1] - 0.5
    right, top = left + picture.columns, bottom + picture.rows
    upright = [((left + k, bottom), (left + k, top)) for k in range(picture.columns + 1)]
    level = [((left, bottom + k), (right, bottom + k)) for k in range(picture.rows + 1)]
    return np.array(upright + level, np.float64)
