"""The comparison of breaks between hose models: the same moves, and what counts as agreement."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hose_mj.cli import check_breaks
from hose_mj.cli import main as cli
from hose_mj.hoses.registry import MODELS
from hose_mj.rollout.break_sequences import Ending, draw_sequences
from hose_mj.world.geds_world import GedsWorld
from hose_mj.world.registry import WORLDS

STRETCH = Ending("stretch", 3, 0, (1, 2), "segment 0 ...", ())


class Brittle(GedsWorld):
    """Tensions are twice as large: it breaks by stretch earlier, and by nothing else."""

    def tension(self, arc_length):
        return 2.0 * super().tension(arc_length)


@pytest.fixture
def models(monkeypatch):
    for name, place in (("twin", WORLDS["geds"]), ("brittle", f"{__name__}:Brittle")):
        monkeypatch.setitem(MODELS, name, MODELS["geds"])
        monkeypatch.setitem(WORLDS, name, place)


def ask(capsys, *words):
    """With the world's own control points, so that geds is its twin."""
    status = cli.main(["check-breaks", "--json", "--control-points", "16", *words])
    return status, json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("change", "agrees"),
    [
        ({"text": "other words", "turn": 4, "least": ({"stretch": 1.0},)}, True),
        ({"kind": "run-over"}, False),
        ({"robot": 1}, False),
        ({"cell": (1, 1)}, False),
    ],
)
def test_agreement_is_kind_robot_and_cell(change, agrees):
    other = replace(STRETCH, **change)
    assert STRETCH.agrees(other) == other.agrees(STRETCH) == agrees


def test_moves_are_the_same_for_a_seed_and_go_on_as_before():
    sequences = draw_sequences(0, 50, 40, 3)
    assert sequences == draw_sequences(0, 50, 40, 3)
    assert sequences != draw_sequences(1, 50, 40, 3)
    assert draw_sequences(0, 60, 40, 3)[:50] == sequences
    assert [len(moves) for moves in sequences] == [40] * 50
    again = [
        moves[k][1] == next(m for m in reversed(moves[:k]) if m[0] == moves[k][0])[1]
        for moves in sequences
        for k in range(10, 40)
        if any(robot == moves[k][0] for robot, _ in moves[:k])
    ]
    # Kept, or drawn anew and the same by chance: 0.7 + 0.3 / 4.
    assert np.mean(again) == pytest.approx(0.775, abs=4 * np.sqrt(0.775 * 0.225 / len(again)))


def test_two_models_are_compared_by_shares():
    moves = [[(0, "up")] * 4] * 4
    least = ({"stretch": 5.0}, {"stretch": 4.0}, {"stretch": 3.0}, {"stretch": -0.1})
    first = replace(STRETCH, least=least)
    none = Ending("none", 3, None, None, "nothing broke", (*least[:3], {"stretch": 0.2}))
    earlier = Ending("stretch", 1, 0, (1, 1), "", ({"stretch": 5.0}, {"stretch": -0.3}))
    pair = check_breaks.compare_models(
        ("a", "b"), ([first, first, none, first], [first, none, none, earlier]), moves
    )
    assert (pair["first"], pair["second"], pair["sequences"]) == ("a", "b", 4)
    assert pair["same_kind"] == pytest.approx(0.75)
    assert pair["same_cell"] == pytest.approx(0.5)
    nothing, early = pair["disagreements"]
    assert (nothing["number"], early["number"]) == (1, 3)
    assert nothing["moves"] == ["0 up"] * 4
    assert nothing["a"]["margins"] == [{"turn": 3, "stretch": -0.1}]
    assert nothing["b"]["margins"] == [{"turn": 3, "stretch": 0.2}]
    assert early["a"]["margins"] == [{"turn": 1, "stretch": 4.0}, {"turn": 3, "stretch": -0.1}]
    assert early["b"]["margins"] == [{"turn": 1, "stretch": -0.3}]


def test_a_model_agrees_with_itself(capsys, models):
    words = ("--sequences", "3", "--moves", "6", "--models", "geds", "twin")
    status, document = ask(capsys, "floor_2", *words)
    assert status == 0
    (pair,) = document["pairs"]
    assert (pair["same_kind"], pair["same_cell"], pair["disagreements"]) == (1.0, 1.0, [])
    assert [check["value"] for check in document["checks"]] == [1.0]
    assert document["kinds"]["geds"] == document["kinds"]["twin"]
    assert set(document["health"]) == {"geds", "twin"}
    assert document["health"]["twin"] == {"sequences": 0, "warnings": []}


def test_a_model_that_differs_is_told_from_it(capsys, models):
    words = ("--sequences", "4", "--moves", "12", "--models", "geds", "brittle")
    status, document = ask(capsys, "floor_2", *words, "--max-tension", "0.5")
    assert status == 1
    (pair,) = document["pairs"]
    assert pair["disagreements"]
    assert pair["same_cell"] == pytest.approx(1.0 - len(pair["disagreements"]) / 4)
    for record in pair["disagreements"]:
        found = record["brittle"]
        assert found["kind"] == "stretch"
        margins = {one["turn"]: one["stretch"] for one in found["margins"]}
        assert margins[found["turn"]] < 0.0


def test_a_run_goes_on_from_what_is_kept(capsys, models, tmp_path):
    words = ("floor_2", "--moves", "6", "--models", "geds", "twin", "--out", str(tmp_path))
    ask(capsys, *words, "--sequences", "1")
    kept = json.loads((tmp_path / "geds.json").read_text())
    kept["endings"][0]["text"] = "kept"
    kept["endings"][0]["kind"] = "bounds"
    kept["endings"][0]["warnings"] = ["a hold moves"]
    (tmp_path / "geds.json").write_text(json.dumps(kept))
    status, document = ask(capsys, *words, "--sequences", "2")
    assert status == 1
    (record,) = document["pairs"][0]["disagreements"]
    assert (record["number"], record["geds"]["text"]) == (0, "kept")
    assert document["health"]["geds"] == {"sequences": 1, "warnings": ["a hold moves"]}
    assert len(json.loads((tmp_path / "twin.json").read_text())["endings"]) == 2
    assert cli.main(["check-breaks", *words, "--control-points", "17"]) == 2
    assert "geds.json" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ("--models", "geds", "rope"),
        ("--models", "geds"),
        ("--models", "geds", "geds"),
        ("--sequences", "0"),
        ("--moves", "0"),
        ("--seed", "-1"),
    ],
)
def test_mistakes_are_named(capsys, words):
    assert cli.main(["check-breaks", *words]) == 2
    assert words[0].strip("-") in capsys.readouterr().err
