"""Distributed round-robin Q-learning by messages (Algorithm 6.2).

Each agent has a table of its own. The one whose turn comes tells its predecessor the best value
that it sees, and with this message the predecessor learns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_learning import rules
from hose_learning.learner import make_learner
from hose_learning.learners.round_robin import learn
from hose_learning.mediators import find_highest
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


def make(
    task: Task, settings: LearnerSettings, generator: np.random.Generator
) -> tuple[Learner, Memory]:
    """Makes the learner; see `hose_learning.learner.make_learner`."""
    get_options(settings, {})
    n_values = sum(module.kind == "value" for module in settings.modules)
    own = Inbox(np.zeros((task.n_agents, n_values)))
    return make_learner(task, settings, Messages(float(settings.discount)), generator, own)


@rules.meet.register(Messages)
@jitable
def meet(rule, learner, memory, agent):  # type: ignore[no-untyped-def]
    """Agent j sends max_a' Q^j(s_(t+1), a') to agent i, which has waited for it."""
    n_agents = memory.waited.shape[0]
    receiver = agent - 1 if agent > 0 else n_agents - 1
    if memory.waited[receiver] < 0:
        return
    for module in range(learner.bases.shape[0]):
        row = find(memory.table, memory.keys[agent, module])
        memory.own.values[receiver, module] = find_highest(memory.table.rows, row)
    for module in range(learner.bases.shape[0]):
        following = rule.discount * memory.own.values[receiver, module]
        learn(learner, memory, receiver, module, following)
    memory.waited[receiver] = -1


@rules.gather.register(Messages)
@jitable
def gather(rule, learner, memory, agent, action, events):  # type: ignore[no-untyped-def]
    """Agent i notes its reward r_t."""
    for module in range(learner.bases.shape[0]):
        memory.rewards[agent, module] = learner.rewards[events, 1, module]


@rules.finish.register(Messages)
@jitable
def finish(rule, learner, memory, is_over):  # type: ignore[no-untyped-def]
    """After a terminal state the message is zero."""
    for agent in range(memory.waited.shape[0]):
        if is_over and memory.waited[agent] >= 0:
            for module in range(learner.bases.shape[0]):
                learn(learner, memory, agent, module, 0.0)
        memory.waited[agent] = -1
