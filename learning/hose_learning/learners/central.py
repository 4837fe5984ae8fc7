"""Centralised Q-learning of a cooperative round-robin game (Algorithm 6.1).

One learner chooses for whoever's turn it is: the turn is one more variable of the state, and what
follows a move is the next agent's best value.
"""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners.round_robin import get_learning_rate
from hose_learning.mediators import compute_highest
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, get_options
from hose_learning.tables import claim, find
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task


class Central(NamedTuple):
    """The rule's constant: gamma."""

    discount: float


class Last(NamedTuple):
    """Whose move was the last one, or -1 (1,)."""

    mover: Integers


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`."""
    get_options(settings, {})
    rule, own = Central(float(settings.discount)), Last(np.full(1, -1, np.int64))
    return make_learner(task, settings, rule, generator, own)


@jitable
def learn_last(
    rule: Central, learner: Learner, memory: Memory, module: int, following: float
) -> None:
    """Learns from the last move, of agent i, once the best value that follows is known.

    Q(s, a, i) <- (1 - alpha) Q(s, a, i) + alpha [r + gamma max_a' Q(s', a', j)]
    """
    i = memory.own.mover[0]
    row = claim(memory.table, memory.last_keys[i, module])
    old = memory.table.rows[row, memory.actions[i]]
    td_target = memory.rewards[i, module] + rule.discount * following
    new = old + get_learning_rate(learner, memory) * (td_target - old)
    memory.table.rows[row, memory.actions[i]] = new


@rules.on_observe.register(Central)
@jitable
def on_observe(rule: Central, learner: Learner, memory: Memory, agent: int) -> None:
    """The state after the last move is known, and whose turn it is: agent j's."""
    if memory.own.mover[0] >= 0:
        for module in range(learner.bases.shape[0]):
            row = find(memory.table, memory.keys[agent, module])
            highest = compute_highest(memory.table.rows, row)
            learn_last(rule, learner, memory, module, highest)


@rules.accumulate.register(Central)
@jitable
def accumulate(
    rule: Central, learner: Learner, memory: Memory, agent: int, action: int, events: int
) -> None:
    """Notes the reward r of the move."""
    memory.own.mover[0] = agent
    for module in range(learner.bases.shape[0]):
        memory.rewards[agent, module] = learner.rewards[events, 1, module]


@rules.end_episode.register(Central)
@jitable
def end_episode(rule: Central, learner: Learner, memory: Memory, is_over: bool) -> None:
    """After a terminal state nothing follows."""
    if is_over:
        for module in range(learner.bases.shape[0]):
            learn_last(rule, learner, memory, module, 0.0)
    memory.own.mover[0] = -1
