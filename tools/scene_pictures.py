"""Draws the picture of docs/scenes.md: `python -m tools.scene_pictures docs/images`.

Where there is no display, with MUJOCO_GL=egl in the environment.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hose_mj.recording.files import write_atomically
from hose_mj.recording.plots.style import encode_png, make_figure
from hose_mj.scenes.mjcf.scene import find_scene, read_scene

SHOWN = (("floor_1", "floor_4", "floor_6"), ("corridor", "deck", "lift"))
CAMERA = "overview"
WIDTH, HEIGHT = 640, 480


def render_scene(name: str) -> NDArray[np.uint8]:
    """Returns a shipped scene at its start, seen by its camera, shape (HEIGHT, WIDTH, 3)."""
    import mujoco

    model = read_scene(find_scene(name)).make_spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera=CAMERA)
        return np.asarray(renderer.render(), dtype=np.uint8)


def draw_scenes(pictures: dict[str, NDArray[np.uint8]]) -> bytes:
    """Returns the PNG of a sheet with all of `SHOWN`."""
    with make_figure((9.6, 5.2)) as figure:
        for axes, name in zip(figure.subplots(*np.shape(SHOWN)).flat, sum(SHOWN, ()), strict=True):
            axes.imshow(pictures[name])
            axes.set_title(name)
            axes.set_axis_off()
        return encode_png(figure)


if __name__ == "__main__":
    shown = {name: render_scene(name) for row in SHOWN for name in row}
    write_atomically(Path(sys.argv[1]) / "scenes.png", draw_scenes(shown))
