"""`hose-mj relevance`, `joint-policy` and `transfer`: documents, tables and exit statuses."""

from __future__ import annotations

import json

import pytest
from hose_learning import transfer as transfer_trial
from hose_learning.study import training

from hose_mj.cli import main as cli
from hose_mj.cli import transfer

SMALL = ("n_robots=1", "half_width=2", "hose_length=3")


@pytest.fixture
def uncompiled(monkeypatch):
    """Trainings in plain Python: these are so short that compiling would take longer."""

    class Plain(training.Training):
        def __init__(self, *arguments):
            super().__init__(*arguments, compiled=False)

    monkeypatch.setattr(training, "Training", Plain)
    monkeypatch.setattr(transfer_trial, "Training", Plain)


def run(capsys, *words):
    status = cli.main(list(words))
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_relevance(capsys):
    words = ("relevance", "maze", "--set", "actions=up", "--moves", "400", "--json", "--seed", "4")
    status, out, err = run(capsys, *words)
    document = json.loads(out)
    (signal,) = document["signals"]
    assert (status, document["seed"]) == (0, 4)
    assert signal["name"] == signal["event"] == "collision"
    assert signal["relevant"] == ["o_up"]
    assert signal["share_of_logs"] == {"x": 0.0, "y": 0.0, "o_up": 1.0}
    assert signal["most_common"] == {"relevant": ["o_up"], "logs": 1}
    assert 0 < signal["seen"] < 400
    assert [check["ok"] for check in document["checks"]] == [True]
    assert "1 of 1 checks ok" in err


def test_relevance_after_too_few_moves_fails_its_check(capsys):
    status, out, _ = run(capsys, "relevance", "maze", "--moves", "3", "--logs", "4")
    assert status == cli.CHECK_FAILED
    assert "collision: " in out
    assert "of 4" in out
    assert "0 of 1 checks ok" in out


def test_relevance_marks_what_matters(capsys):
    words = ("--moves", "500", "--variables", "o_up", "y", "--set", "actions=up")
    status, out, _ = run(capsys, "relevance", "maze", *words)
    rows = {line.split("│")[1].strip(): line for line in out.splitlines() if line.startswith("│")}
    assert status == 0
    assert "✓" in rows["o_up"]
    assert "✓" not in rows["y"]


def test_relevance_lists_many_signals(capsys):
    words = ("line-single-agent", "--set", "n_robots=3", "--moves", "300", "--fresh", "10")
    _, out, _ = run(capsys, "relevance", *words)
    assert "variables that matter" in out
    assert "stretch_2" in out


def test_joint_policy(capsys, uncompiled):
    words = ("joint-policy", "--episodes", "300", "--moves", "600")
    status, out, err = run(capsys, *words, "--json")
    document = json.loads(out)
    assert status == 0
    (move,) = document["joint_moves"]
    assert move["actions"] in (["right", "none"], ["none", "left"])
    assert move["events"] == ["goal", "done"]
    assert (document["reached"], document["fewest"]) == (True, 1)
    assert len(document["checks"]) == 2
    assert "2 of 2 checks ok" in err
    status, out, _ = run(capsys, *words)
    assert status == 0
    assert "goal, done" in out


def test_an_untrained_joint_policy_fails_its_check(capsys, uncompiled):
    words = ("--set", "n_cells=9", "goal=4", "starts=(0,8)", "step_limit=6")
    status, out, _ = run(capsys, "joint-policy", *words, "--episodes", "1", "--moves", "1")
    assert status == cli.CHECK_FAILED
    assert "failed" in out


def test_transfer(capsys, uncompiled):
    words = ("transfer", "line", "line", "--set", *SMALL)
    words += (
        "source.collision=robots",
        "--moves",
        "1500",
        "--configurations",
        "2",
        "--exchange",
        "1e6",
    )
    status, out, err = run(capsys, *words, "--json")
    document = json.loads(out)
    assert status == 0
    rows = {row["what"]: row for row in document["summary"]}
    assert [*rows][:3] == [f"after transfer, first in episode {k}" for k in (1, 2, 3)]
    assert rows["after transfer, in any of them"]["reached"] == 2
    for row in rows.values():
        low, high = row["interval"]
        assert 0.0 <= low <= row["reached"] / row["of"] <= high <= 1.0
    assert len(document["outcomes"]) == 2
    assert [check["ok"] for check in document["checks"]] == [True, True]
    assert "2 of 2 checks ok" in err
    status, out, _ = run(capsys, *words)
    assert status == 0
    assert "vetoes: " in out


def test_only_the_first_goal_of_a_configuration_counts():
    def make(*reached):
        return transfer_trial.TransferOutcome(("goal",), reached, 9, True, ((9, False),), 0, 0, 0)

    outcomes = [make(True, True), make(False, True), make(False, False)]
    counts = [row["reached"] for row in transfer.summarize(outcomes, (2.0,))]
    assert counts == [1, 1, 2, 3, 0]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("relevance", "maze", "--moves", "0"), "moves is 0"),
        (("relevance", "moon"), "task is 'moon'"),
        (("relevance", "maze", "--variables", "z"), "variable is 'z'"),
        (("joint-policy", "--episodes", "0"), "episodes is 0"),
        (
            ("joint-policy", "--learner", "q-learning"),
            "learner is 'q-learning'; valid: one of d-rr",
        ),
        (("joint-policy", "corridor", "--set", "goal"), "option is 'goal'"),
        (("transfer", "line", "line", "--exchange", "0"), "exchange is"),
        (("transfer", "line", "corridor"), "agents of the source"),
        (("transfer", "line", "line", "--seed", "-1"), "seed is -1"),
    ],
)
def test_bad_input(capsys, uncompiled, words, message):
    status, _, err = run(capsys, *words)
    assert status == cli.BAD_INPUT
    assert message in err
