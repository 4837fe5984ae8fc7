"""Draws the picture of all tasks in the README: `python -m tools.task_pictures docs/images`."""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from hose_mj.envs.drawing import make_picture
from hose_mj.envs.picture import draw_picture
from hose_mj.recording.files import write_atomically
from hose_mj.tasks import kernels
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream

COLUMNS = ((("line", 18, 12),), (("line-non-cooperative", 18, 4),), (("taxi", 73, 2),))
LAST_COLUMN = (("corridor", 90, 0), ("maze", 72, 3))
"""What stands in each column: task, side of a cell (pixels), seed."""
GAP = 16
ROUNDS = 6


def draw_all() -> bytes:
    """Returns the PNG of all tasks side by side, each after a few moves that break nothing."""
    columns = [[draw_task(*item) for item in column] for column in (*COLUMNS, LAST_COLUMN)]
    widths = [max(image.shape[1] for image in column) for column in columns]
    heights = [sum(image.shape[0] for image in column) for column in columns]
    size = (sum(widths) + GAP * (len(columns) - 1), max(heights))
    sheet = Image.new("RGB", size, (255, 255, 255))
    left = 0
    for column, width in zip(columns, widths, strict=True):
        top = 0
        for image in column:
            sheet.paste(Image.fromarray(image), (left, top))
            top += image.shape[0]
        left += width + GAP
    data = io.BytesIO()
    sheet.save(data, "PNG", optimize=True)
    return data.getvalue()


def draw_task(id: str, cell: int, seed: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """Returns the image of a task (height, width, 3) after rounds of random safe moves."""
    task = make_task(id)
    random = np.random.default_rng(seed)
    state = task.reset(make_stream(random))
    scratch = task.make_state()
    for _ in range(ROUNDS * task.n_agents if id != "corridor" else 0):
        agent = int(state[kernels.TURN])
        safe = kernels.compute_safe_mask(task.kernel, state, agent, scratch)
        actions = [action for action in range(task.n_actions) if safe >> action & 1]
        before = state.copy()
        events = kernels.apply(task.kernel, state, agent, int(random.choice(actions)))
        if kernels.is_over(task.kernel, events):
            state = before
            break
    return draw_picture(replace(make_picture(task, state), caption=id), cell)


if __name__ == "__main__":
    write_atomically(Path(sys.argv[1]) / "tasks.png", draw_all())
