"""A task in plain Python, with a record of any kind, is an environment of every interface too."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from pettingzoo.test import api_test, parallel_api_test, seed_test

from hose_mj.envs.dm import DmEnv
from hose_mj.envs.gym import TaskEnv
from hose_mj.envs.parallel import JointEnv
from hose_mj.envs.turns import TurnsEnv
from hose_mj.envs.vector import VectorTaskEnv
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import HEADER, begin, end_joint, end_turn
from hose_mj.tasks.stream import draw_below
from hose_mj.tasks.task import Task
from hose_mj.tasks.variables import Variable

GOAL = 4


class Climb:
    """Two climbers on ladders of five rungs; the first on the top rung wins for both."""

    n_agents, n_actions, step_limit = 2, 2, 20
    terminal = success = shared = 1
    violations = 0
    reward_table = np.array([[0.0], [7.0]])


@kernels.reset.register
def reset_climb(record: Climb, state, stream):
    begin(state)
    for agent in range(2):
        state[HEADER + agent] = 1 + draw_below(stream, 2)


@kernels.apply.register
def apply_climb(record: Climb, state, agent, action):
    state[HEADER + agent] += action
    end_turn(record, state, agent)
    return int(state[HEADER + agent] == GOAL)


@kernels.apply_joint.register
def apply_joint_climb(record: Climb, state, actions, caused_events):
    for agent in range(2):
        state[HEADER + agent] += actions[agent]
        caused_events[agent] = int(state[HEADER + agent] == GOAL)
    end_joint(record, state)
    return int(caused_events.max())


@kernels.observe.register
def observe_climb(record: Climb, state, agent, values):
    values[0] = state[HEADER + agent]
    values[1] = state[HEADER + 1 - agent]


@pytest.fixture
def task():
    return Task(
        id="climb",
        agents=("climber_0", "climber_1"),
        action_names=("stay", "up"),
        variables=(Variable("own", 5, "own rung", True), Variable("other", 5, "", True)),
        rewards=("goal",),
        events=("goal",),
        schedule="turns",
        settings=None,
        kernel=Climb(),
        layout={"rungs": slice(HEADER, HEADER + 2)},
        state_size=HEADER + 2,
    )


def test_pettingzoo_takes_it(task):
    api_test(TurnsEnv(task), 50)
    parallel_api_test(JointEnv(task), 50)
    seed_test(lambda: TurnsEnv(task), 50)


@pytest.mark.parametrize("moves", ["joint", "turns"])
def test_many_copies_are_single_ones(task, moves):
    copies = VectorTaskEnv(task, 3, moves=moves)
    singles = gymnasium.vector.SyncVectorEnv([lambda: TaskEnv(task, moves=moves)] * 3)
    assert data_equivalence(copies.reset(seed=1), singles.reset(seed=1), exact=True)
    copies.action_space.seed(0)
    for _ in range(40):
        actions = copies.action_space.sample()
        assert data_equivalence(copies.step(actions), singles.step(actions), exact=True)


def test_a_climb_to_the_top(task):
    env = DmEnv(task, seed=0)
    step = env.reset()
    rungs = step.observation["observation"][:2].tolist()
    while not step.last():
        step = env.step(np.array([1, 0]))
        rungs[0] += 1
    assert rungs[0] == GOAL
    assert step.observation["observation"].tolist() == [GOAL, rungs[1], rungs[1], GOAL]
    assert (step.reward, step.discount) == (7.0, 0.0)
