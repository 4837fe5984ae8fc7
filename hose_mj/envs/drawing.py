"""`Renderer`: shows an episode in a render mode; loads what it needs at the first frame."""

from __future__ import annotations

import sys
from typing import Any

from hose_mj.envs.episode import Episode
from hose_mj.errors import InputError
from hose_mj.tasks.task import Task

RENDER_MODES = ["human", "ansi", "rgb_array"]
"""human: text on the terminal after each step; ansi: the text; rgb_array: an image (h, w, 3)."""


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

    def follow(self, episode: Episode) -> None:
        """Is told of every reset and step."""
        if self.mode == "human":
            sys.stdout.write(self._write(episode) + "\n\n")

    def render(self, episode: Episode) -> Any:
        """Returns the text or the image of the present state; None in mode human or without one."""
        if self.mode == "ansi":
            return self._write(episode)
        if self.mode == "rgb_array":
            from hose_mj.envs.pictures import make_picture
            from hose_mj.envs.raster import draw_picture

            return draw_picture(make_picture(self.task, episode.state, episode.events))
        return None

    def close(self) -> None:
        """Ends the drawing."""

    def _write(self, episode: Episode) -> str:
        from hose_mj.envs.pictures import make_picture
        from hose_mj.envs.text import write_picture

        return write_picture(make_picture(self.task, episode.state, episode.events))
