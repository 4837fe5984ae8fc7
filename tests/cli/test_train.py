"""`hose-mj train`: its document, its run folders, its mistakes, and how it is stopped."""

import json
import os
import signal

import numpy as np
import pytest
from hose_learning.learners.catalog import LEARNERS
from hose_learning.settings import Exploration
from hose_learning.study import run_folder
from hose_learning.study.training import Training

from hose_mj.cli import main as cli
from hose_mj.cli import train
from hose_mj.cli.progress import defer_interrupt, show_progress
from hose_mj.cli.task_options import parse_options

MAZE = ("train", "maze", "--learner", "q-learning", "--tests", "20", "--episodes", "200")


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    """Trainings run as plain Python, so that nothing has to be compiled."""

    class Plain(Training):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **{**options, "compiled": False})

    monkeypatch.setattr("hose_learning.study.training.Training", Plain)
    monkeypatch.setattr("hose_learning.study.run_folder.Training", Plain)
    monkeypatch.setattr(train, "_compile", lambda training: None)


@pytest.fixture
def call(capsys):
    """Runs a command line; returns status, document or text, and messages."""

    def run(*words):
        status = cli.main([str(word) for word in words])
        captured = capsys.readouterr()
        out = json.loads(captured.out) if "--json" in words else captured.out
        return status, out, captured.err

    return run


def read_checkpoint(folder):
    with np.load(folder / run_folder.CHECKPOINT) as arrays:
        return {name: arrays[name].tobytes() for name in arrays.files}


def test_the_document(call, tmp_path):
    status, document, _ = call(*MAZE, "--out", tmp_path / "run", "--json", "--seed", 3)
    assert status == 0
    shared = ["command", "version", "revision", "machine", "seed", "settings"]
    assert list(document)[:6] == shared
    assert document["seed"] == 3
    results = {name: value for name, value in document.items() if name not in shared}
    for name in ("run", "task", "model", "learner", "moves", "wall_s", "moves_per_s"):
        assert name in results
    assert (results["task"], results["learner"], results["model"]) == ("maze", "q-learning", None)
    assert results["run"] == str(tmp_path / "run")
    assert results["episodes"] == 200
    # Greedy, the maze is solved from everywhere: within 7 moves.
    assert results["success_rate"] == 1.0
    assert 1.0 <= results["steps_mean"] <= 7.0
    low, high = results["interval"]
    assert 0.8 < low < high == 1.0
    assert results["breaks"] == {"collision": 0}
    assert results["wall_s"] > 0.0
    assert results["moves_per_s"] > 0.0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary == results


def test_a_run_that_was_resumed_equals_one_that_was_not(call, tmp_path):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    common = (*MAZE[:-2], "--epsilon-per-episode", "0.01", "--json")
    _, once, _ = call(*common, "--episodes", 200, "--out", whole)
    call(*common, "--episodes", 90, "--out", parts)
    status, resumed, _ = call(
        "train", "--resume", parts, "--episodes", 200, "--tests", 20, "--json"
    )
    assert status == 0
    assert read_checkpoint(whole) == read_checkpoint(parts)
    for name in ("moves", "episodes", "success_rate", "steps_mean"):
        assert once[name] == resumed[name]


@pytest.mark.parametrize("ends", [("--episodes", "120"), ("--moves", "700")])
def test_an_interrupted_run_goes_on_to_its_own_end(call, tmp_path, monkeypatch, ends):
    """Ctrl-C while a chunk runs: the chunk is finished and its episodes are kept."""
    import pyarrow.parquet

    monkeypatch.setattr("hose_learning.study.training.CHUNK", {False: 50})
    common = (*MAZE[:-2], *ends, "--epsilon-per-episode", "0.01")
    call(*common, "--out", tmp_path / "whole")
    run, calls = Training._run, []

    def interrupt(training, *arguments):
        calls.append(1)
        if len(calls) == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return run(training, *arguments)

    monkeypatch.setattr(Training, "_run", interrupt)
    status, _, err = call(*common, "--out", tmp_path / "stopped")
    assert status == cli.INTERRUPTED
    assert "interrupted" in err
    assert len(calls) == 3
    status, _, _ = call("train", "--resume", tmp_path / "stopped", "--tests", 20)
    assert status == 0
    assert read_checkpoint(tmp_path / "whole") == read_checkpoint(tmp_path / "stopped")
    tables = [
        pyarrow.parquet.read_table(tmp_path / name / "episodes").to_pydict()
        for name in ("whole", "stopped")
    ]
    assert tables[0] == tables[1]


