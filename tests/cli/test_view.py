import json
import sys

import numpy as np
import pytest

from hose_mj.cli.main import main
from hose_mj.recording import rerun
from hose_mj.recording.rerun import write_world_recording
from hose_mj.recording.scene_description import Geom, SceneDescription
from hose_mj.recording.world_episode import BreakMark, EpisodeEnding, SampleBuffer, WorldEpisode


@pytest.fixture
def recording(tmp_path):
    goal = Geom("goal", "sphere", [0.1, 0, 0], (0, 255, 0, 255), -1, [1, 0, 0], [1, 0, 0, 0])
    bounds = np.array([[-np.inf] * 3, [np.inf] * 3])
    scene = SceneDescription(
        *("geds", "two points", (), (), (), goal, [0.0, 1.0], 0.01, 5.0, (), 0),
        *([0, 0, 0], [1, 1, 1], bounds, [0, 0, 0]),
    )
    buffer = SampleBuffer(scene)
    for time in (0.0, 1.0, 2.0):
        buffer.append(time=time, hose=[[0, 0, 0], [1, 0, 0]])
    ending = EpisodeEnding("break", BreakMark("stretch", 1.25, [1, 0, 0], "the hose tore"))
    path = tmp_path / "runs" / "recordings" / "a.rrd"
    write_world_recording(path, [WorldEpisode(scene, buffer.copy(), ending)])
    return path


@pytest.fixture
def shown(monkeypatch):
    calls = []
    monkeypatch.setattr(rerun, "open_recording", lambda path, at_s: calls.append((path, at_s)))
    monkeypatch.setattr(
        rerun, "take_screenshot", lambda path, png, at_s: calls.append((path, png, at_s))
    )
    return calls


def test_a_recording_opens_at_the_break(recording, shown, capsys):
    assert main(["view", str(recording), "--json"]) == 0
    ((path, at_s),) = shown
    assert path == recording
    assert at_s == pytest.approx(1.25)
    assert at_s >= 1.25
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert document["episodes"] == [
        {"model": "geds", "ended_by": "break", "break_kind": "stretch", "break_time": 1.25}
    ]
    assert "the hose tore" in captured.err


def test_a_folder_and_a_time_of_ones_own(recording, shown, tmp_path):
    png = tmp_path / "a.png"
    words = ["view", str(tmp_path / "runs"), "--at", "0.5", "--screenshot", str(png)]
    assert main(words) == 0
    assert shown == [(recording, png, 0.5)]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a display is taken for granted")
def test_without_a_display_there_is_one_clear_message(recording, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert main(["view", str(recording)]) == 2
    assert "--screenshot" in capsys.readouterr().err


def test_what_is_no_recording_is_named(tmp_path, capsys):
    assert main(["view", str(tmp_path / "absent.rrd")]) == 2
    assert "absent.rrd" in capsys.readouterr().err
