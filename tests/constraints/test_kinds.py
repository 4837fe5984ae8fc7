"""One row a kind of constraint: what is in it is complete, and nothing else knows the kinds."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from hose_mj.constraints import kinds
from hose_mj.constraints.kinds import KIND_OF, KINDS, Kind, Watched
from hose_mj.constraints.monitor import Break, Monitor
from hose_mj.rollout import scripts

BREAK = Break("stretch", 3, "post", 0.5, (0.0, 0.0, 0.0), -0.1, 1.0)


def test_numbers_of_kinds_are_their_places():
    places = [kinds.STRETCH, kinds.RUN_OVER, kinds.COLLISION, kinds.BOUNDS, kinds.OBSTACLE]
    names = ["stretch", "run-over", "collision", "bounds", "obstacle"]
    assert [KINDS[place].name for place in places] == names == list(KIND_OF)


@pytest.mark.parametrize("kind", KINDS, ids=KIND_OF)
def test_a_row_is_complete(kind: Kind):
    assert kind.unit in ("N", "m")
    assert all(0 <= part <= 255 for part in kind.color)
    assert callable(getattr(scripts, kind.script))
    assert re.search(r"\d", kind.limit.format(limit=0.25))
    said = replace(BREAK, kind=kind.name).describe()
    assert kind.sentence.format(robot=3, other="post") in said
    assert f"{kind.unit}/s" in said


def test_colors_tell_kinds_apart():
    assert len({kind.color for kind in KINDS}) == len(KINDS)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_how_many_margins_there_are(n):
    count = [len(kind.members(Watched(n, True, True))) for kind in KINDS]
    assert count == [n, n, n * (n - 1) // 2, n, n]
    count = [len(kind.members(Watched(n, False, False))) for kind in KINDS]
    assert count == [n, n, n * (n - 1) // 2, 0, 0]


def test_a_new_kind_is_a_row_and_its_margins(floor, monkeypatch):
    """Rows after the last are numbered, named, watched and told without any other change."""
    row = KINDS[kinds.BOUNDS]._replace(
        name="parked", sentence="robot {robot} was parked", members=lambda w: [(0, None)]
    )
    for place in ("kinds", "monitor"):
        module = pytest.importorskip(f"hose_mj.constraints.{place}")
        monkeypatch.setattr(module, "KINDS", (*KINDS, row))
        monkeypatch.setattr(module, "KIND_OF", {**KIND_OF, "parked": row})
    monitor = Monitor(floor)
    assert (monitor.names[-1], monitor.kinds[-1]) == ("parked 0", "parked")
    assert len(monitor.measure()) == len(monitor.names)
    monitor._tables.margins[-1] = -1.0  # what its kernel would write
    found = monitor.check()
    assert found is not None
    assert "robot 0 was parked" in found.describe()
    assert not np.any(monitor.margins[:-1] < 0.0)
