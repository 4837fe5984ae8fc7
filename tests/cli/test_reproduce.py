import json

import pytest
from hose_learning.study import experiments
from hose_learning.study.experiments import Experiment, Finding
from hose_learning.study.jobs import Job

from hose_mj.checks import Check
from hose_mj.cli import main as cli


def list_jobs(seeds):
    return [Job(name="a", task="maze", learner="rr-q", seed=s, episodes=20) for s in seeds]


def conclude(runs, n_seeds):
    mean = sum(run["moves"] for run in runs["a"]) / n_seeds
    few, many = Check("few", mean, 1.0), Check("many", mean, 1.0, ">=")
    return [
        Finding("moves", "some", mean, (mean, mean), n_seeds, check) for check in (few, many, None)
    ]


@pytest.fixture
def tiny(monkeypatch):
    made = Experiment("a small one", "as it stands", list_jobs, conclude)
    monkeypatch.setitem(experiments.EXPERIMENTS, "tiny", made)


@pytest.mark.usefixtures("tiny")
def test_the_document_has_items_and_checks(tmp_path, capsys):
    words = ["reproduce", "tiny", "--seeds", "3", "--workers", "1", "--out", str(tmp_path)]
    assert cli.main([*words, "--json"]) == cli.CHECK_FAILED
    document = json.loads(capsys.readouterr().out)
    assert [item["verdict"] for item in document["items"]] == ["fails", "holds", "reported"]
    keys = {"item", "claim", "thesis", "ours", "interval", "n_seeds", "verdict", "reading"}
    assert all(set(item) == keys for item in document["items"])
    assert [check["ok"] for check in document["checks"]] == [False, True]
    assert len(list((tmp_path / "runs").iterdir())) == 3
    assert cli.main(words) == cli.CHECK_FAILED
    out = capsys.readouterr().out
    assert "a small one" in out
    assert "1 of 2 checks ok" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["moon"], "item is 'moon'; valid: one of fig-4.2, "),
        (["--seeds", "0"], "seeds is 0; valid: a whole number, at least 1"),
        (["--seed", "-1"], "seed is -1; valid: a whole number, at least 0"),
        (["--workers", "0"], "workers is 0; valid: a whole number, at least 1"),
    ],
)
def test_mistakes(words, message, capsys):
    assert cli.main(["reproduce", *words]) == cli.BAD_INPUT
    assert message in capsys.readouterr().err
