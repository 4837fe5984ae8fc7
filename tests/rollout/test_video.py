import sys

import numpy as np
import pytest

from hose_mj.errors import HoseError, InputError
from hose_mj.recording.palette import color_tension
from hose_mj.rollout import video


@pytest.fixture
def frames(episode, floor, monkeypatch):
    try:
        return list(video.render_frames(episode, floor, (320, 240), 1, "top"))
    except HoseError as error:
        pytest.skip(f"no OpenGL here: {error}")


@pytest.mark.slow
def test_frames_show_robots_and_hose_move(frames):
    assert len(frames) == 4  # 2.9 s at one a second, both ends
    assert all(frame.shape == (240, 320, 3) for frame in frames)
    assert np.abs(frames[0].astype(int) - frames[-1]).max() > 60
    taut = np.array(color_tension(np.array(10.0), 10.0), dtype=float)
    reddish = (frames[-1][..., 0] > 1.8 * frames[-1][..., 1]) & (frames[-1][..., 0] > 0.4 * taut[0])
    before = (frames[0][..., 0] > 1.8 * frames[0][..., 1]) & (frames[0][..., 0] > 0.4 * taut[0])
    assert reddish.sum() > before.sum() + 50


def test_bodies_stand_where_the_samples_have_them(episode, floor):
    model = floor.make_spec().compile()
    puppets = video.PosedBodies(model, episode)
    start = puppets.data.geom_xpos.copy()
    puppets.pose(20)  # at 2 s, robot i has moved by -0.2 (i + 1) m
    shift = puppets.data.geom_xpos - start
    moved = [model.geom_bodyid == model.body(f"robot{i}/puck").id for i in range(2)]
    np.testing.assert_allclose(shift[moved[0], 1], -0.2, atol=1e-6)
    np.testing.assert_allclose(shift[moved[1], 1], -0.4, atol=1e-6)
    assert not np.any(shift[~moved[0] & ~moved[1]])


def test_a_film_without_its_extra_is_one_clear_message(episode, floor, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(HoseError, match=r"hose-mj\[video\]"):
        video.write_mp4(tmp_path / "a.mp4", episode, floor)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", [{"size": (100, 100)}, {"fps": 0}])
def test_wrong_sizes_and_rates_are_named(episode, floor, tmp_path, wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        video.write_mp4(tmp_path / "a.mp4", episode, floor, **wrong)


def test_an_unknown_camera_is_named(floor):
    with pytest.raises(InputError, match="overview, top"):
        video.choose_camera(floor.make_spec().compile(), "moon")
