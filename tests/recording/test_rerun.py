import os
import subprocess
import sys
import time
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from hose_mj.errors import HoseError, InputError
from hose_mj.recording.episode import HoseTrack, Scene, Series
from hose_mj.recording.palette import COLORS
from hose_mj.recording.rerun import read_recording, take_screenshot, viewer, write_recording
from hose_mj.recording.rerun.comparison import compute_framing
from hose_mj.recording.rerun.parts import round_spacing


def make_swing(name, lag=0.0, sideways=0.0, n_times=30):
    s, t = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 1.0, n_times)
    angle = np.cos(3.0 * (t - lag))[:, None] * np.ones_like(s)
    points = np.stack([s * np.sin(angle), sideways * angle * s, -s * np.cos(angle)], axis=-1)
    return HoseTrack(name, s, t, points, 0.01, COLORS[name.split(",")[0]])


def make_scene(name="released-rod", sideways=0.0):
    geds, cable = make_swing("geds, 16", 0.0, sideways), make_swing("cable, 40/x", 0.1, sideways)
    distance = np.linalg.norm(geds.points - cable.points, axis=-1).max(axis=1)
    series = (
        Series("cable to geds", geds.times, distance, "m", limit=0.05),
        Series("steps", geds.times[:5], np.arange(5.0)),
    )
    return Scene(name, "Released rod", (geds, cable), series, "Two models | overlaid.")


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "compare.rrd"
    scenes = [make_scene(), make_scene("in-space", 0.5)]
    write_recording(path, scenes, {"timestep": "2 ms | all"}, "run-1")
    return path


def test_a_recording_reads_back(recording):
    summary = read_recording(recording)
    assert summary["application_id"] == "hose_mj"
    assert summary["recording_id"] == "run-1"
    assert summary["timelines"] == ["sim_time"]
    assert summary["n_blueprints"] == 1
    rows = {path: (e["rows"], e["static"]) for path, e in summary["entities"].items()}
    rows = {path: n for path, n in rows.items() if not path.startswith("/__")}
    expected = {"/settings": (0, 1)}
    for scene in ("released-rod", "in-space"):
        expected |= {
            f"/{scene}/note": (0, 1),
            f"/{scene}/legend": (0, 1),
            f"/{scene}/series/m/cable\\ to\\ geds": (30, 1),
            f"/{scene}/series/m/cable\\ to\\ geds/limit": (2, 1),
            f"/{scene}/series/number/steps": (5, 1),
        }
        for track in ("geds\\,\\ 16", "cable\\,\\ 40\\/x"):
            expected[f"/{scene}/hoses/{track}"] = (30, 2)
            expected[f"/{scene}/hoses/{track}/ends"] = (30, 1)
    assert rows == expected
    strips = summary["entities"]["/in-space/hoses/geds\\,\\ 16"]["components"]
    lines = ["LineStrips3D:colors", "LineStrips3D:radii", "LineStrips3D:strips"]
    assert strips == [*lines, "Transform3D:translation"]


def test_a_recording_is_replaced_whole(recording):
    write_recording(recording, [make_scene()], {}, "run-2")
    assert read_recording(recording)["recording_id"] == "run-2"
    assert [path.name for path in recording.parent.iterdir()] == ["compare.rrd"]


def test_bad_input_is_refused(tmp_path):
    path = tmp_path / "a.rrd"
    with pytest.raises(InputError, match="at least one scene"):
        write_recording(path, [], {}, "x")
    with pytest.raises(InputError, match="released-rod"):
        write_recording(path, [make_scene(), make_scene()], {}, "x")
    with pytest.raises(InputError, match="recording_id"):
        write_recording(path, [make_scene()], {}, " ")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", [None, b"", b"garbage" * 100])
def test_what_is_no_recording_is_named(tmp_path, content):
    path = tmp_path / "broken.rrd"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"broken\.rrd"):
        read_recording(path)


def test_planar_scenes_are_seen_straight_on_and_whole():
    flat, deep = compute_framing(make_scene()), compute_framing(make_scene(sideways=0.5))
    assert np.allclose((flat.eye - flat.target)[[0, 2]], 0.0)
    assert flat.eye[1] < 0.0
    assert np.allclose(flat.eye_up, [0, 0, 1])
    assert np.allclose(deep.eye_up, [0, 0, 1])
    assert np.allclose(deep.grid_normal, [0, 0, 1])
    for framing, scene in ((flat, make_scene()), (deep, make_scene(sideways=0.5))):
        points = np.concatenate([track.points.reshape(-1, 3) for track in scene.tracks])
        ahead = framing.target - framing.eye
        ahead = ahead / np.linalg.norm(ahead)
        rays = points - framing.eye
        assert np.all(np.abs(rays @ framing.up) < np.tan(np.radians(27.5)) * (rays @ ahead))


