"""What the learners of joint moves share: how agents choose, and what a joint move was worth."""

from typing import Any

import numpy as np

from hose_learning.loop import choose
from hose_learning.policies import draw_allowed
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, check_range, get_options
from hose_learning.tables import claim, find
from hose_mj.jit import jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import Floats

NEIGHBOUR_OPTIONS = {"neighbour_weight": 0.5}
"""What an agent's neighbours weigh together; the rest is the agent's own weight."""


def make_weights(n_agents: int, settings: LearnerSettings) -> Floats:
    """Makes the weights f(i, j) of the agents i - 1, i, i + 1, which add up to 1 for each i.

    Raises:
        InputError: a wrong option (see `NEIGHBOUR_OPTIONS`).
    """
    weight = get_options(settings, NEIGHBOUR_OPTIONS)["neighbour_weight"]
    check_range("neighbour_weight", weight, 0.0, 1.0)
    weights = np.eye(n_agents)
    if n_agents > 1:
        are_neighbours = np.eye(n_agents, k=1) + np.eye(n_agents, k=-1)
        shares = are_neighbours / are_neighbours.sum(axis=1, keepdims=True)
        weights = (1.0 - float(weight)) * weights + float(weight) * shares
    return weights


@jitable
def choose_each(rule: Any, task: Any, learner: Learner, memory: Memory, explores: bool) -> None:
    """Each agent chooses alone, from its own values."""
    for agent in range(memory.actions.shape[0]):
        allowed = memory.allowed[agent]
        memory.actions[agent] = choose(task, learner, memory, agent, allowed, explores)


@jitable
def allow_fallbacks(task: Any, learner: Learner, memory: Memory) -> None:
    """Allows an agent for which everything is vetoed the fallback, or else everything."""
    for agent in range(memory.actions.shape[0]):
        if memory.allowed[agent] == 0:
            if learner.fallback >= 0:
                memory.allowed[agent] = 1 << learner.fallback
            else:
                memory.allowed[agent] = kernels.mask(task, memory.state, agent)


@jitable
def draw_each(memory: Memory) -> None:
    """Draws an allowed action for every agent: all joint actions are equally likely."""
    for agent in range(memory.actions.shape[0]):
        memory.actions[agent] = draw_allowed(memory.allowed[agent], memory.stream)


@jitable
def get_last_value(memory: Memory, agent: int, module: int, action: int) -> float:
    """Returns Q(s, a) of the state that the agent's module saw before the joint move."""
    row = find(memory.table, memory.last_keys[agent, module])
    return memory.table.rows[row, action]


@jitable
def set_last_value(memory: Memory, agent: int, module: int, action: int, value: float) -> None:
    """Writes Q(s, a) of the state that the agent's module saw before the joint move."""
    row = claim(memory.table, memory.last_keys[agent, module])
    memory.table.rows[row, action] = value


@jitable
def compute_highest_value(memory: Memory, key: int) -> float:
    """Returns max_a Q(s, a), where `memory.scores` says how many actions there are."""
    row = find(memory.table, key)
    highest = memory.table.rows[row, 0]
    for action in range(1, memory.scores.shape[0]):
        highest = max(highest, memory.table.rows[row, action])
    return highest


@jitable
def compute_next_value(memory: Memory, agent: int, module: int, is_over: bool) -> float:
    """Returns max_a' Q(s', a') of the state after the joint move; 0 if the episode is over."""
    if is_over:
        return 0.0
    return compute_highest_value(memory, memory.keys[agent, module])


@jitable
def get_own_reward(learner: Learner, memory: Memory, agent: int, module: int) -> float:
    """Returns what the agent itself caused in a joint move; summed over agents, the team's."""
    return learner.rewards[memory.caused_events[agent], 1, module]


@jitable
def sum_team_reward(learner: Learner, memory: Memory, module: int) -> float:
    """Returns what a joint move was worth to the team: everything that happened, once."""
    reward = 0.0
    for agent in range(memory.actions.shape[0]):
        reward += get_own_reward(learner, memory, agent, module)
    return reward
