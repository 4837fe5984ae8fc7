"""`hose-mj bench`: its document, its exit statuses, and how a rate is measured."""

from __future__ import annotations

import functools
import json

import pytest

from hose_mj.checks import Check
from hose_mj.cli import bench
from hose_mj.cli import main as cli
from hose_mj.cli.bench import Bench, Record, measure_rate
from hose_mj.cli.bench import env as bench_env
from hose_mj.cli.bench import hose as bench_hose
from hose_mj.cli.bench import learn as bench_learn

RECORD = {"group", "name", "value", "unit", "peer", "ratio"}


def check_records(records, group):
    by_name = {record["name"]: record for record in records}
    assert len(by_name) == len(records)
    for record in records:
        assert set(record) == RECORD
        assert record["group"] == group
        assert record["value"] > 0.0
        assert (record["peer"] is None) == (record["ratio"] is None)
        if record["peer"] is not None:
            expected = record["value"] / by_name[record["peer"]]["value"]
            assert record["ratio"] == pytest.approx(expected)


@pytest.fixture
def short(monkeypatch):
    """Groups that measure for an instant: the numbers are nonsense, the document is whole."""

    def measure(work, rounds, seconds, *clock):
        return measure_rate(work, 1, 1e-3, *clock)

    for group in (bench_env, bench_hose, bench_learn):
        monkeypatch.setattr(group, "measure_rate", measure)


@pytest.mark.parametrize(("group", "n_checks"), [("env", 3), ("hose", 0), ("learn", 7)])
def test_the_document(capsys, short, group, n_checks):
    status = cli.main(["bench", group, "--quick", "--json", "--seed", "4"])
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert document["command"] == "bench"
    assert document["seed"] == 4
    assert document["settings"] == {"group": group, "quick": True}
    check_records(document["records"], group)
    assert len(document["checks"]) == n_checks
    assert status == (0 if all(check["ok"] for check in document["checks"]) else 1)
    assert f"of {n_checks} checks ok" in captured.err


def test_env_measures_each_number_of_robots(short):
    names = [record.name for record in bench_env.measure(False, 0).records]
    for n_robots in (2, 3, 4, 6, 8):
        assert f"line, N = {n_robots}, compiled loop" in names


@pytest.mark.parametrize(("value", "status"), [(2.0, 0), (0.5, 1)])
def test_a_failed_check_is_status_1_and_shown(capsys, monkeypatch, value, status):
    def measure(quick, seed):
        record = Record("env", "a thing", value, "moves/s", "another", value)
        return Bench([record], [Check("a thing", value, 1.0, ">=")])

    monkeypatch.setattr(bench_env, "measure", measure)
    assert cli.main(["bench", "env"]) == status
    shown = capsys.readouterr().out
    assert "a thing" in shown
    assert f"{1 - status} of 1 checks ok" in shown


def test_bad_input(capsys):
    assert cli.main(["bench", "moon"]) == cli.BAD_INPUT
    assert "group is 'moon'; valid: one of env, hose" in capsys.readouterr().err
    assert cli.main(["bench", "env", "--seed", "-1"]) == cli.BAD_INPUT


def test_every_group_can_be_loaded():
    for module in bench.GROUPS.values():
        assert callable(__import__(module, fromlist=["measure"]).measure)


def test_a_rate_is_the_best_round():
    """A clock that ticks a second a look; rounds of 10, 40 and 20 units in two looks each."""
    units = iter([1, 10, 40, 20])
    clock = iter(range(100))
    rate = measure_rate(lambda: next(units), 3, 1.0, lambda: float(next(clock)))
    assert rate == 40.0


def test_copies_that_start_an_episode_count_no_move(monkeypatch):
    """A limit of one round: half of the 32 steps move the 4 robots of each of the 4 copies."""
    monkeypatch.setattr(bench_env, "COPIES", 4)
    make = functools.partial(bench_env.VectorTaskEnv, step_limit=4)
    monkeypatch.setattr(bench_env, "VectorTaskEnv", make)
    assert bench_env.step_copies(1, 0)() == 16 * 4 * 4
