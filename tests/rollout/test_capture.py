import csv
import sys
from types import SimpleNamespace

import matplotlib.image
import mujoco
import numpy as np
import pytest

from hose_mj.errors import HoseError, InputError
from hose_mj.recording.rerun import (
    open_sinks,
    read_outcomes,
    read_recording,
    take_screenshot,
    write_world_recording,
)
from hose_mj.recording.rerun.episodes import check_url
from hose_mj.recording.rerun.world_scene import rotate
from hose_mj.recording.world_table import write_csv
from hose_mj.rollout.capture import Capture, HoseReader, SceneBodies, describe_scene
from hose_mj.world.registry import make_world

N_SAMPLES = 30


@pytest.fixture
def recording(episode, tmp_path):
    path = tmp_path / "episode.rrd"
    write_world_recording(path, [episode])
    return path


def test_the_stage_shows_every_visible_geom_where_it_is(world, monitor):
    stage, cast = describe_scene(world, monitor, {})
    assert stage.bodies == ("robot0/puck", "robot1/puck")
    assert len(stage.geoms) == world.model.ngeom  # all of the floor's are in groups 0 and 1
    for i, geom in enumerate(stage.geoms):
        place, turn = geom.position, geom.quaternion
        if geom.body >= 0:
            body = cast.bodies[geom.body]
            place = world.data.xpos[body] + rotate(world.data.xquat[body], place)
            mujoco.mju_mulQuat(found := np.zeros(4), world.data.xquat[body], turn)
            turn = found
        mujoco.mju_quat2Mat(matrix := np.zeros(9), turn)
        np.testing.assert_allclose(place, world.data.geom_xpos[i], atol=1e-12)
        np.testing.assert_allclose(matrix, world.data.geom_xmat[i], atol=1e-12)
    floor = next(geom for geom in stage.geoms if geom.name == "floor")
    # the mean of the two grays of its checkered texture, as the MJCF has them
    np.testing.assert_allclose(np.array(floor.color[:3]) / 255, [0.70, 0.73, 0.77], atol=0.01)
    np.testing.assert_allclose(stage.goal.position, world.goal_position())


