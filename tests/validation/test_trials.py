"""What trials promise, their closed forms, and how `compare` runs and shows them."""

import json
import math

import numpy as np
import pytest

from hose_mj.checks import Check
from hose_mj.cli import main as cli
from hose_mj.errors import InputError
from hose_mj.validation import cases, ropes
from hose_mj.validation.cases import TRIALS, find_cases, find_trials
from hose_mj.validation.trial import Findings, LinePlot, Trial


@pytest.mark.slow
@pytest.mark.parametrize("trial", TRIALS, ids=lambda trial: trial.id)
def test_every_check_of_a_trial_holds(trial):
    found = trial.measure(True, np.random.default_rng(0))
    assert [check.name for check in found.checks if not check.ok] == []
    assert trial.about.endswith(".")
    assert found.plots


def test_a_wire_at_rest_hangs_in_the_elastic_catenary():
    (pull, weight), curve = ropes.find_catenary()
    hose, robot = ropes.hang_wire(32, 0.005)
    s = np.linspace(0.0, 3.0, 31)
    assert np.linalg.norm(hose.position(s) - curve(s), axis=1).max() < 3e-3 * 3.0
    np.testing.assert_allclose(hose.reaction(robot).force, [pull, 0, weight], atol=0.02 * weight)


def test_a_rope_whirls_in_its_shape_and_lags_by_second_order():
    lags = []
    for dt in (0.005, 0.0025):
        _, off, bulge, force, gain = ropes.whirl(32, dt, 1)
        assert bulge.max() < 3e-4
        assert force == pytest.approx(1.0, abs=5e-3)
        assert gain < 1e-4
        lags.append(off[-1])
    assert math.log2(lags[0] / lags[1]) == pytest.approx(2.0, abs=0.2)


def test_ids_of_trials_select_them_and_no_case():
    assert find_trials(()) == TRIALS
    assert [one.id for one in find_trials(("post-pull", "tip-load-1"))] == ["post-pull"]
    assert [one.id for one in find_cases(("post-pull", "tip-load-1"))] == ["tip-load-1"]
    assert find_cases(("post-pull",)) == ()
    with pytest.raises(InputError, match=r"slack-wire.*or one with its parameter"):
        find_cases(("slack-wir",))


@pytest.fixture
def short(monkeypatch):
    """A trial that is over at once, by the words of another; one of its two checks fails."""

    def measure(is_quick, rng):
        checks = [Check("held", 1.0, 2.0), Check(f"broken, {rng.integers(9)}", 3.0, 2.0)]
        plot = LinePlot("Sink", "sink", {"20 N": ([1, 2], [3, 4])}, {"limit": 5}, "mm", True)
        return Findings(checks, {"post-pull": plot})

    monkeypatch.setattr(cases, "TRIALS", (Trial("post-pull", measure),))


def test_a_trial_is_in_document_report_and_status(short, capsys, tmp_path):
    words = ["compare", "--cases", "post-pull", "--quick", "--json", "--out", str(tmp_path)]
    assert cli.main(words) == 1
    document = json.loads(capsys.readouterr().out)
    names = [check["name"] for check in document["checks"]]
    assert names == [
        "post-pull: held",
        f"post-pull: broken, {np.random.default_rng(0).integers(9)}",
    ]
    assert [check["ok"] for check in document["checks"]] == [True, False]
    assert document["records"] == document["health"] == []
    assert (tmp_path / "plots" / "post-pull.png").stat().st_size > 5_000
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Hard cases" in page
    assert "round posts and an edge" in page


def test_trials_are_of_geds(short, capsys):
    assert cli.main(["compare", "--cases", "post-pull", "--models", "cable", "--json"]) == 2
    assert "for these cases one of geds" in capsys.readouterr().err
