"""`hose-mj warm`: runs a little of everything, and says what was compiled."""

from __future__ import annotations

import json

import pytest

from hose_mj.cli import warm
from hose_mj.cli.main import main


@pytest.fixture
def jobs(monkeypatch):
    done = []
    monkeypatch.setattr(
        warm, "GROUPS", {"hose": lambda: {"a": lambda: done.append("a")}, "world": dict}
    )
    return done


def test_the_document(jobs, capsys):
    assert main(["warm", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    (record,) = document["records"]
    assert record["name"] == "hose: a"
    assert (record["compiled"], document["compiled"]) == (0, 0)
    assert record["wall_s"] >= 0.0
    assert jobs == ["a"]


def test_in_the_terminal(jobs, capsys):
    assert main(["warm", "hose"]) == 0
    assert capsys.readouterr().out.startswith("0 kernels compiled, ")


def test_an_unknown_group(capsys):
    assert main(["warm", "hoses"]) == 2
    assert "(did you mean hose?)" in capsys.readouterr().err


def test_every_kind_of_hose_task_and_learner_has_a_job():
    assert len(warm.list_hose_jobs()) == 10
    assert {"floor_1", "lift"} <= set(warm.list_world_jobs())
    jobs = warm.list_learn_jobs()
    assert {"task line", "task maze", "learner d-rr-ql", "learner q-learning"} <= set(jobs)
