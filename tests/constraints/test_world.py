"""A real hose on real robots: each kind of break is brought about, and looks as it should."""

from __future__ import annotations

import numpy as np
import pytest

from hose_mj.constraints.limits import Limits
from hose_mj.constraints.monitor import Monitor
from hose_mj.world.registry import make_world


@pytest.fixture(scope="module")
def world():
    return make_world("floor_2", timestep=0.005)


@pytest.fixture
def monitor(world):
    world.reset()
    return Monitor(world)


def steer(world, monitor, robot, aim, speed=0.2, seconds=8.0):
    """Pushes a robot after a target that moves with the world, the others held where they are."""
    start = world.site_positions()
    while world.time < seconds:
        places, velocities = world.site_positions(), world.site_velocities()
        for i in range(world.n_robots):
            way = (aim() if i == robot else start[i]) - places[i]
            far = np.linalg.norm(way)
            wanted = way * min(5.0, speed / max(far, 1e-9))
            force = 20.0 * (wanted - velocities[i])
            world.apply_force(i, force * [1.0, 1.0, 0.0])
        world.step()
        found = monitor.check()
        if found:
            return found
    raise AssertionError("nothing broke")


def test_a_fresh_world_is_whole(monitor):
    assert monitor.breaks == ()
    assert np.all(monitor.measure() > 0.0)


def test_a_robot_that_pulls_away_stretches_its_segment(world, monitor):
    """Along the way out from robot 1 nothing else is in reach."""
    places = world.site_positions()
    out = (places[0] - places[1]) / np.linalg.norm(places[0] - places[1])
    found = steer(world, monitor, 0, lambda: world.site_positions()[0] + out, speed=0.8)
    assert found.kind == "stretch"
    assert found.other == 0
    ends = world.site_positions()
    # Broken at 0.2 % of strain, taut between the two.
    assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(0.4, rel=0.01)
    assert world.tension(np.linspace(0.4 + 1e-9, 0.8, 40001)).max() == pytest.approx(
        10.0 - found.margin, abs=1e-3
    )
    assert world.time - world.timestep <= found.time <= world.time


def test_a_robot_that_goes_for_the_hose_runs_over_it(world, monitor):
    found = steer(world, monitor, 1, lambda: world.hose_position(0.65)[0])
    assert (found.kind, found.robot, found.other) == ("run-over", 1, 0)
    place = world.site_positions()[1]
    assert np.linalg.norm((found.place - place)[:2]) == pytest.approx(0.0288, abs=1e-3)
    s = np.linspace(0.0, 0.8, 2001)
    apart = np.linalg.norm((world.hose_position(s) - place)[:, :2], axis=1)
    foreign = np.abs(s - 0.4) > 0.06
    assert apart[foreign].min() - 0.0288 == pytest.approx(found.margin, abs=2e-5)


def test_robots_that_meet_collide(world, monitor):
    """Robot 0 goes round to the side where no hose is in the way."""
    monitor = Monitor(world, Limits(own_arc=0.8))
    corners = [np.array([0.3, 0.3, 0.008]), np.array([0.4, 0.1, 0.008])]

    def aim():
        places = world.site_positions()
        if corners and np.linalg.norm(places[0] - corners[0]) < 0.05:
            corners.pop(0)
        return corners[0] if corners else places[1]

    found = steer(world, monitor, 0, aim)
    assert (found.kind, found.robot, found.other) == ("collision", 0, 1)
    places = world.site_positions()
    assert np.linalg.norm(places[0] - places[1]) == pytest.approx(0.04 + found.margin, abs=1e-9)
    assert found.speed == pytest.approx(0.2, rel=0.3)
    assert found.place == pytest.approx(places[:2].mean(axis=0), abs=5e-3)


def test_a_world_restored_goes_on_with_the_same_margins(world, monitor):
    world.step(20)
    state, margins = world.snapshot(), monitor.measure()
    world.apply_force(0, (3.0, 1.0, 0.0))
    world.step(30)
    assert np.any(monitor.measure() != margins)
    world.restore(state)
    np.testing.assert_array_equal(monitor.measure(), margins)
