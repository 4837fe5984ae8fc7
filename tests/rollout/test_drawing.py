"""The hose as capsules in MuJoCo's own pictures."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from hose_mj.rollout.video import draw_hose
from hose_mj.world.registry import make_world


@pytest.fixture(scope="module")
def world():
    return make_world("floor_2")


def test_capsules_follow_the_hose(world):
    scn = mujoco.MjvScene(world.model, 500)
    scn.ngeom = 3  # what is there stays
    assert draw_hose(scn, world, 10.0, n_pieces=40) == 40
    assert scn.ngeom == 43
    points = world.hose_position(np.linspace(0.0, world.scene.spec.length, 41))
    for geom, start, end in zip(scn.geoms[3:43], points[:-1], points[1:], strict=True):
        assert geom.type == mujoco.mjtGeom.mjGEOM_CAPSULE
        assert geom.pos == pytest.approx(0.5 * (start + end), abs=1e-6)
        assert geom.size[0] == pytest.approx(world.scene.spec.outer_radius)
        assert 2.0 * geom.size[2] == pytest.approx(np.linalg.norm(end - start), rel=1e-4)
        axis = geom.mat.reshape(3, 3)[:, 2]
        assert abs(axis @ (end - start)) == pytest.approx(np.linalg.norm(end - start), rel=1e-5)


def test_tension_is_seen(world, monkeypatch):
    scn = mujoco.MjvScene(world.model, 10)
    for tension, redder in ((0.0, False), (10.0, True)):
        monkeypatch.setattr(world, "tension", lambda s, t=tension: np.full(len(s), t))
        scn.ngeom = 0
        draw_hose(scn, world, 10.0, n_pieces=4)
        red, green, _, opacity = scn.geoms[0].rgba
        assert opacity == 1.0
        assert (red > 2.0 * green) == redder


def test_a_full_scene_takes_what_fits(world):
    scn = mujoco.MjvScene(world.model, 10)
    scn.ngeom = 4
    assert draw_hose(scn, world, 10.0) == 6
    assert scn.ngeom == 10
