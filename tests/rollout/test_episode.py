"""How an episode runs and ends, and who is told."""

from __future__ import annotations

import numpy as np
import pytest

from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import InputError
from hose_mj.rollout.episode import is_at_goal, run_episode
from hose_mj.world.driving import Driver
from hose_mj.world.registry import make_world


class Going:
    """Drives the tip's robot by a step."""

    def __init__(self, step=(0.0, 0.0, 0.0), ends_at_goal=True):
        self.ends_at_goal, self._step, self.updates = ends_at_goal, step, 0

    def start(self, world, monitor, generator):
        self._driver = Driver(world)
        self._driver.targets[0] += self._step

    def update(self):
        self.updates += 1
        self._driver.update()

    def describe(self):
        return {"owner": "me", "stalled": 7}


class Notes:
    def __init__(self):
        self.calls, self.times = [], []

    def start(self, world, monitor, settings):
        self.calls.append(("start", dict(settings)))

    def sample(self, world, monitor, info):
        self.calls.append(("sample", info["owner"]))
        self.times.append(world.time)

    def finish(self, outcome):
        self.calls.append(("finish", outcome))


@pytest.fixture
def world():
    return make_world("floor_2")


def test_nothing_happens_until_the_time_is_over(world):
    policy, notes = Going(), Notes()
    outcome = run_episode(
        *(world, Monitor(world), policy),
        duration=0.5,
        observers=[notes],
        sample_rate=40.0,
        settings={"a": "b"},
    )
    assert (outcome.ended_by, outcome.broken, outcome.stalled) == ("duration", None, 7)
    assert outcome.steps == policy.updates == round(0.5 / world.timestep)
    assert outcome.sim_time == world.time == pytest.approx(0.5)
    assert notes.times == pytest.approx(np.arange(21) / 40.0, abs=world.timestep)
    assert notes.calls[0] == ("start", {"a": "b"})
    assert notes.calls[-1] == ("finish", outcome)
    assert [call[0] for call in notes.calls].count("sample") == 21


def test_a_break_ends_it_and_is_sampled(world):
    notes = Notes()
    outcome = run_episode(
        *(world, Monitor(world), Going((0.0, 1.0, 0.0))), duration=5.0, observers=[notes]
    )
    assert outcome.ended_by == "break"
    assert outcome.broken.kind in ("bounds", "stretch")
    assert outcome.sim_time - world.timestep <= outcome.broken.time <= outcome.sim_time
    assert notes.times[-1] == world.time == outcome.sim_time < 1.0


def test_the_goal_ends_it_where_the_policy_says_so(world):
    tip, goal = world.site_positions()[0], world.goal_position()
    world.data.qpos[:2] += (goal - tip)[:2] + 0.02  # within half a cell
    world.step()
    assert is_at_goal(world)
    world.reset()
    assert not is_at_goal(world)
    ended = {}
    for ends_at_goal in (True, False):
        policy = Going(ends_at_goal=ends_at_goal)
        world.reset()
        # The goal is laid under the tip.
        world.model.site(world.scene.goal.site).pos[:] = world.site_positions()[0]
        world.reset()
        ended[ends_at_goal] = run_episode(world, Monitor(world), policy, duration=0.1).ended_by
    assert ended == {True: "goal", False: "duration"}


@pytest.mark.parametrize(("name", "value"), [("duration", 0.0), ("sample_rate", np.inf)])
def test_bad_numbers(world, name, value):
    with pytest.raises(InputError, match=f"{name} is "):
        run_episode(world, Monitor(world), Going(), **{"duration": 1.0, name: value})
