"""`hose-mj compare my_hose.toml`: its document, its files, its words, its errors."""

from __future__ import annotations

import json

import pytest

from hose_mj.cli import main as cli
from hose_mj.validation.user_hose.study import check_models, list_models

MINE = """
title = "My own rod"
[hose]
length = 1.0
axial_stiffness = 2e6
bending_stiffness = 0.05
linear_density = 0.1
outer_radius = 0.01
damping_time = 0.01
[[holds]]
at = "start"
kind = "clamp"
position = [0, 0, 0]
tangent = [1, 0, 0]
"""
MOTION = MINE + "[study]\nduration = 0.2\nerrors = [0.05]\nbudget = 8\n"
PNG = b"\x89PNG\r\n\x1a\n"


def run(capsys, *words):
    status = cli.main(["compare", *map(str, words)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(MINE)
    return path


def check_files(out, document, pictures):
    assert json.loads((out / "document.json").read_text(encoding="utf-8")) == document
    assert {path.stem for path in (out / "plots").iterdir()} == pictures
    assert all(path.read_bytes().startswith(PNG) for path in (out / "plots").iterdir())
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "My own rod" in page
    assert "not reached" in page or "control points" in page
    assert (out / "models.rrd").stat().st_size > 0
    assert (out / "records.csv").is_file()
    assert (out / "records.parquet").is_file()


def test_a_rest_shape(capsys, tmp_path, mine):
    out = tmp_path / "out"
    status, printed, said = run(capsys, mine, "--out", out, "--json")
    assert status == 0, said
    document = json.loads(printed)
    assert document["settings"]["my_hose"] == str(mine)
    assert {record["case"] for record in document["records"]} == {"own-hose"}
    assert {record["reference"] for record in document["records"]} == {"converged"}
    assert {record["model"] for record in document["records"]} == {"geds", "cable", "flex"}
    assert all(record["timestep"] is None for record in document["records"])
    assert document["ratios"] == document["skipped"] == []
    for answer in document["answers"]:
        assert set(answer) == {
            *("at_error", "model", "planar", "setting", "resolution", "timestep", "error"),
            "wall_s_per_sim_s",
        }
        assert answer["error"] is None or answer["error"] <= answer["at_error"]
    assert {(a["model"], a["at_error"]) for a in document["answers"]} == {
        (model, error) for model in ("geds", "cable", "flex") for error in (0.01, 0.001)
    }
    for gap in document["disagreements"]:
        assert set(gap) == {"model", "clamp_corrected", "error", "distance", "setting"}
        assert gap["distance"] == pytest.approx(gap["error"] * 1.0)
    (check,) = document["checks"]
    assert check["ok"]
    check_files(out, document, {"own-hose", "own-hose-shapes"})


def test_a_motion(capsys, tmp_path, mine):
    mine.write_text(MOTION)
    out = tmp_path / "out"
    status, printed, said = run(capsys, mine, "--out", out, "--json")
    assert status == 0, said
    document = json.loads(printed)
    assert all(record["wall_s_per_sim_s"] > 0.0 for record in document["records"])
    reached = [answer for answer in document["answers"] if answer["error"] is not None]
    assert {answer["model"] for answer in reached} >= {"geds"}
    assert {ratio["at_error"] for ratio in document["ratios"]} <= {0.05}
    names = {"own-hose-shapes", "own-hose-work-precision", "own-hose-distance"}
    check_files(out, document, names)


def test_what_it_says(capsys, tmp_path, mine):
    status, printed, said = run(capsys, mine, "--out", tmp_path / "out", "--models", "geds")
    assert (status, said) == (0, "")
    words = " ".join(printed.split())
    assert "My own rod" in words
    assert "Truth is GEDS, refined until it stood still within" in words
    assert "GEDS: at its finest it stays within" in words
    assert "cheapest setting within a wanted error" in words
    assert "1 of 1 checks ok" in words
    assert "cable" not in words


def test_an_example_by_its_name(capsys, tmp_path):
    status, printed, _ = run(
        capsys, "usb_cable", "--models", "geds", "--json", "--out", tmp_path / "out"
    )
    assert status == 0
    assert json.loads(printed)["settings"]["my_hose"] == "usb_cable"


def test_models_of_a_users_hose():
    every = list_models()
    assert every[:2] == ("geds", "cable")
    assert "hinge-chain" not in every
    assert check_models(("cable", "cable")) == ("cable",)


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--cases", "tip-load"], "cases is ('tip-load',); valid: none beside a hose of your own"),
        (["--models", "hinge-chain"], "model is 'hinge-chain'; valid: for a hose of your own geds"),
        (["--models"], "models is (); valid: one or more of geds"),
        (["--seed", "-1"], "seed is -1; valid: "),
    ],
)
def test_bad_arguments(capsys, tmp_path, mine, words, what):
    out = tmp_path / "out"
    status, printed, said = run(capsys, mine, *words, "--out", out)
    assert (status, printed) == (2, "")
    assert said.startswith(f"hose-mj: error: {what}")
    assert said.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (MINE.replace("1.0", "'1 m'"), "mine.toml: hose.length is '1 m'; valid: a number"),
        (MINE + "[study]\nduration = 1\n[flour]\n", "mine.toml: flour is {}; valid: a key among"),
        ("no toml", "file is "),
    ],
)
def test_a_mistake_in_the_file_is_one_line(capsys, tmp_path, mine, text, what):
    mine.write_text(text)
    status, printed, said = run(capsys, mine, "--out", tmp_path / "out")
    assert (status, printed) == (2, "")
    assert said.startswith(f"hose-mj: error: {what}")
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_no_such_file(capsys, tmp_path):
    status, _, said = run(capsys, "nothing.toml", "--out", tmp_path / "out")
    assert status == 2
    assert "my_hose is 'nothing.toml'; valid: a TOML file, or an example: fire_hose, " in said
    assert said.count("\n") == 1
