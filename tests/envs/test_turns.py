"""The canonical form: turns, the rewards of a cycle, what infos say, how an episode ends."""

from __future__ import annotations

import numpy as np
import pytest

from hose_mj.envs.parallel import JointEnv
from hose_mj.envs.turns import TurnsEnv
from hose_mj.tasks.registry import make_task

LEFT, RIGHT, NONE = range(3)


@pytest.mark.parametrize("task", ["line", "line-non-cooperative", "taxi", "corridor"])
def test_what_last_returns_is_the_sum_over_the_cycle(task):
    env = TurnsEnv(task)
    random = np.random.default_rng(0)
    env.reset(seed=0)
    n = len(env.possible_agents)
    turns = dict.fromkeys(env.agents, 0)
    for agent in env.agent_iter(2000):
        _, reward, terminated, truncated, info = env.last()
        assert reward == pytest.approx(info["cycle_rewards"].sum())
        assert reward == pytest.approx(sum(info["signals"].values()))
        assert set(info["caused_events"]) <= set(info["events"])
        if terminated or truncated:
            env.step(None)
            if not env.agents:
                env.reset()
                turns = dict.fromkeys(env.agents, 0)
            continue
        # Before its first move an agent has seen the moves of those before it, then a whole cycle.
        assert len(info["cycle_rewards"]) == (n if turns[agent] else env.agents.index(agent))
        turns[agent] += 1
        env.step(int(random.integers(env.action_space(agent).n)))


def test_the_rewards_of_a_cycle_in_the_corridor():
    """Table 6.2, {right, left}: 100, and then -10 a turn later, for both robots."""
    env = TurnsEnv("corridor")
    env.reset(seed=0)
    assert env.agent_selection == "robot_0"
    env.step(RIGHT)
    assert env.agent_selection == "robot_1"
    assert env.last()[4]["cycle_rewards"].tolist() == [100.0]
    assert env.last()[4]["caused_events"] == ()
    assert "goal" in env.last()[4]["events"]
    env.step(LEFT)
    assert env.infos["robot_0"]["cycle_rewards"].tolist() == [100.0, -10.0]
    assert env.infos["robot_0"]["signals"] == {"goal": 100.0, "collision": -10.0}
    assert env.infos["robot_1"]["cycle_rewards"].tolist() == [-10.0]
    assert "collision" in env.infos["robot_1"]["caused_events"]
    assert "collision" not in env.infos["robot_0"]["caused_events"]
    assert env.infos["robot_1"]["charged"] == env.infos["robot_1"]["caused_events"]
    assert env.terminations == {"robot_0": True, "robot_1": True}
    assert env.truncations == {"robot_0": False, "robot_1": False}


def test_rewards_are_the_chosen_signals():
    for rewards, expected in ((("goal",), 100.0), (("collision",), -10.0), (None, 90.0)):
        env = JointEnv("corridor", rewards=rewards)
        env.reset(seed=0)
        _, got, _, _, infos = env.step({"robot_0": RIGHT, "robot_1": LEFT})
        assert got == {"robot_0": expected, "robot_1": expected}
        assert infos["robot_0"]["signals"] == {"goal": 100.0, "collision": -10.0}


def test_the_limit_truncates_and_events_terminate():
    env = TurnsEnv("corridor", max_cycles=2)
    env.reset(seed=0)
    for _ in range(4):
        assert env.agents
        assert not any(env.truncations.values())
        env.step(NONE)
    assert all(env.truncations.values())
    assert not any(env.terminations.values())
    env = TurnsEnv("corridor", max_cycles=1)
    env.reset(seed=0)
    env.step(RIGHT)
    env.step(NONE)
    assert all(env.terminations.values())
    assert not any(env.truncations.values()), "an event on the last move ends the episode itself"


def test_observations_and_masks_are_copies():
    env = TurnsEnv("line", n_robots=2)
    env.reset(seed=1)
    seen, info = env.observe("robot_0"), env.infos["robot_0"]
    before = seen.copy()
    seen[:] = -1
    info["action_mask"][:] = 0
    env.state()[:] = 99
    assert np.array_equal(env.observe("robot_0"), before)
    env.step(4)
    assert env.infos["robot_0"]["action_mask"].all()


def test_agents_see_what_they_chose_to_see():
    names = ("r_p", "o_up", "goal")
    env = TurnsEnv("line", n_robots=3, observe=names, form="dict")
    env.reset(seed=2)
    task = make_task("line", n_robots=3)
    for number, agent in enumerate(env.agents):
        all_values = dict(
            zip([v.name for v in task.variables], task.observe(env.state(), number), strict=True)
        )
        assert env.observe(agent) == {name: all_values[name] for name in names}
        assert list(env.observation_space(agent)) == list(names)