def test_hoses_at_one_place_are_told_apart():
    scene = make_scene()
    framing = compute_framing(scene)
    radii, shifts = framing.clip_radii(scene), framing.compute_shifts(scene)
    lowest, upper = (track.name for track in scene.tracks)
    assert radii[lowest] > radii[upper] > 0.0
    assert np.allclose(shifts[lowest], 0.0)
    assert shifts[upper] @ (framing.eye - framing.target) > 0.0
    assert np.linalg.norm(shifts[upper]) < 0.01 * framing.size
    deep = make_scene(sideways=0.5)
    assert not np.any(list(compute_framing(deep).compute_shifts(deep).values()))


@pytest.mark.parametrize(("length", "spacing"), [(1.0, 1.0), (0.13, 0.1), (0.5, 0.5), (47.0, 20.0)])
def test_grid_spacings_are_round(length, spacing):
    assert round_spacing(length) == pytest.approx(spacing)


@pytest.mark.parametrize(
    "reason", ["No graphics adapter was found", "Failed to get render context"]
)
def test_a_missing_driver_is_explained(reason):
    text = viewer.explain_failure(f"thread 'main' panicked at '{reason}'")
    assert all(package in text for package in viewer.DEBIAN_PACKAGES)
    assert "code 7" in viewer.explain_failure("starting\nfailed with code 7\n")


def test_a_viewer_that_ends_by_itself_is_an_error(monkeypatch):
    failing = [sys.executable, "-c", "print('No graphics adapter was found')"]
    monkeypatch.setattr(viewer, "make_command", lambda port, size: failing)
    with viewer.start_viewer((64, 64)) as running, pytest.raises(HoseError, match="apt-get"):
        running.wait_until_listening(time.monotonic() + 20.0)


def test_a_viewer_that_hangs_is_killed(monkeypatch):
    monkeypatch.setattr(
        viewer, "make_command", lambda *_: [sys.executable, "-c", "import time; time.sleep(99)"]
    )
    with pytest.raises(HoseError, match="in time"), viewer.start_viewer((64, 64)) as running:
        running.wait_until_listening(time.monotonic() + 0.2)
    assert running.process.poll() is not None


def test_a_screenshot_shows_the_hoses(recording, tmp_path):
    path = tmp_path / "compare.png"
    try:
        take_screenshot(recording, path, timeout_s=60.0, size=(1000, 700), at_s=0.7)
    except HoseError as error:
        if "graphics driver" in str(error):
            pytest.skip(str(error))
        raise
    pixels = matplotlib.image.imread(path)[..., :3]
    assert pixels.shape[:2] == (700, 1000)
    assert pixels.std() > 0.05
    for model in ("geds", "cable"):
        near = np.all(np.abs(pixels - np.array(COLORS[model]) / 255.0) < 0.08, axis=-1)
        assert near.sum() > 50, model


def test_a_screenshot_of_no_recording_starts_no_viewer(tmp_path, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a viewer was started"))
    with pytest.raises(InputError):
        take_screenshot(tmp_path / "absent.rrd", tmp_path / "a.png")
    assert not os.listdir(tmp_path)


FULL_DISK = """
import resource, signal, sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_world_episode import make_scene
from hose_mj.recording.rerun import open_sinks
from hose_mj.recording.world_episode import EpisodeEnding, SampleBuffer

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
scene = make_scene()
(sink,) = open_sinks(save=Path({path!r}))
sink.begin(scene)
buffer = SampleBuffer(scene)
for k in range(500):
    buffer.append(time=0.01 * k)
sink.add(buffer.take())
try:
    sink.end(EpisodeEnding("stopped"))
except OSError as error:
    print(error.strerror)
"""


@pytest.mark.skipif(os.name != "posix", reason="limits of files are POSIX's")
def test_a_full_disk_is_an_error_of_the_system_and_hangs_nothing(tmp_path):
    path = tmp_path / "episode.rrd"
    code = FULL_DISK.format(tests=str(Path(__file__).parent), path=str(path))
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, "File too large\n"), done.stderr
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("module", ["rerun.experimental", "rerun.chunk"])
def test_a_version_of_rerun_that_lacks_what_we_use_is_named(recording, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(HoseError, match=rf"rerun .* has no {module}\."):
        viewer.connect("") if module == "rerun.experimental" else read_recording(recording)
