import json

import pytest

from hose_mj.cli import main as cli


def test_the_document_of_a_realization(capsys):
    words = ["check-sequential", "corridor", "--set", "goal_ends=move", "--json"]
    assert cli.main(words) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["violations"] == []
    assert (document["n_states"], document["n_moves"]) == (1, 6)
    assert [check["ok"] for check in document["checks"]] == [True, True, True]


def test_the_document_of_what_is_none(capsys):
    assert cli.main(["check-sequential", "corridor", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    (violation,) = document["violations"]
    assert violation["number"] == 3
    assert violation["alone"] != violation["jointly"]
    assert [check["ok"] for check in document["checks"]] == [True, True, False]


def test_the_words(capsys):
    assert cli.main(["check-sequential", "corridor"]) == 1
    out = capsys.readouterr().out
    assert "property 3 (the episode ends alike)" in out
    assert "robot_0: right" in out
    assert "not a sequential realization" in out


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["taxi"], "idle action is 'none'"),
        (["maze"], "task is 'maze'"),
        (["corridor", "--seed", "-1"], "seed is -1"),
        (["corridor", "--set", "goal"], "option is 'goal'"),
    ],
)
def test_wrong_arguments(capsys, words, named):
    assert cli.main(["check-sequential", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert named in captured.err
