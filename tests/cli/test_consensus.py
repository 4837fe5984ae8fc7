import json

import pytest

from hose_mj.cli import main as cli

FIELDS = {
    *("loss", "first_spread", "agreed_spread", "disagreement", "exact_disagreement", "actions"),
    *("disorder", "overlaps", "longest_safe_action", "turns_per_time"),
}


def test_the_document_and_the_picture(capsys, tmp_path):
    words = ["consensus", "--json", "--seed", "3", "--loss", "0.3", "--out", str(tmp_path)]
    assert cli.main(words) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["seed"] == 3
    assert [record["loss"] for record in document["records"]] == [0.0, 0.1, 0.3, 0.5]
    assert all(set(record) == FIELDS for record in document["records"])
    assert len(document["checks"]) == 20
    assert all(check["ok"] for check in document["checks"])
    assert (tmp_path / "consensus.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_actions_as_long_as_a_turn_fail_their_checks(capsys, tmp_path):
    words = ["consensus", "--action-time", "1", "--drift", "0.2", "--out", str(tmp_path)]
    assert cli.main(words) == 1
    out = capsys.readouterr().out
    assert "failed" in out
    assert "50%" in out


def test_clocks_that_skip_turns_fail_their_checks(capsys, tmp_path):
    coarse = ["--rounds", "1", "--turns", "1", "--drift", "0.5", "--delay", "10"]
    assert cli.main(["consensus", *coarse, "--out", str(tmp_path), "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert 0 in [record["actions"] for record in document["records"]]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--loss", "1"], "loss is 1.0"),
        (["--seed", "-1"], "seed is -1"),
        (["--agents", "1"], "n_a"),
    ],
)
def test_wrong_arguments(capsys, tmp_path, words, named):
    assert cli.main(["consensus", *words, "--out", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert named in captured.err
    assert not list(tmp_path.iterdir())
