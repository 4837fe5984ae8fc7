"""An episode on a grid: what it refuses, and that its recording reads back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.recording.grid import GridEpisode, GridTrack
from hose_mj.recording.rerun import encode_grid_episode, read_recording


@pytest.fixture
def episode():
    track = GridTrack("robot_0", "0", (0, 114, 178), np.array([[0.0, 1.0], [0.0, 2.0], [1.0, 2.0]]))
    return GridEpisode(
        title="line",
        turns=np.array([0, 1, 2]),
        lines=np.array([[[0.0, 0.0], [4.0, 0.0]], [[0.0, 1.0], [4.0, 1.0]]]),
        tracks=(track,),
        hose=np.array([[[0.0, 1.0], [0.0, 0.0]]] * 3),
        rewards=np.array([0.0, 0.0, 100.0]),
        events=("-", "-", "goal"),
    )


@pytest.mark.parametrize("with_hose", [True, False])
def test_a_recording_reads_back(episode, tmp_path, with_hose):
    path = tmp_path / "episode.rrd"
    shown = episode if with_hose else dataclasses.replace(episode, hose=None)
    path.write_bytes(encode_grid_episode(shown))
    summary = read_recording(path)
    rows = {
        name: (entity["rows"], entity["static"])
        for name, entity in summary["entities"].items()
        if not name.startswith("/__")
    }
    expected = {"/grid/lines": (0, 1), "/grid/robot_0": (3, 1), "/reward": (3, 0)}
    expected |= {"/events": (3, 0)} | ({"/grid/hose": (3, 1)} if with_hose else {})
    assert rows == expected
    assert summary["timelines"] == ["turn"]
    assert summary["n_blueprints"] == 1


@pytest.mark.parametrize(
    ("change", "thing"),
    [
        ({"turns": np.array([0, 1, 1])}, "turns"),
        ({"turns": np.array([], np.int64)}, "turns"),
        ({"rewards": np.zeros(2)}, "length of rewards"),
        ({"events": ("-",)}, "length of events"),
        ({"hose": np.zeros((2, 2, 2))}, "length of hose"),
    ],
)
def test_what_does_not_fit_is_refused(episode, change, thing):
    with pytest.raises(InputError) as caught:
        dataclasses.replace(episode, **change)
    assert caught.value.thing == thing


def test_two_tracks_of_one_name_or_of_another_length(episode):
    with pytest.raises(InputError, match="names that differ"):
        dataclasses.replace(episode, tracks=episode.tracks * 2)
    short = dataclasses.replace(episode.tracks[0], points=np.zeros((1, 2)))
    with pytest.raises(InputError, match="length of robot_0"):
        dataclasses.replace(episode, tracks=(short,))