def test_bodies_of_a_hose_are_not_on_stage(world, floor):
    spec = floor.make_spec()
    spec.worldbody.add_body(name="hose_node", pos=[0, 0, 1]).add_geom(size=[0.01, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    data.xpos[:, 2] += 0.5
    cast = SceneBodies(SimpleNamespace(scene=floor, model=model, data=data))
    assert cast.names == ("robot0/puck", "robot1/puck")
    assert [model.body(i).name for i in cast.bodies] == list(cast.names)


def test_samples_are_what_the_world_was(episode):
    rows, times = episode.samples.rows, episode.samples.times
    np.testing.assert_allclose(times, 0.1 * np.arange(N_SAMPLES))
    for robot in range(2):
        moved = rows["positions"][:, robot, 1] - rows["positions"][0, robot, 1]
        np.testing.assert_allclose(moved, -0.1 * (robot + 1) * times, atol=1e-6)
        np.testing.assert_allclose(
            rows["attachments"][:, robot, 1] - rows["attachments"][0, robot, 1], moved, atol=1e-6
        )
    np.testing.assert_allclose(rows["tension"][:, -1], 4.0 * times, rtol=1e-6)
    np.testing.assert_allclose(rows["margins"][:, 0], 10.0 - 4.0 * times)
    assert np.all(np.isnan(rows["margins"][:, 1]))
    assert episode.samples.vetoed[3] == "north, east"
    assert episode.ending.mark.time == 2.5


def test_a_recording_reads_back(recording):
    summary = read_recording(recording)
    assert summary["timelines"] == ["sim_time", "turn"]
    assert summary["n_blueprints"] == 1
    entities = {
        path.replace("\\", ""): (entity["rows"], entity["static"])
        for path, entity in summary["entities"].items()
    }
    for name in ("hose", "control_points", "forces", "names"):
        assert entities[f"/world/rails/{name}"] == (N_SAMPLES, 1)
    for robot in ("robot0", "robot1"):
        assert entities[f"/world/rails/robots/{robot}/puck"] == (N_SAMPLES, 0)
        assert entities[f"/world/rails/robots/{robot}/puck/{robot}/disc"] == (0, 1)
    for name in ("floor", "edge_east", "goal", "goal/label", "bounds", "cells"):
        assert entities[f"/world/scene/{name}"] == (0, 1)
    assert entities["/plots/rails/N/stretch"] == (N_SAMPLES, 1)
    assert entities["/plots/rails/m/obstacle"] == (N_SAMPLES, 1)
    assert entities["/plots/rails/N/limit"] == (2, 1)
    assert entities["/plots/rails/reward"] == (N_SAMPLES, 1)
    assert entities["/states/rails/turn"] == (6, 1)  # it changes every five samples
    assert entities["/states/rails/vetoed"] == (8, 0)  # begins and ends four times
    assert entities["/states/rails/break"] == (1, 1)
    assert entities["/log/rails"] == (5, 0)  # four vetoes and the break
    assert entities["/world/rails/break"] == (1, 0)
    assert entities["/settings"] == (0, 1)
    assert entities["/tension"] == (0, 1)


def test_a_recording_knows_its_break(recording):
    ((name, outcome),) = read_outcomes(recording).items()
    assert name == "rails"
    assert outcome["ended_by"] == "break"
    assert outcome["break_kind"] == "stretch"
    assert outcome["break_time"] == 2.5
    assert "segment 0" in outcome["break_text"]


def test_two_models_are_overlaid(episode, tmp_path):
    from dataclasses import replace

    other = replace(episode, scene=replace(episode.scene, name="cable"))
    write_world_recording(tmp_path / "both.rrd", [episode, other])
    entities = read_recording(tmp_path / "both.rrd")["entities"]
    assert {"/world/rails/hose", "/world/cable/hose"} <= set(entities)
    assert set(read_outcomes(tmp_path / "both.rrd")) == {"rails", "cable"}
    with pytest.raises(InputError, match="names that differ"):
        write_world_recording(tmp_path / "same.rrd", [episode, episode])
    assert not (tmp_path / "same.rrd").exists()


def test_a_streamed_file_holds_what_a_whole_one_does(world, monitor, recording, tmp_path, play):
    path = tmp_path / "streamed.rrd"
    play(Capture(open_sinks(save=path)), world, monitor, N_SAMPLES)
    streamed, whole = (read_recording(p)["entities"] for p in (path, recording))
    assert {k: v["rows"] for k, v in streamed.items()} == {k: v["rows"] for k, v in whole.items()}
    assert read_outcomes(path) == read_outcomes(recording)


def test_long_episodes_are_streamed_in_stretches(world, monitor, tmp_path, play):
    path = tmp_path / "long.rrd"
    play(Capture(open_sinks(save=path)), world, monitor, 150)
    assert read_recording(path)["entities"]["/world/rails/hose"]["rows"] == 150


def test_a_run_that_is_stopped_leaves_a_recording(world, monitor, tmp_path):
    path = tmp_path / "stopped.rrd"
    with Capture(open_sinks(save=path)) as capture:
        capture.start(world, monitor)
        capture.sample(world, monitor)
    assert read_outcomes(path) == {"rails": {"ended_by": "stopped"}}
    assert [file.name for file in tmp_path.iterdir()] == ["stopped.rrd"]


def test_an_absent_viewer_is_said_once_and_the_file_is_complete(
    world, monitor, tmp_path, capsys, play
):
    path = tmp_path / "alone.rrd"
    sinks = open_sinks(save=path, connect="rerun+http://127.0.0.1:9/proxy")
    play(Capture(sinks), world, monitor, 150)
    assert capsys.readouterr().err.count("viewer at rerun+http://127.0.0.1:9/proxy") == 1
    assert read_recording(path)["entities"]["/world/rails/hose"]["rows"] == 150


@pytest.mark.parametrize("url", ["127.0.0.1:9876", "http://a:1/proxy", "rerun+http://a/proxy"])
def test_a_wrong_url_is_named(url):
    with pytest.raises(InputError, match="9876/proxy"):
        open_sinks(connect=url)
    assert check_url("rerun+http://127.0.0.1:9876/proxy") == ("127.0.0.1", 9876)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a display is taken for granted")
def test_a_window_without_a_display_is_one_clear_message(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(HoseError, match="no display"):
        open_sinks(spawn=True)


def test_the_table_has_a_row_for_each_sample(episode, tmp_path):
    write_csv(tmp_path / "episode.csv", episode)
    with open(tmp_path / "episode.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == N_SAMPLES
    assert float(rows[-1]["time_s"]) == pytest.approx(2.9)
    assert float(rows[-1]["margin stretch 0_N"]) == pytest.approx(10.0 - 4.0 * 2.9)
    assert rows[-1]["margin obstacle 1_m"] == ""
    assert float(rows[-1]["tension_max_N"]) == pytest.approx(4.0 * 2.9, rel=1e-6)
    assert rows[3]["vetoed"] == "north, east"
    assert float(rows[10]["robot0 force_y_N"]) == pytest.approx(1.0)


def test_a_screenshot_shows_hose_and_break(recording, tmp_path):
    path = tmp_path / "episode.png"
    try:
        take_screenshot(recording, path, size=(1200, 800), at_s=2.6)
    except HoseError as error:
        if "graphics driver" in str(error):
            pytest.skip(str(error))
        raise
    pixels = matplotlib.image.imread(path)[..., :3]
    assert pixels.std() > 0.1
    views = pixels[50:450, :900]  # in space and from above
    for color in ([214, 30, 40], [176, 186, 196], [255, 40, 50]):  # taut hose, floor, break
        near = np.all(np.abs(views - np.array(color) / 255.0) < 0.1, axis=-1)
        assert near.sum() > 15, color


def test_a_spline_hose_is_read_as_the_world_says(floor):
    world = make_world(floor)
    world.control[:] = [5.0, -3.0, 2.0, 4.0]
    world.step(50)
    arc_lengths = np.linspace(0.0, floor.spec.length, 33)
    control_points, hose = HoseReader(world, arc_lengths).read(world)
    np.testing.assert_allclose(hose, world.hose_position(arc_lengths), atol=1e-12)
    np.testing.assert_allclose(control_points[[0, -1]], hose[[0, -1]], atol=1e-12)  # open knots
    assert not np.allclose(hose, make_world(floor).hose_position(arc_lengths))


def test_margins_that_are_known_are_not_measured_again(world, monitor):
    capture = Capture(keep=True)
    capture.start(world, monitor)
    monitor.measure = lambda: pytest.fail("measured")
    capture.sample(world, monitor, {"margins": np.array([7.0, np.inf])})
    capture.finish()
    margins = capture.episode().samples.rows["margins"]
    np.testing.assert_array_equal(margins, [[7.0, np.nan]])
