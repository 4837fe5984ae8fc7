import dataclasses
import json

import numpy as np
import pytest
from hose_learning.study import jobs
from hose_learning.study.jobs import Job, do, do_all

SHORT = Job(
    name="short",
    task="corridor",
    learner="d-rr-ql",
    settings={"exploration": {"per_episode": 0.01}},
    seed=3,
    episodes=150,
)
TESTED = dataclasses.replace(SHORT, name="tested", test_every=25)


def test_a_job_says_what_it_found():
    result = do(SHORT)
    assert result["test_success"]
    assert result["test_moves"] == 2
    assert 0.0 <= result["success_rate"] <= 1.0
    measured = do(TESTED)
    assert measured["n_tests"] == 6
    assert measured["n_g"] <= measured["n_f"] <= measured["steps"]
    assert measured["s_b"] <= measured["s_f"]


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 4},
        {"episodes": 151},
        {"steps": 10},
        {"test_every": 1},
        {"options": {"n_cells": 5}},
        {"settings": {}},
        {"learner": "rr-q"},
        {"name": "other"},
    ],
)
def test_another_job_has_another_identity(change):
    assert dataclasses.replace(SHORT, **change).identity != SHORT.identity
    assert dataclasses.replace(SHORT).identity == SHORT.identity


def test_results_stand_in_the_order_of_the_jobs_whoever_works():
    many = [dataclasses.replace(SHORT, seed=seed) for seed in (5, 6, 5, 7)]
    alone = do_all(many, 1)
    assert alone == [do(job) for job in many]
    assert do_all(many, 2) == alone


def test_what_is_kept_is_found_again_and_damage_is_done_anew(tmp_path, monkeypatch):
    steps: list[int] = []
    first = do_all([SHORT], 1, tmp_path, steps.append)
    (file,) = tmp_path.glob("*.json")
    kept = json.loads(file.read_bytes())
    assert kept["result"] == first[0]
    kept["result"]["moves"] = -1
    file.write_text(json.dumps(kept))
    assert do_all([SHORT], 1, tmp_path, steps.append)[0]["moves"] == -1
    file.write_text('{"result": 3')
    assert do_all([SHORT], 1, tmp_path, steps.append) == first
    assert steps == [1, 1, 1]
    monkeypatch.setattr(jobs, "VERSION", jobs.VERSION + 1)
    assert SHORT.identity != file.stem


def test_a_job_is_seeded_by_its_seed_alone():
    np.random.default_rng(0).random()
    assert do(TESTED) == do(TESTED)
    other = dataclasses.replace(TESTED, seed=11)
    assert do(other) != do(TESTED)
