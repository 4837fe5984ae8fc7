"""`hose-mj compare`: its document, its files, its exit statuses, with and without GEDS."""

from __future__ import annotations

import csv
import json
import math

import numpy as np
import pyarrow.parquet
import pytest

from hose_mj import extras
from hose_mj.assets import find_asset
from hose_mj.checks import Check
from hose_mj.cli import main as cli
from hose_mj.cli.compare import MODELS, Args, check_arguments
from hose_mj.recording.document import make_document
from hose_mj.validation import settings
from hose_mj.validation import study as compare_study
from hose_mj.validation.case import Reference
from hose_mj.validation.cases import CASES, find_cases
from hose_mj.validation.compare import CaseResult
from hose_mj.validation.report.page import write_all
from hose_mj.validation.run import RunResult
from hose_mj.validation.settings import Setting

RECORD = {
    *("case", "model", "scheme", "resolution", "timestep", "error", "reference"),
    *("clamp_corrected", "wall_s_per_sim_s", "wall_s", "fallbacks"),
}
RATIO = {
    *("case", "at_error", "model", "against", "planar", "wall_ratio"),
    *("model_setting", "against_setting"),
}
MARKS = (None, f"MuJoCo {json.loads(find_asset('compare/cable.json').read_text())['mujoco']}")
PNG = b"\x89PNG\r\n\x1a\n"


