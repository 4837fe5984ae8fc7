"""`Renderer`: shows an episode in a render mode; loads what it needs at the first frame."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

from hose_mj.envs.episode import Episode, sum_signals
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task

RENDER_MODES = ["human", "ansi", "rgb_array", "rerun"]
"""human: text on the terminal after each step; ansi: the text; rgb_array: an image (h, w, 3);
rerun: a Rerun recording (.rrd, bytes) of the episode so far."""


class Moment(NamedTuple):
    """The state after a reset or a step, with the step's events and the team's reward."""

    state: Integers
    events: int
    reward: float


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
            reward = float(sum_signals(episode.compute_team_signals(), episode.chosen))
            self._history.append(Moment(episode.state.copy(), episode.events, reward))

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
            from hose_mj.envs.pictures import make_picture
            from hose_mj.envs.raster import draw_picture

            return draw_picture(make_picture(self.task, episode.state, episode.events))
        if self.mode == "rerun":
            from hose_mj.envs.grid_episode import make_grid_episode
            from hose_mj.recording.rerun import encode_grid_episode

            return encode_grid_episode(make_grid_episode(self.task, self._history))
        return None

    def close(self) -> None:
        """Ends the drawing."""

    def _write(self, episode: Episode) -> str:
        from hose_mj.envs.pictures import make_picture
        from hose_mj.envs.text import write_picture

        return write_picture(make_picture(self.task, episode.state, episode.events))
