import json

import pytest
from hose_learning.mdp.partially_constrained import PAIRS

from hose_mj.cli import main as cli


def ask(capsys, *words):
    status = cli.main(["check-pcm", "--json", *words])
    return status, json.loads(capsys.readouterr().out)


def test_the_document_of_a_pcm_and_its_picture(capsys, tmp_path):
    status, document = ask(capsys, "--example", "hose-passes", "--out", str(tmp_path))
    assert status == 0
    assert document["is_pcm"]
    assert document["violations"] == []
    assert len(document["checks"]) == 6
    assert set(document["propositions"]) == {
        *("unsafe_in_source", "excess", "shortfall", "shortfall_state"),
    }
    assert (tmp_path / "pcm.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_the_document_of_a_pair_that_is_none(capsys, tmp_path):
    options = ["n_robots=2", "half_width=3", "hose_length=4", "goal=(3,0)", "start=((2,0),(1,0))"]
    words = ("line", "line", "--out", str(tmp_path), "--set", *options)
    status, document = ask(capsys, *words, "target.move_rule=cancelling")
    assert status == 1
    assert not document["is_pcm"]
    assert document["propositions"] is None
    (violation,) = document["violations"]
    assert violation["property"] == 2
    assert violation["action"] in ("up", "down", "left", "right")
    assert violation["source"] != violation["target"]
    assert [check["ok"] for check in document["checks"]] == [True, False, True, True]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", PAIRS)
def test_every_example_says_in_words_what_it_violates(capsys, name):
    assert cli.main(["check-pcm", "--example", name]) == (1 if PAIRS[name].violated else 0)
    out = capsys.readouterr().out
    for number in PAIRS[name].violated:
        assert f"property {number} (" in out
    assert ("not a PCM" in out) == bool(PAIRS[name].violated)


def test_the_list(capsys):
    assert cli.main(["check-pcm", "--list"]) == 0
    out = capsys.readouterr().out
    status, document = ask(capsys, "--list")
    assert status == 0
    assert [pair["name"] for pair in document["pairs"]] == list(PAIRS)
    assert all(name in out for name in PAIRS)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["line"], "tasks is ('line', None)"),
        ([], "tasks"),
        (["--example", "nonsense"], "example is 'nonsense'"),
        (["line", "line", "--example", "wide-floor"], "an example without tasks"),
        (["line", "nonsense"], "task is 'nonsense'"),
        (["line", "line", "--set", "colour=red"], "option of line is 'colour'"),
        (["maze", "maze", "--discount", "1"], "discount is 1.0"),
        (["maze", "maze", "--seed", "-1"], "seed is -1"),
        (["line", "line", "--limit", "9"], "at most 9 states"),
    ],
)
def test_wrong_arguments(capsys, words, named):
    assert cli.main(["check-pcm", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert named in captured.err
