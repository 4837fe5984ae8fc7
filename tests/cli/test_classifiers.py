"""`hose-mj classifiers`: its document, its files, its tables and its refusals."""

from __future__ import annotations

import io
import json

import matplotlib.image
import numpy as np
import pytest
from hose_learning.prediction import offline

from hose_mj.checks import Check
from hose_mj.cli import main as cli

SHORT = ["--cycles", "120", "--repeats", "1", "--folds", "2", "--logs", "2"]
RECORD = {
    *("agent", "classifier", "measure", "value", "deviation", "interval"),
    *("logs_mean", "logs_deviation", "thesis", "doubtful"),
}


def test_the_document_and_the_files(capsys, tmp_path):
    out = tmp_path / "out"
    assert cli.main(["classifiers", *SHORT, "--json", "--seed", "3", "--out", str(out)]) == 0
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert document["command"] == "classifiers"
    assert document["seed"] == 3
    assert document["checks"] == []  # not the table's number of cycles
    assert all(set(record) == RECORD for record in document["records"])
    assert [entry["moves"] for entry in document["log"]] == [120, 120]
    assert json.loads((out / "document.json").read_text()) == document
    with np.load(out / "experience.npz", allow_pickle=False) as log:
        undesired = (log["events"] & log["violations"]) != 0
        shares = [float(undesired[log["agents"] == agent].mean()) for agent in range(2)]
    assert [entry["undesired_share"] for entry in document["log"]] == shares
    assert len((out / "records.csv").read_text().splitlines()) == 1 + len(document["records"])
    png = matplotlib.image.imread(io.BytesIO((out / "classifiers.png").read_bytes()))
    assert png.shape[1] > png.shape[0] > 500


def test_the_tables_and_a_failed_check(capsys, monkeypatch):
    checks = [Check("a claim", 0.4, 0.5, ">="), Check("another", 1.0, 0.5, ">=")]
    monkeypatch.setattr(offline, "list_checks", lambda study: checks)
    assert cli.main(["classifiers", *SHORT]) == cli.CHECK_FAILED
    shown = capsys.readouterr().out
    for text in ("taxi_0", "taxi_1", "C4.5 Tree*", "thesis ?", "Cobweb: Birch", "a claim"):
        assert text in shown
    assert "…" not in shown
    assert "1 of 2 checks ok" in shown
    assert max(map(len, shown.splitlines())) <= 80


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["moon"], "task is 'moon'"),
        (["taxi", "--seed", "-1"], "seed is -1"),
        (["taxi", "--folds", "1"], "folds is 1"),
        (["taxi", "--cycles", "0"], "cycles is 0"),
        (["corridor", "--cycles", "4"], "folds is 10"),
    ],
)
def test_bad_input(capsys, words, message):
    assert cli.main(["classifiers", *words]) == cli.BAD_INPUT
    assert message in capsys.readouterr().err
