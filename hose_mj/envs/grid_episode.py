"""Turns the pictures of an episode into a `GridEpisode`, which a recording is made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hose_mj.envs.drawing import Moment
from hose_mj.envs.picture import Picture
from hose_mj.envs.pictures import make_picture
from hose_mj.recording.grid import Array, GridEpisode, GridTrack
from hose_mj.tasks.kernels import STEPS
from hose_mj.tasks.task import Task


def make_grid_episode(task: Task, moments: Sequence[Moment]) -> GridEpisode:
    """Makes the record of an episode from what a `Renderer` has seen of it."""
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
