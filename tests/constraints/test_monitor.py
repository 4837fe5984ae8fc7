"""Crossings: which, when, where and how fast, against motions whose answer is known."""

from __future__ import annotations

import json

import numpy as np
import pytest

from hose_mj.constraints.kinds import KIND_OF
from hose_mj.constraints.limits import Limits
from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import InputError

DISC, HOSE, NEAR = 0.02, 0.008, 0.0008
"""Radii of the floor's pucks and hose (m), and how near the hose counts as run over."""


def advance(world, monitor, move, steps):
    """Moves the world step by step, until something breaks."""
    for _ in range(steps):
        world.step()
        move(world.time)
        found = monitor.check()
        if found:
            return found
    return None


def test_only_a_world_is_watched(floor):
    for odd in (None, "floor_1", 3):
        with pytest.raises(InputError, match=r"^world is .*; valid: a world, as make_world"):
            Monitor(odd)
    with pytest.raises(InputError, match=r"^limits is 3; valid: a Limits"):
        Monitor(floor, 3)


def test_names_say_what_is_measured(floor):
    monitor = Monitor(floor)
    assert monitor.names == (
        *("stretch 0", "stretch 1", "run-over 0", "run-over 1"),
        *("collision 0-1", "bounds 0", "bounds 1"),
    )
    assert monitor.kinds == tuple(name.split()[0] for name in monitor.names)
    assert monitor.units == ("N", "N", "m", "m", "m", "m", "m")
    assert monitor.limit_texts[0] == "tension at most 10 N"
    assert len(monitor.limit_texts) == len(monitor.names) == len(monitor.measure())
    assert set(monitor.kinds) <= set(KIND_OF)


def test_a_tension_that_rises_evenly_breaks_at_its_time_and_place(floor):
    """Tension 8 s/L + 3 t: segment 0 ends at the tip and breaks first, when 8 + 3 t = 10."""
    length = floor.scene.spec.length

    def load(time):
        floor.pull = lambda s: 8.0 * s / length + 3.0 * time

    load(0.0)
    monitor = Monitor(floor)
    found = advance(floor, monitor, load, 200)
    assert (found.kind, found.robot, found.other) == ("stretch", None, 0)
    assert found.time == pytest.approx(2.0 / 3.0, abs=1e-6)
    assert found.speed == pytest.approx(3.0)
    assert found.place == pytest.approx(floor.hose_position(length)[0], abs=1e-6)
    assert found.margin == pytest.approx(2.0 - 3.0 * 0.67, abs=1e-6)
    # Segment 1 ends at half of the hose.
    assert advance(floor, monitor, load, 200).time == pytest.approx(2.0, abs=1e-6)
    assert monitor.measure()[0] < 0.0


def test_pucks_that_approach_collide_when_they_touch(floor):
    monitor = Monitor(floor)

    def move(time):
        floor.put(0, (-0.2 + 0.13 * time, 0.3))
        floor.put(1, (0.2 - 0.07 * time, 0.3))

    found = advance(floor, monitor, move, 400)
    assert (found.kind, found.robot, found.other) == ("collision", 0, 1)
    assert found.time == pytest.approx((0.4 - 2 * DISC) / 0.2, abs=1e-9)
    assert found.speed == pytest.approx(0.2, abs=1e-9)
    middle = -0.2 + 0.13 * found.time + DISC
    assert found.place[:2] == pytest.approx((middle, 0.3), abs=1e-9)
    assert monitor.breaks == (found,)


def test_a_puck_runs_over_the_hose_of_another(floor, make_straight):
    """The hose lies along x; robot 0 comes down at it where segment 1 is."""
    floor.line = make_straight((0, 0, 0.008), (0.8, 0, 0.008), 0.8)
    floor.put(1, (0.4, 0.0))
    floor.put(0, (0.3, 0.3))
    monitor = Monitor(floor)
    found = advance(floor, monitor, lambda t: floor.put(0, (0.3 - 0.05 * t, 0.3 - 0.1 * t)), 400)
    assert (found.kind, found.robot, found.other) == ("run-over", 0, 1)
    assert found.time == pytest.approx((0.3 - DISC - HOSE - NEAR) / 0.1, abs=1e-9)
    assert found.speed == pytest.approx(0.1, abs=1e-9)
    assert found.place == pytest.approx((0.3 - 0.05 * found.time, 0.0, 0.008), abs=1e-6)