def run(capsys, *words):
    status = cli.main(["compare", "--quick", *map(str, words)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def check_records(records):
    ids = {case.id for case in CASES}
    for record in records:
        assert set(record) == RECORD
        assert record["case"] in ids
        assert record["model"] in MODELS
        assert isinstance(record["resolution"], int)
        assert record["error"] is not None
        assert 0.0 <= record["error"] < math.inf
        assert record["reference"] in ("closed form", "converged")
        assert (record["timestep"] is None) == (record["wall_s_per_sim_s"] is None)
        assert record["wall_s"] > 0.0
        assert record["fallbacks"] >= 0
        if record["model"] == "geds":
            assert record["clamp_corrected"] is None


def test_one_static_case_as_a_document_with_its_files(capsys, tmp_path):
    out = tmp_path / "new" / "folder"
    status, printed, said = run(
        capsys, "--cases", "tip-load-1", "--models", "geds", "--json", "--out", out
    )
    assert status == 0, said
    document = json.loads(printed)
    assert list(document) == [
        *("command", "version", "revision", "machine", "seed", "settings", "checks"),
        *("records", "ratios", "skipped", "health"),
    ]
    assert document["command"] == "compare"
    assert document["seed"] == 0
    assert document["settings"] == {
        "my_hose": None,
        "cases": ["tip-load-1"],
        "models": ["geds"],
        "out": str(out),
        "quick": True,
    }
    check_records(document["records"])
    assert [record["resolution"] for record in document["records"]] == [8, 12, 20]
    assert {record["case"] for record in document["records"]} == {"tip-load-1"}
    assert document["ratios"] == []
    assert document["skipped"] == []
    (check,) = document["checks"]
    assert {"name", "value", "limit", "ok"} <= set(check)
    assert check["ok"]
    assert "tip-load-1" in check["name"]
    assert check["value"] == min(record["error"] for record in document["records"])
    # What stderr says is for people: how it went, and where the report is.
    assert "1 of 1 checks ok" in said
    assert str(out / "report.html") in said
    check_files(out, document)


def check_files(out, document):
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html")
    assert "tip-load-1" in page
    assert json.loads((out / "document.json").read_text(encoding="utf-8")) == document
    with open(out / "records.csv", encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert [row["case"] for row in rows] == [r["case"] for r in document["records"]]
    assert [float(row["error"]) for row in rows] == [r["error"] for r in document["records"]]
    table = pyarrow.parquet.read_table(out / "records.parquet")
    assert table.to_pylist() == document["records"]
    pictures = list((out / "plots").glob("*.png"))
    assert pictures
    for picture in pictures:
        assert picture.read_bytes().startswith(PNG)
    assert not (out / "models.rrd").exists()


def test_without_json_a_table_and_where_the_report_is(capsys, tmp_path):
    status, printed, said = run(
        capsys, "--cases", "tip-load-1", "--models", "geds", "--out", tmp_path
    )
    assert status == 0
    assert said == ""
    assert "Checks" in printed
    assert "Wall time at equal error" not in printed
    assert "1 of 1 checks ok" in printed
    assert (tmp_path / "report.html").is_file()


def test_without_geds_there_is_nothing_to_check(capsys, tmp_path):
    status, printed, _ = run(
        capsys, "--cases", "tip-load-1", "--models", "hinge-chain", "--json", "--out", tmp_path
    )
    assert status == 0
    document = json.loads(printed)
    check_records(document["records"])
    assert {record["model"] for record in document["records"]} == {"hinge-chain"}
    assert {record["clamp_corrected"] for record in document["records"]} == {True, False}
    assert document["checks"] == document["ratios"] == []
    assert (tmp_path / "report.html").is_file()


def test_a_failed_check_is_exit_status_1(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(compare_study, "check_statics", lambda results: [Check("made up", 2.0, 1)])
    status, printed, said = run(
        capsys, "--cases", "tip-load-1", "--models", "geds", "--json", "--out", tmp_path
    )
    assert status == 1
    assert json.loads(printed)["checks"][0]["ok"] is False
    assert "0 of 1 checks ok" in said
    assert (tmp_path / "report.html").is_file()


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--cases", "tip-load-1", "nonsense"], "case is 'nonsense'; valid: heavy-cantilever, "),
        (["--models", "geds", "flux"], "model is 'flux'; valid: geds, cable, flex, hinge-chain"),
        (["--models"], "models is (); valid: "),
        (["--cases", "taut-pull-suture", "--models", "cable"], "models is ('cable',); valid: "),
        (["--seed", "-1"], "seed is -1; valid: "),
    ],
)
@pytest.mark.parametrize("json_too", [False, True])
def test_bad_input_is_one_line_and_exit_status_2(capsys, tmp_path, words, what, json_too):
    out = tmp_path / "out"
    extra = ["--json"] if json_too else []
    status, printed, said = run(capsys, *words, *extra, "--out", out)
    assert status == 2
    assert printed == ""
    assert said.startswith(f"hose-mj: error: {what}")
    assert said.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize("below", [False, True])
def test_a_file_where_the_folder_should_be(capsys, tmp_path, below):
    file = tmp_path / "file"
    file.write_text("mine")
    out = file / "deeper" if below else file
    status, printed, said = run(capsys, "--cases", "tip-load-1", "--out", out)
    assert status == 2
    assert printed == ""
    assert said.startswith(f"hose-mj: error: out is '{out}'; valid: a folder")
    assert said.count("\n") == 1
    assert file.read_text() == "mine"


def test_only_the_cases_that_a_chosen_model_runs(tmp_path):
    wanted = Args(cases=("taut-pull",), models=("hinge-chain",), out=tmp_path)
    assert [case.id for case in check_arguments(wanted)] == ["taut-pull-hose"]
    every = Args(models=("geds",), out=tmp_path)
    assert check_arguments(every) == CASES


@pytest.fixture
def mujoco_4(monkeypatch):
    """A MuJoCo without the composite cable."""
    monkeypatch.setattr(settings, "version", lambda package: "4.0.0")


def test_without_the_cable_its_committed_runs_stand_beside_the_rest(capsys, tmp_path, mujoco_4):
    words = ("--cases", "tip-load-1", "--out", tmp_path)
    status, printed, _ = run(capsys, *words, "--json")
    assert status == 0
    document = json.loads(printed)
    records = {mark: [r for r in document["records"] if r["committed"] == mark] for mark in MARKS}
    assert {record["model"] for record in records[None]} == {"geds", "flex", "hinge-chain"}
    committed = records[MARKS[1]]
    assert {record["model"] for record in committed} == {"cable"}
    assert len(records[None]) + len(committed) == len(document["records"])
    assert document["ratios"] == []
    check_records([{k: r[k] for k in RECORD} for r in document["records"]])
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "MuJoCo&#x27;s cable, as committed" in page or "MuJoCo's cable, as committed" in page


def test_the_cable_where_there_is_none_is_one_line(capsys, tmp_path, mujoco_4):
    status, printed, said = run(capsys, "--cases", "tip-load-1", "--models", "cable")
    assert (status, printed) == (2, "")
    assert said.startswith("hose-mj: error: model is 'cable'; valid: geds, flex, hinge-chain with")
    assert said.count("\n") == 1


def test_without_the_extras_of_the_report_json_alone_runs(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(extras, "find_missing", lambda extra: ["matplotlib"])
    monkeypatch.chdir(tmp_path)
    words = ("--cases", "tip-load-1", "--models", "geds")
    status, printed, said = run(capsys, *words)
    assert (status, printed) == (2, "")
    assert "pip install 'hose-mj[report,viewer]'" in said
    assert said.count("\n") == 1
    status, printed, said = run(capsys, *words, "--json")
    assert status == 0
    assert json.loads(printed)["records"]
    assert "report: none" in said
    assert list(tmp_path.iterdir()) == []


def make_motion(models):
    """A study of one motion with made-up runs of these models."""
    (case,) = find_cases(("released-rod",))
    times = np.linspace(0.0, 1.0, 51)
    still = np.linspace([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 41)
    points = np.tile(still, (51, 1, 1))
    outcomes = [
        RunResult(
            *(case.id, Setting(model, scheme, n, clamp, step), error, "converged", wall, 1.0, 0),
            *(times, points + np.array([0.0, 0.0, error]), np.tile([1.0, 0.0, error], (51, 1))),
        )
        for model, scheme, clamp in (
            ("geds", "bdf2", None),
            ("geds", "bdf2, planar", None),
            ("cable", "euler", True),
            ("flex", "discrete", True),
            ("hinge-chain", "rk4", True),
            ("hinge-chain", "rk4", False),
        )
        if model in models
        for n, step, error, wall in ((10, 0.002, 0.02, 0.01), (20, 0.001, 0.005, 0.1))
    ]
    reference = Reference(np.tile([1.0, 0.0, 0.0], (51, 1)), 1e-6)
    result = CaseResult(case, outcomes)
    result.stretchable = reference if "geds" in models else None
    result.inextensible = None if models == ("geds",) else reference
    return compare_study.Study(results=[result], quick=True)


@pytest.mark.parametrize(
    "models", [(), ("geds",), ("hinge-chain",), ("cable", "hinge-chain"), MODELS]
)
def test_pictures_recording_and_report_of_any_choice_of_models(tmp_path, models):
    study = make_motion(models)
    records = [outcome.to_record() for outcome in study.outcomes]
    settings = {"models": models, "out": tmp_path}
    document = make_document("compare", settings, seed=0, results={"records": records})
    assert write_all(study, document, tmp_path) == tmp_path / "report.html"
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Released rod" in page
    assert (tmp_path / "models.rrd").exists() == bool(models)
    assert bool(list(tmp_path.glob("plots/*.png"))) == bool(models)


@pytest.mark.slow
def test_a_motion_of_two_models(capsys, tmp_path):
    status, printed, said = run(
        capsys,
        *("--cases", "released-rod", "--models", "geds", "hinge-chain", "--json"),
        *("--out", tmp_path),
    )
    document = json.loads(printed)
    # Ratios of wall times depend on the machine; everything else must hold.
    failed = [c["name"] for c in document["checks"] if not c["ok"] and "wall" not in c["name"]]
    assert not failed
    assert status in (0, 1), said
    check_records(document["records"])
    assert {record["reference"] for record in document["records"]} == {"converged"}
    ratios = document["ratios"]
    assert ratios
    assert {(ratio["at_error"], ratio["planar"]) for ratio in ratios} >= {
        *((0.01, False), (0.01, True))
    }
    for ratio in ratios:
        assert set(ratio) == RATIO
        assert (ratio["case"], ratio["model"]) == ("released-rod", "geds")
        assert ratio["against"] == "hinge-chain"
        assert ratio["wall_ratio"] > 0.0
        assert ratio["model_setting"].endswith("planar") == ratio["planar"]
    for item in document["skipped"]:
        assert set(item) == {"case", "setting", "why"}
    assert (tmp_path / "models.rrd").stat().st_size > 0
