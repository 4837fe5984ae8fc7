"""Communication-free distributed round-robin Q-learning (Algorithms 4.1 and 6.3).

Each agent learns alone: what follows its move until its turn comes back, a cycle of rewards and the
state it then sees, is one step of its own Q-learning.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.mediators import compute_highest
from hose_learning.records import MOVES, Learner, Memory
from hose_learning.settings import LearnerSettings, get_options
from hose_learning.tables import claim, find
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats
from hose_mj.tasks.task import Task


class RoundRobin(NamedTuple):
    """The rule's constants.

    Attributes:
        discounts: of the reward k moves after one's own (k < N), and of the state after the cycle
            (k = N) (n_agents + 1,): gamma^k in eq. 6.4; 1, .., 1, gamma in Algorithm 4.1.
    """

    discounts: Floats


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner of eq. 6.4, which discounts every move (see `make_learner`)."""
    get_options(settings, {})
    discounts = float(settings.discount) ** np.arange(task.n_agents + 1.0)
    return make_learner(task, settings, RoundRobin(discounts), generator)


def make_cycle_sum(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner of Algorithm 4.1, which discounts whole cycles (see `make_learner`)."""
    get_options(settings, {})
    discounts = np.ones(task.n_agents + 1)
    discounts[-1] = settings.discount
    return make_learner(task, settings, RoundRobin(discounts), generator)


@jitable
def get_learning_rate(learner: Learner, memory: Memory) -> float:
    """Returns alpha_t."""
    return learner.learning_rate / (1.0 + learner.learning_rate_decay * memory.counters[MOVES])


@jitable
def learn(learner: Learner, memory: Memory, agent: int, module: int, following: float) -> None:
    """Moves the value of the agent's last action towards its rewards and what follows.

    Q(s, a) <- (1 - alpha) Q(s, a) + alpha [rewards of the cycle + following]     (eq. 6.4)
    """
    key, action = memory.last_keys[agent, module], memory.actions[agent]
    td_target = memory.rewards[agent, module] + following
    rows = memory.table.rows
    if rows[find(memory.table, key), action] == td_target:
        return  # a row of zeros that stays so is not stored
    row = claim(memory.table, key)
    rows[row, action] += get_learning_rate(learner, memory) * (td_target - rows[row, action])


@rules.on_observe.register(RoundRobin)
@jitable
def on_observe(rule: Any, learner: Learner, memory: Memory, agent: int) -> None:
    """The cycle is complete: s_(t+N) is what the agent sees now."""
    if memory.steps_since_action[agent] < 0:
        return
    for module in range(learner.bases.shape[0]):
        row = find(memory.table, memory.keys[agent, module])
        highest = compute_highest(memory.table.rows, row)
        learn(learner, memory, agent, module, rule.discounts[-1] * highest)


@jitable
def add_rewards(rule: Any, learner: Learner, memory: Memory, agent: int, events: int) -> None:
    """Adds r_(t+k), discounted, to the cycle of everyone who has moved; the agent's begins."""
    for module in range(learner.bases.shape[0]):
        memory.rewards[agent, module] = 0.0
    for other in range(memory.steps_since_action.shape[0]):
        steps = memory.steps_since_action[other]
        if steps >= 0:
            for module in range(learner.bases.shape[0]):
                reward = learner.rewards[events, int(other == agent), module]
                memory.rewards[other, module] += rule.discounts[steps] * reward
            memory.steps_since_action[other] = steps + 1


@rules.accumulate.register(RoundRobin)
@jitable
def accumulate(
    rule: RoundRobin, learner: Learner, memory: Memory, agent: int, action: int, events: int
) -> None:
    """The others' rewards of a cycle count as one's own."""
    add_rewards(rule, learner, memory, agent, events)


@rules.end_episode.register(RoundRobin)
@jitable
def end_episode(rule: Any, learner: Learner, memory: Memory, is_over: bool) -> None:
    """After a terminal state nothing follows; a cycle that was cut off teaches nothing."""
    if is_over:
        for agent in range(memory.steps_since_action.shape[0]):
            if memory.steps_since_action[agent] >= 0:
                for module in range(learner.bases.shape[0]):
                    learn(learner, memory, agent, module, 0.0)
    memory.steps_since_action[:] = -1
