import numpy as np
import pytest
from hose_learning.study.experiments import (
    EXPERIMENTS,
    HOSES,
    N_CONFIGURATIONS,
    make_configuration,
)
from hose_learning.study.jobs import make_training

from hose_mj.tasks.exact import find_shortest
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream

SEEDS = range(10)
every_experiment = pytest.mark.parametrize("id", EXPERIMENTS)


def fake(job, good):
    """What a run would say that went well, or did not."""
    if job.test_every:
        steps = 7 if good else None
        return {"n_g": steps, "n_f": steps, "s_f": steps, "s_b": steps}
    moves = 17 if good else 400
    return {"success_rate": float(good), "test_success": good, "test_moves": moves}


def conclude(id, good):
    runs = {}
    for job in EXPERIMENTS[id].list_jobs(SEEDS):
        runs.setdefault(job.name, []).append(fake(job, good))
    return EXPERIMENTS[id].conclude(runs, len(SEEDS))


@every_experiment
def test_every_kind_of_job_can_be_begun(id):
    named = {job.name: job for job in EXPERIMENTS[id].list_jobs([0])}
    for job in named.values():
        assert make_training(job).moves == 0


@every_experiment
def test_jobs_differ(id):
    found = EXPERIMENTS[id].list_jobs(SEEDS)
    assert len({job.identity for job in found}) == len(found)


@every_experiment
def test_checks_follow_the_runs(id):
    good = [f.check for f in conclude(id, True) if f.check is not None]
    bad = [f.check for f in conclude(id, False) if f.check is not None]
    assert good
    assert all(check.ok for check in good)
    found_by_search = sum(check.comparison == "==" for check in bad)
    assert sum(check.ok for check in bad) == found_by_search


@every_experiment
def test_intervals_enclose_what_they_are_about(id):
    for finding in conclude(id, True):
        low, high = finding.interval
        assert low <= finding.ours <= high
        assert finding.claim
        assert finding.n_seeds >= 1


@pytest.mark.parametrize("options", HOSES.values(), ids=HOSES)
def test_the_optimum_of_17_is_one(options):
    task = make_task("line-single-agent", n_robots=4, **options)
    assert find_shortest(task, task.reset(make_stream(np.random.default_rng(0)))) == 17


def test_configurations_are_feasible_and_stay_the_same():
    made = [make_configuration(number) for number in range(N_CONFIGURATIONS)]
    assert made == [make_configuration(number) for number in range(N_CONFIGURATIONS)]
    assert sorted({m["n_robots"] for m in made}) == [2, 3, 4]
    assert all(m["goal"] not in ((0, 0), m["start"][0]) for m in made)
    for options in made:
        make_task("line", **options)  # refuses a start that the hose does not allow
