"""`hose-mj curves`: what is measured, how it is binned, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hose_learning.learners import catalog

from hose_mj.cli import learning_curves, train
from hose_mj.cli.learning_curves import Args, check_arguments, make_panel, measure
from hose_mj.cli.main import main

FEW = ("--episodes", "40", "--bins", "4", "--seeds", "2")


def test_it_draws_a_picture_and_prints_the_numbers_in_it(tmp_path, capsys):
    out = tmp_path / "new" / "curves.png"
    words = ["curves", "maze", "--learners", "q-learning", "safe-msav", *FEW]
    assert main([*words, "--measures", "success", "moves", "--save", str(out), "--json"]) == 0
    assert out.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    document = json.loads(capsys.readouterr().out)
    assert document["command"] == "curves"
    assert document["picture"] == str(out)
    lines = {(c["measure"], c["learner"]): c for c in document["curves"]}
    assert set(lines) == {
        (m, id) for m in ("success", "moves") for id in ("q-learning", "safe-msav")
    }
    for line in lines.values():
        assert line["episodes"] == [10.0, 20.0, 30.0, 40.0]
        assert len(line["mean"]) == len(line["low"]) == len(line["high"]) == 4
        assert all(
            low <= mean <= high
            for low, mean, high in zip(line["low"], line["mean"], line["high"], strict=True)
        )


def test_a_curve_is_of_the_episodes_that_train_would_see():
    args = Args(task="maze", measures=("return", "moves"), episodes=40, bins=4, epsilon=0.5)
    training = train.make_training(
        train.Args(task="maze", learner="d-rr-ql", episodes=40, epsilon=0.5, seed=3)
    )
    ended = training.advance(episodes=40)
    measured = measure(args, "d-rr-ql", 3)
    np.testing.assert_allclose(measured["return"], ended.returns.reshape(4, 10).mean(axis=1))
    np.testing.assert_allclose(measured["moves"], ended.moves.reshape(4, 10).mean(axis=1))


def test_a_band_goes_from_the_lowest_seed_to_the_highest():
    runs = [{"moves": np.array([1.0, 6.0])}, {"moves": np.array([3.0, 2.0])}]
    curve = make_panel("moves", np.array([5.0, 10.0]), {"d-rr-ql": runs}).curves["d-rr-ql"]
    assert curve.middle.tolist() == [2.0, 4.0]
    assert curve.low.tolist() == [1.0, 2.0]
    assert curve.high.tolist() == [3.0, 6.0]


def test_every_setting_reaches_the_training(monkeypatch):
    seen = []

    def remember(args):
        seen.append(args)
        return train_once(args)

    train_once = train.make_training
    monkeypatch.setattr(learning_curves.train, "make_training", remember)
    given = {"epsilon": 0.4, "learning_rate": 0.5, "discount": 0.8, "vetoes": "monolithic"}
    measure(Args(task="maze", set=("goal=(3,1)",), episodes=8, bins=2, **given), "d-rr-ql", 7)
    assert (seen[0].task, seen[0].set, seen[0].learner, seen[0].seed) == (
        *("maze", ("goal=(3,1)",), "d-rr-ql", 7),
    )
    assert {name: getattr(seen[0], name) for name in given} == given


def test_options_are_for_all_learners_or_for_the_one_they_name(monkeypatch):
    seen = {}

    def remember(args):
        seen[args.learner] = args.options
        return train_once(replace(args, options=()))

    train_once = train.make_training
    monkeypatch.setattr(learning_curves.train, "make_training", remember)
    ids = ("d-rr-ql", "q-learning")
    words = ("a=1.5", "q-learning.b=2", "d-rr-ql.c=(0.5, 3)")
    args = Args(task="maze", learners=ids, options=words, episodes=2, bins=1)
    check_arguments(args)
    for id in ids:
        measure(args, id, 0)
    assert seen == {"d-rr-ql": ("a=1.5", "c=(0.5, 3)"), "q-learning": ("a=1.5", "b=2")}


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--learners", "q-lerning"), "learners"),
        (("--learners", "q-learning", "q-learning"), "learners"),
        (("--measures", "speed"), "measures"),
        (("--seeds", "0"), "seeds"),
        (("--bins", "50", "--episodes", "40"), "bins"),
        (("--seed", "-1"), "seed"),
        (("--set", "size=3"), "size"),
        (("--options", "trace_decay=0.8"), "trace_decay"),
        (("--options", "usap.capacity=10"), "usap.capacity"),
        (("--vetoes", "all"), "vetoes"),
    ],
)
def test_a_mistake_is_one_line(words, named, capsys, tmp_path):
    assert main(["curves", "maze", "--save", str(tmp_path / "a.png"), *words]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("hose-mj: error")
    assert named in error
    assert not list(tmp_path.iterdir())


def test_the_default_learner_exists():
    assert set(Args().learners) <= set(catalog.LEARNERS)
