"""The limits' numbers, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from hose_mj.constraints.kinds import KINDS
from hose_mj.constraints.limits import Limits
from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import InputError


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("max_tension", bad) for bad in (0.0, -1.0, math.nan, math.inf, "10", True)],
        *[("max_strain", bad) for bad in (0.0, None, math.nan)],
        *[("max_lengthening", bad) for bad in (0.0, -0.1)],
        *[("own_arc", bad) for bad in (-0.1, math.inf)],
        *[("sight", bad) for bad in (0.0, math.nan)],
        *[(f"{kind}_distance", -1e-3) for kind in ("run_over", "collision", "bounds", "obstacle")],
        *[("ground", bad) for bad in ("floor", ["floor"], (1,))],
    ],
)
def test_a_wrong_limit_is_named(name, value):
    with pytest.raises(InputError) as caught:
        Limits(**{name: value})
    assert caught.value.thing == name


def test_the_floors_break_at_ten_newtons(floors):
    """0.2 % of 5 kN; the whole hose weighs 1.18 N."""
    for scene in floors.values():
        assert Limits().compute_tension_limit(scene.spec, 9.81) == pytest.approx(10.0)


def test_a_soft_hose_may_carry_twice_its_weight(floors):
    soft = replace(floors[1].spec, axial_stiffness=100.0)
    assert Limits().compute_tension_limit(soft, 9.81) == pytest.approx(2.0 * 0.15 * 0.8 * 9.81)
    assert Limits().compute_tension_limit(soft, 0.0) == pytest.approx(0.2)
    assert Limits(max_strain=0.5).compute_tension_limit(soft, 9.81) == pytest.approx(50.0)
    assert Limits(max_tension=3.0).compute_tension_limit(soft, 9.81) == 3.0


def test_lengths_follow_the_robot(floor):
    """Three radii of a puck of 20 mm are 60 mm of hose that never counts."""
    assert Limits().compute_own_arc(0.02) == pytest.approx(0.06)
    assert Limits().compute_sight(0.02) == pytest.approx(0.1)
    assert Limits(own_arc=0.3, sight=2.0).compute_own_arc(0.02) == 0.3
    assert Limits(own_arc=0.3, sight=2.0).compute_sight(0.02) == 2.0


def test_a_hose_counts_as_met_when_it_is_all_but_touched():
    clearances = [kind.clearance(Limits(), 0.008) for kind in KINDS]
    assert clearances == pytest.approx([0.0, 0.0008, 0.0, 0.0, 0.0])
    given = Limits(run_over_distance=0.0, bounds_distance=0.02)
    assert [kind.clearance(given, 0.008) for kind in KINDS] == [0.0, 0.0, 0.0, 0.02, 0.0]


def test_ground_that_is_not_there_is_refused(floor):
    with pytest.raises(InputError, match="'flor'"):
        Monitor(floor, Limits(ground=("flor",)))
