import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hose_mj.scenes.mjcf.scene import list_scenes
from tools import scene_pictures

ROOT = Path(__file__).resolve().parents[2]


def test_the_sheet_shows_shipped_scenes():
    names = [name for row in scene_pictures.SHOWN for name in row]
    assert set(names) <= set(list_scenes())
    blank = np.zeros((scene_pictures.HEIGHT, scene_pictures.WIDTH, 3), dtype=np.uint8)
    sheet = scene_pictures.draw_scenes(dict.fromkeys(names, blank))
    assert sheet.startswith(b"\x89PNG\r\n\x1a\n")


def test_a_rendered_scene_is_not_blank():
    """In a process of its own: without a graphics driver OpenGL may even end it."""
    code = "from tools import scene_pictures as s; print(*s.render_scene('floor_2').std((0, 1)))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=os.environ | {"MUJOCO_GL": "egl"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    if done.returncode != 0:
        pytest.skip("no EGL driver renders here (Debian: libegl1 libegl-mesa0)")
    assert all(float(deviation) > 10.0 for deviation in done.stdout.split())
