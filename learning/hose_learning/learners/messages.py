"""Distributed round-robin Q-learning by messages (Algorithm 6.2).

Each agent has a table of its own. The one whose turn comes tells its predecessor the best value
that it sees, and with this message the predecessor learns.
"""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners.round_robin import end_episode, learn
from hose_learning.mediators import compute_highest
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, get_options
from hose_learning.tables import find
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats
from hose_mj.tasks.task import Task


class Messages(NamedTuple):
    """The rule's constant: gamma."""

    discount: float


class Inbox(NamedTuple):
    """The last message to each agent, a value for each of its modules (n_agents, n_modules)."""

    values: Floats


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`."""
    get_options(settings, {})
    n_values = len(settings.select("value"))
    own = Inbox(np.zeros((task.n_agents, n_values)))
    return make_learner(task, settings, Messages(float(settings.discount)), generator, own)


@rules.on_observe.register(Messages)
@jitable
def on_observe(rule: Messages, learner: Learner, memory: Memory, agent: int) -> None:
    """Agent j sends max_a' Q^j(s_(t+1), a') to agent i, which has waited for it."""
    n_agents = memory.steps_since_action.shape[0]
    receiver = agent - 1 if agent > 0 else n_agents - 1
    if memory.steps_since_action[receiver] < 0:
        return
    for module in range(learner.bases.shape[0]):
        row = find(memory.table, memory.keys[agent, module])
        memory.own.values[receiver, module] = compute_highest(memory.table.rows, row)
    for module in range(learner.bases.shape[0]):
        following = rule.discount * memory.own.values[receiver, module]
        learn(learner, memory, receiver, module, following)
    memory.steps_since_action[receiver] = -1


@rules.accumulate.register(Messages)
@jitable
def accumulate(
    rule: Messages, learner: Learner, memory: Memory, agent: int, action: int, events: int
) -> None:
    """Agent i notes its reward r_t."""
    for module in range(learner.bases.shape[0]):
        memory.rewards[agent, module] = learner.rewards[events, 1, module]


# After a terminal state the message is zero, as in Algorithm 6.3.
rules.end_episode.register(Messages)(end_episode)
