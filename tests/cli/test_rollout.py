"""`hose-mj rollout`: its document, what it prints, what it refuses, and learners as policies."""

from __future__ import annotations

import json

import pytest
from hose_learning.study.run_folder import RunFolder
from hose_learning.study.training import join

from hose_mj.cli import main as cli
from hose_mj.cli.train import Args, make_training
from hose_mj.hoses import health

FIELDS = {
    "model": str,
    "scene": str,
    "steps": int,
    "sim_time": float,
    "ended_by": str,
    "stalled": int,
    "wall_s": float,
    "recording_overhead": float,
}


def run(capsys, *words):
    status = cli.main(["rollout", *map(str, words)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_the_document_of_a_break(capsys):
    status, out, _ = run(capsys, "floor_2", "--policy", "break-stretch", "--json", "--seed", 4)
    document = json.loads(out)
    assert status == 0
    assert (document["command"], document["seed"]) == ("rollout", 4)
    assert document["settings"]["policy"] == "break-stretch"
    for name, kind in FIELDS.items():
        assert isinstance(document[name], kind), name
    assert document["recording"] is None
    assert (document["model"], document["scene"]) == ("geds", "floor_2")
    assert document["ended_by"] == "break"
    broken = document["break"]
    assert broken["kind"] == "stretch"
    assert 0.0 < broken["time"] <= document["sim_time"]
    assert len(broken["place"]) == 3
    (only,) = document["rollouts"]
    assert all(document[name] == value for name, value in only.items())


@pytest.mark.filterwarnings("default::hose_mj.HoseWarning")
def test_health_is_in_the_document_and_strict_ends_with_status_2(capsys, monkeypatch):
    words = ("floor_2", "--policy", "random", "--duration", 0.1, "--json")
    _, out, _ = run(capsys, *words, "--models", "geds", "flex", "--strict")
    document = json.loads(out)
    assert [one["health"] is None for one in document["rollouts"]] == [False, True]
    assert document["health"]["steps"] == document["steps"]
    assert document["health"]["warnings"] == []
    monkeypatch.setattr(health, "MOST_RETRIES", -1.0)  # so that the 64th step is not healthy
    monkeypatch.setattr(health, "EVERY", 10)
    status, out, err = run(capsys, *words)
    (said,) = json.loads(out)["health"]["warnings"]
    assert (status, err) == (0, f"hose-mj: warning: {said}\n")
    status, out, err = run(capsys, *words, "--strict")
    assert (status, out, err) == (2, "", f"hose-mj: error: {said}\n")
    status, _, err = run(capsys, *words, "--model", "flex", "--strict")
    assert (status, err[:31]) == (2, "hose-mj: error: strict is True;")


def test_the_duration_and_the_goal(capsys):
    _, out, _ = run(capsys, "floor_2", "--policy", "random", "--duration", 0.2, "--json")
    document = json.loads(out)
    assert (document["ended_by"], document["break"]) == ("duration", None)
    assert document["sim_time"] == pytest.approx(0.2)
    status, out, _ = run(capsys, "floor_2")
    assert status == 0
    assert out.startswith("geds: goal after ")


def test_a_recording_is_written(capsys, tmp_path):
    path = tmp_path / "break.rrd"
    status, out, _ = run(capsys, "floor_2", "--policy", "break-stretch", "--save", path, "--json")
    assert status == 0
    assert json.loads(out)["recording"] == str(path)
    assert path.stat().st_size > 10_000
    assert [file.name for file in tmp_path.iterdir()] == ["break.rrd"]


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["attic"], "scene is 'attic'; valid: an MJCF file, or one of"),
        (["floor_2", "--policy", "nap"], "policy is 'nap'; valid: random, to-goal, break-stretch"),
        (["floor_2", "--policy", "break-obstacle"], "policy is 'break-obstacle'; valid: a scene w"),
        (["floor_2", "--model", "string"], "model is 'string'; valid: one of geds"),
        (["floor_2", "--models", "geds", "geds"], "models is 'geds geds'; valid: two different"),
        (["floor_2", "--models", "gedz"], "models is 'gedz'; valid: one of geds, cable, flex (did"),
        (["floor_2", "--models", "geds"], "models is 'geds'; valid: two different"),
        (["floor_2", "--save", ""], "--save is ''; valid: a path that is not empty"),
        (["floor_2", "--duration", "0"], "duration is 0.0; valid: above 0"),
        (["floor_2", "--seed", "-1"], "seed is -1; valid"),
        (["floor_2", "--save", "a.txt"], "save is 'a.txt'; valid: a file name that ends in .rrd"),
        (["floor_2", "--save", "no/where/a.rrd"], "save is 'no/where/a.rrd'; valid: a file in a"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capsys, words, what):
    status, out, err = run(capsys, *words)
    assert status == 2
    assert out == ""
    assert err.startswith(f"hose-mj: error: {what}")
    assert err.count("\n") == 1


def make_run(path, task, *options):
    """A run that has not trained yet: its learner chooses among equals, by its stream."""
    training = make_training(Args(task=task, set=options, episodes=10))
    folder = RunFolder(path)
    folder.create(training, seed=0)
    folder.save(training, join([]))


def test_a_saved_learner_acts(capsys, tmp_path):
    make_run(tmp_path / "run", "line", "n_robots=2")
    documents = []
    for _ in range(2):
        status, out, _ = run(
            capsys, "floor_2", "--policy", tmp_path / "run", "--duration", 1.5, "--json"
        )
        assert status == 0
        documents.append(json.loads(out))
    assert [d["steps"] for d in documents] == [documents[0]["steps"]] * 2
    assert documents[0]["sim_time"] > 0.0
    status, out, err = run(capsys, "floor_3", "--policy", tmp_path / "run")
    assert (status, out) == (2, "")
    assert "robots of the scene is 3; valid: 2, as in" in err
    status, _, err = run(capsys, "floor_2", "--policy", tmp_path)
    assert status == 2
    assert "a folder with a config.json in it" in err


def test_a_learner_of_something_else_is_refused(capsys, tmp_path):
    make_run(tmp_path / "run", "corridor")
    status, _, err = run(capsys, "floor_2", "--policy", tmp_path / "run")
    assert status == 2
    assert "task of the run is 'corridor'; valid: line" in err
