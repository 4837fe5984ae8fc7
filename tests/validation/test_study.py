"""What a study gathers: committed runs of the cable, told apart from those that were run."""

from __future__ import annotations

import pytest

from hose_mj.validation import settings
from hose_mj.validation.cases import CASES, find_cases
from hose_mj.validation.compare import CaseResult
from hose_mj.validation.settings import has_cable
from hose_mj.validation.study import Study, read_committed_cable
from hose_mj.validation.user_hose.study import list_models


def test_the_committed_runs_are_the_cables_in_the_cases_that_it_runs():
    committed = read_committed_cable(CASES)
    runs_cable = {case.id for case in CASES if "cable" in case.models}
    assert {record["case"] for record in committed.records} <= runs_cable
    assert "released-rod" in {record["case"] for record in committed.records}
    for record in committed.records:
        assert record["model"] == "cable"
        assert record["error"] >= 0.0
        assert record["wall_s"] > 0.0
        assert record["committed"] == f"MuJoCo {committed.mujoco}"
    assert int(committed.mujoco.split(".")[0]) < 4


def test_only_the_cases_that_were_asked_for():
    (case,) = find_cases(("released-rod",))
    committed = read_committed_cable((case,))
    assert {record["case"] for record in committed.records} == {"released-rod"}
    assert [(name, n) for name, n, _ in committed.summarize()] == [
        ("released-rod", str(len(committed.records)))
    ]
    assert read_committed_cable(find_cases(("capstan",))).records == []


def test_records_say_whether_they_were_committed_only_where_some_were(make_outcome, case):
    study = Study(results=[CaseResult(case, [make_outcome()])])
    (record,) = study.list_records()
    assert "committed" not in record
    study.committed = read_committed_cable(find_cases(("released-rod",)))
    first, *rest = study.list_records()
    assert first == {**record, "committed": None}
    assert rest == study.committed.records


@pytest.mark.parametrize(("version", "there"), [("3.17.0", True), ("4.0.0", False)])
def test_from_mujoco_4_on_there_is_no_cable(monkeypatch, version, there):
    monkeypatch.setattr(settings, "version", lambda package: version)
    assert has_cable() == there
    assert ("cable" in list_models()) == there
