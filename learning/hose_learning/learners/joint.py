"""What the learners of joint moves share: how agents choose, and what a joint move was worth."""

from __future__ import annotations

from hose_learning.loop import choose
from hose_learning.policies import draw_allowed
from hose_learning.tables import claim, find
from hose_mj.jit import jitable
from hose_mj.tasks import kernels


@jitable
def choose_each(rule, task, learner, memory, explores):  # type: ignore[no-untyped-def]
    """Each agent chooses alone, from its own values."""
    for agent in range(memory.actions.shape[0]):
        allowed = memory.allowed[agent]
        memory.actions[agent] = choose(task, learner, memory, agent, allowed, explores)


@jitable
def allow_fallbacks(task, learner, memory):  # type: ignore[no-untyped-def]
    """Allows an agent for which everything is vetoed the fallback, or else everything."""
    for agent in range(memory.actions.shape[0]):
        if memory.allowed[agent] == 0:
            if learner.fallback >= 0:
                memory.allowed[agent] = 1 << learner.fallback
            else:
                memory.allowed[agent] = kernels.mask(task, memory.state, agent)


@jitable
def draw_each(memory):  # type: ignore[no-untyped-def]
    """Draws an allowed action for every agent: all joint actions are equally likely."""
    for agent in range(memory.actions.shape[0]):
        memory.actions[agent] = draw_allowed(memory.allowed[agent], memory.stream)


@jitable
def get_last_value(memory, agent, module, action):  # type: ignore[no-untyped-def]
    """Returns Q(s, a) of the state that the agent's module saw before the joint move."""
    row = find(memory.table, memory.last_keys[agent, module])
    return memory.table.rows[row, action]


@jitable
def set_last_value(memory, agent, module, action, value):  # type: ignore[no-untyped-def]
    """Writes Q(s, a) of the state that the agent's module saw before the joint move."""
    row = claim(memory.table, memory.last_keys[agent, module])
    memory.table.rows[row, action] = value


@jitable
def find_highest_value(memory, key):  # type: ignore[no-untyped-def]
    """Returns max_a Q(s, a), where `memory.scores` says how many actions there are."""
    row = find(memory.table, key)
    highest = memory.table.rows[row, 0]
    for action in range(1, memory.scores.shape[0]):
        highest = max(highest, memory.table.rows[row, action])
    return highest


@jitable
def find_next_value(memory, agent, module, is_over):  # type: ignore[no-untyped-def]
    """Returns max_a' Q(s', a') of the state after the joint move; 0 if the episode is over."""
    if is_over:
        return 0.0
    return find_highest_value(memory, memory.keys[agent, module])


@jitable
def get_own_reward(learner, memory, agent, module):  # type: ignore[no-untyped-def]
    """Returns what the agent itself caused in a joint move; summed over agents, the team's."""
    return learner.rewards[memory.charged[agent], 1, module]


@jitable
def sum_team_reward(learner, memory, module):  # type: ignore[no-untyped-def]
    """Returns what a joint move was worth to the team: everything that happened, once."""
    reward = 0.0
    for agent in range(memory.actions.shape[0]):
        reward += get_own_reward(learner, memory, agent, module)
    return reward