def test_a_puck_leaves_the_floor(floor):
    monitor = Monitor(floor)
    found = advance(floor, monitor, lambda t: floor.put(1, (0.5, -0.3 - 0.25 * t)), 200)
    assert (found.kind, found.robot, found.other) == ("bounds", 1, None)
    assert found.time == pytest.approx(0.225 / 0.25, abs=1e-9)
    assert found.speed == pytest.approx(0.25, abs=1e-9)
    assert found.place[:2] == pytest.approx((0.5, -0.525), abs=1e-9)


def test_of_several_in_one_step_the_first_comes_first(floor):
    """In one step robot 0 goes from 9 mm to -1 mm, robot 1 from 2 mm to -8 mm."""
    floor.put(0, (0.516, 0.3))
    floor.put(1, (-0.523, -0.3))
    monitor = Monitor(floor)
    floor.step()
    floor.put(0, (0.526, 0.3))
    floor.put(1, (-0.533, -0.3))
    found = monitor.check()
    assert [one.robot for one in monitor.breaks] == [1, 0]
    assert found is monitor.breaks[0]
    assert [one.time for one in monitor.breaks] == pytest.approx([0.002, 0.009])
    # What stays broken is not broken anew; what is mended can break again.
    floor.step()
    assert monitor.check() is None
    assert monitor.breaks == ()
    floor.put(1, (-0.523, -0.3))
    floor.step()
    assert monitor.check() is None
    floor.put(1, (-0.527, -0.3))
    floor.step()
    assert [one.robot for one in (monitor.check(), *monitor.breaks)] == [1, 1]


def test_a_bad_start_is_told_at_once(floor):
    floor.put(0, (0.2, 0.13))  # robot 1 is at (0.2, 0.1)
    monitor = Monitor(floor)
    assert [one.kind for one in monitor.breaks] == ["collision"]
    found = monitor.check()
    assert (found.time, found.speed) == (0.0, 0.0)
    assert found.margin == pytest.approx(0.03 - 2 * DISC)
    assert "from the start" in found.describe()
    floor.step()
    assert monitor.check() is None
    assert monitor.reset().time == floor.time
    floor.reset()
    assert monitor.reset() is None
    assert monitor.check() is None


def test_a_clock_that_goes_back_starts_anew(floor):
    monitor = Monitor(floor)
    floor.step(50)
    floor.put(0, (0.52, 0.3))
    assert monitor.check() is None
    floor.reset()
    floor.put(0, (0.53, 0.3))
    found = monitor.check()
    assert (found.kind, found.time, found.speed) == ("bounds", 0.0, 0.0)


def test_measuring_in_between_changes_nothing(floor):
    monitor = Monitor(floor)
    floor.put(0, (0.53, 0.3))
    floor.step()
    assert monitor.measure()[5] < 0.0
    assert monitor.margins[5] > 0.0
    assert monitor.check().kind == "bounds"
    assert np.array_equal(monitor.margins, monitor.measure())


def test_a_break_says_and_records_itself(floor):
    floor.pull = lambda s: 0.0 * s
    monitor = Monitor(floor, Limits(max_tension=5.0))
    floor.pull = lambda s: 0.0 * s + 6.0
    floor.step()
    found = monitor.check()
    record = json.loads(json.dumps(found.to_record()))
    assert record["kind"] == "stretch"
    assert record["time"] == pytest.approx(0.01 * 5.0 / 6.0)
    assert record["place"] == list(found.place)
    assert set(record) == {"kind", "robot", "other", "time", "place", "margin", "speed"}
    text = found.describe()
    assert text.startswith("0.008 s: segment 0 of the hose was stretched too far at (")
    assert "\n" not in text
    assert "N/s" in text


@pytest.mark.parametrize("kind", ["run_over", "collision", "bounds"])
def test_a_clearance_shifts_its_margin_alone(floor, make_straight, kind):
    floor.line = make_straight((0, 0, 0.008), (0.8, 0, 0.008), 0.8)
    plain = Monitor(floor, Limits(run_over_distance=0.0))
    wide = Monitor(floor, Limits(**{"run_over_distance": 0.0, f"{kind}_distance": 0.007}))
    shift = plain.measure() - wide.measure()
    wanted = [0.007 if k.replace("-", "_") == kind else 0.0 for k in plain.kinds]
    assert shift == pytest.approx(wanted, abs=1e-15)


def test_the_same_state_has_the_same_margins(floor):
    monitor = Monitor(floor)
    first = monitor.measure()
    floor.put(0, (0.1, 0.1))
    floor.line = type(floor.line)(floor.line.arc_lengths, floor.line.coefficients + 0.001)
    assert np.any(monitor.measure() != first)
    floor.line = type(floor.line)(floor.line.arc_lengths, floor.line.coefficients - 0.001)
    floor._start_bodies()
    np.testing.assert_allclose(monitor.measure(), first, rtol=0.0, atol=1e-12)