@pytest.fixture
def interruptible():
    """Ctrl-C as in a terminal; a process started in the background ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_a_second_interrupt_stops_at_once():
    before = signal.getsignal(signal.SIGINT)

    def work():
        with defer_interrupt() as is_interrupted:
            assert not is_interrupted()
            os.kill(os.getpid(), signal.SIGINT)
            assert is_interrupted()
            os.kill(os.getpid(), signal.SIGINT)
            pytest.fail("the second one was kept too")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert signal.getsignal(signal.SIGINT) is before


def test_checkpoints_are_written_meanwhile(call, tmp_path, monkeypatch):
    monkeypatch.setattr(train, "SAVE_SECONDS", 0.0)
    monkeypatch.setattr("hose_learning.study.training.CHUNK", {False: 50})
    call(*MAZE, "--out", tmp_path)
    assert len(list((tmp_path / "episodes").iterdir())) > 3


def test_it_says_what_it_did(call, tmp_path):
    status, out, _ = call(*MAZE, "--out", tmp_path / "run")
    assert status == 0
    assert "q-learning on maze: 200 episodes" in out
    assert "100.0 % reach the goal" in out
    assert f"run: {tmp_path / 'run'}" in out


def test_the_list_names_every_task_and_learner(call):
    status, out, _ = call("train", "--list")
    assert status == 0
    for id, entry in LEARNERS.items():
        assert id in out
        assert entry.section.split(",")[0] in out
    for task in ("line-2015", "taxi-single-agent", "corridor"):
        assert task in out
    status, out, _ = call("train", "--list", "--json")
    assert status == 0
    assert {one["name"] for one in out["learners"]} == set(LEARNERS)


def test_options_reach_task_and_learner(call, tmp_path):
    words = ("--set", "n_cells=4", "starts=(0,3)", "--options", "trace_decay=0.5", "n_kept=3")
    status, *_ = call(
        *("train", "corridor", "--learner", "d-rr-ql-traces", "--episodes", 20, "--tests", 2),
        *(*words, "--learning-rate", 0.5, "--discount", 0.8, "--vetoes", "none"),
        *("--epsilon", 0.7, "--epsilon-per-success", 0.01, "--out", tmp_path, "--json"),
    )
    assert status == 0
    config = json.loads((tmp_path / "config.json").read_text())
    assert config["task_options"]["n_cells"] == 4
    assert config["task_options"]["starts"] == [0, 3]
    settings = config["learner_settings"]
    assert settings["options"] == {"trace_decay": 0.5, "n_kept": 3}
    assert (settings["learning_rate"], settings["discount"]) == (0.5, 0.8)
    assert [module["kind"] for module in settings["modules"]] == ["value"]
    exploration = settings["exploration"]
    assert exploration["epsilon"] == 0.7
    assert (exploration["per_episode"], exploration["per_success"]) == (0.0, 0.01)


@pytest.mark.parametrize(
    ("task", "words", "expected"),
    [
        ("maze", (), Exploration(per_episode=2.0 / 2000)),
        ("maze", ("--episodes", "10"), Exploration(per_episode=0.2)),
        ("maze", ("--epsilon", "0.5"), Exploration(epsilon=0.5, per_episode=1.0 / 2000)),
        ("maze", ("--episodes", "1"), Exploration(per_episode=1.0)),
        ("line", (), Exploration(epsilon=0.3)),
        ("line", ("--set", "goal=(2,1)"), Exploration(per_episode=2.0 / 100_000)),
        ("line", ("--epsilon-per-episode", "0.25"), Exploration(per_episode=0.25)),
    ],
)
def test_epsilon_by_default(task, words, expected):
    args = cli.parse_arguments("train", train.Args, [task, *words])
    made = train.make_task(task, **parse_options(args.set))
    assert train._explore(args, made) == expected


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("moon",), "task is 'moon'; valid: one of line"),
        (("maze", "--learner", "moon"), "learner is 'moon'; valid: one of q-learning"),
        (("maze", "--episodes", "0"), "episodes is 0"),
        (("maze", "--moves", "0"), "moves is 0"),
        (("maze", "--tests", "0"), "tests is 0"),
        (("maze", "--seed", "-1"), "seed is -1"),
        (("maze", "--values", "moon"), "values is 'moon'; valid: one of goal, local, monolithic"),
        (("maze", "--vetoes", "moon"), "vetoes is 'moon'; valid: one of none"),
        (("maze", "--set", "moon=1"), "option of maze is 'moon'"),
        (("maze", "--set", "start"), "option is 'start'; valid: name=value"),
        (("maze", "--options", "moon=1"), "learner's option is 'moon'"),
        (("maze", "--epsilon", "2"), "epsilon is 2"),
        (("maze", "--epsilon-per-episode", "5"), "per_episode is 5"),
        (("--resume", "nowhere"), "a folder with a config.json in it"),
    ],
)
def test_mistakes(call, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    status, _, err = call("train", *words)
    assert status == cli.BAD_INPUT
    assert err.startswith("hose-mj: error: ")
    assert message in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_run_is_not_overwritten(call, tmp_path, monkeypatch):
    call(*MAZE, "--out", tmp_path / "run")
    status, _, err = call(*MAZE, "--out", tmp_path / "run")
    assert status == cli.BAD_INPUT
    assert "without a run in it" in err
    monkeypatch.chdir(tmp_path)
    names = [call(*MAZE, "--json")[1]["run"] for _ in range(2)]
    first = os.path.join("out", "train", "maze-q-learning-seed0")
    assert names == [first, f"{first}-2"]


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("a=3", 3),
        ("a=0.5", 0.5),
        ("a=(2,1)", (2, 1)),
        ("a=random", "random"),
        ("a=True", True),
        ("a=x=y", "x=y"),
        ("a=", ""),
    ],
)
def test_options_are_python_literals_or_words(word, value):
    assert parse_options([word]) == {"a": value}


def test_no_progress_bar_where_nobody_looks(capsys):
    with show_progress("work", 3) as show:
        show(3)
    captured = capsys.readouterr()
    assert captured.out == captured.err == ""
