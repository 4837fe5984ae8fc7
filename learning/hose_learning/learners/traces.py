"""Round-robin Q-learning with optimistic replacing traces (the author's experiment of 2015).

As in Algorithm 6.3 each agent learns from whole cycles, but only from good surprises, and then for
its last moves too, each the less the longer ago it was.
"""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners.round_robin import add_rewards, get_learning_rate
from hose_learning.mediators import compute_highest
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, check_range, get_options
from hose_learning.tables import FIRST_CAPACITY, claim, find
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.task import Task

OPTIONS = {"trace_decay": 0.9, "n_kept": 50}
"""lambda, and how many moves of an agent are remembered."""


class Traces(NamedTuple):
    """The rule's constants."""

    discounts: Floats  # 1, gamma, .., gamma^N (n_agents + 1,)
    trace_decay: float  # lambda


class EligibilityTrace(NamedTuple):
    """The last moves of each agent, the latest one first."""

    keys: Integers  # what its modules saw (n_agents, n_kept, n_modules)
    actions: Integers  # what it did (n_agents, n_kept)
    ages: Integers  # moves of its own since then (n_agents, n_kept)
    lengths: Integers  # how many are remembered (n_agents,)


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: an option out of range (see `OPTIONS`).
    """
    options = get_options(settings, OPTIONS)
    check_range("trace_decay", options["trace_decay"], 0.0, 1.0)
    n_agents = task.n_agents
    n_values = len(settings.select("value"))
    # One move may write the whole trail of every agent, into the free half of a hashed table.
    most = FIRST_CAPACITY // 2 // (n_agents * n_values)
    check_range("n_kept", options["n_kept"], 1, most)
    n_kept = int(options["n_kept"])
    own = EligibilityTrace(
        keys=np.zeros((n_agents, n_kept, n_values), np.int64),
        actions=np.zeros((n_agents, n_kept), np.int64),
        ages=np.zeros((n_agents, n_kept), np.int64),
        lengths=np.zeros(n_agents, np.int64),
    )
    discounts = float(settings.discount) ** np.arange(n_agents + 1.0)
    rule = Traces(discounts, float(options["trace_decay"]))
    return make_learner(task, settings, rule, generator, own)


@jitable
def is_last(memory: Memory, agent: int, place: int) -> bool:
    """Whether a remembered move is the agent's last action in what looks like the same state."""
    trail = memory.own
    same = trail.actions[agent, place] == memory.actions[agent]
    for module in range(trail.keys.shape[2]):
        same &= trail.keys[agent, place, module] == memory.last_keys[agent, module]
    return same


@jitable
def remember(memory: Memory, agent: int) -> None:
    """Puts the agent's last move first; it replaces an earlier one like it, or the oldest."""
    trail = memory.own
    length = trail.lengths[agent]
    free = 0
    while free < length and not is_last(memory, agent, free):
        free += 1
    if free == length:
        length = min(length + 1, trail.ages.shape[1])
        free = length - 1
    for place in range(length):
        trail.ages[agent, place] += 1
    for place in range(free, 0, -1):
        trail.actions[agent, place] = trail.actions[agent, place - 1]
        trail.ages[agent, place] = trail.ages[agent, place - 1]
        for module in range(trail.keys.shape[2]):
            trail.keys[agent, place, module] = trail.keys[agent, place - 1, module]
    trail.actions[agent, 0] = memory.actions[agent]
    trail.ages[agent, 0] = 0
    for module in range(trail.keys.shape[2]):
        trail.keys[agent, 0, module] = memory.last_keys[agent, module]
    trail.lengths[agent] = length


@jitable
def learn(
    rule: Traces, learner: Learner, memory: Memory, agent: int, module: int, following: float
) -> None:
    """Raises the values of all remembered moves when the last cycle was better than expected.

    delta = sum_k gamma^k r_(t+k) + gamma^N max_a' Q(s_(t+N), a') - Q(s_t, a_t), and if delta > 0
    Q(s, a) <- Q(s, a) + alpha delta (gamma^N lambda)^age for every (s, a) of the trail
    """
    trail, table = memory.own, memory.table
    row = find(table, memory.last_keys[agent, module])
    old = table.rows[row, memory.actions[agent]]
    delta = memory.rewards[agent, module] + following - old
    if delta <= 0.0:
        return
    alpha = get_learning_rate(learner, memory)
    share = 1.0
    age = 0
    for place in range(trail.lengths[agent]):
        while age < trail.ages[agent, place]:
            share *= rule.discounts[-1] * rule.trace_decay
            age += 1
        row = claim(table, trail.keys[agent, place, module])
        table.rows[row, trail.actions[agent, place]] += alpha * delta * share


@rules.on_observe.register(Traces)
@jitable
def on_observe(rule: Traces, learner: Learner, memory: Memory, agent: int) -> None:
    """The cycle is complete: s_(t+N) is what the agent sees now."""
    if memory.steps_since_action[agent] < 0:
        return
    for module in range(learner.bases.shape[0]):
        row = find(memory.table, memory.keys[agent, module])
        highest = compute_highest(memory.table.rows, row)
        learn(rule, learner, memory, agent, module, rule.discounts[-1] * highest)


@rules.accumulate.register(Traces)
@jitable
def accumulate(
    rule: Traces, learner: Learner, memory: Memory, agent: int, action: int, events: int
) -> None:
    """Remembers the move, and adds its rewards to the cycle of everyone who has moved."""
    remember(memory, agent)
    add_rewards(rule, learner, memory, agent, events)


@rules.end_episode.register(Traces)
@jitable
def end_episode(rule: Traces, learner: Learner, memory: Memory, is_over: bool) -> None:
    """After a terminal state nothing follows; the trails end with the episode."""
    for agent in range(memory.steps_since_action.shape[0]):
        if is_over and memory.steps_since_action[agent] >= 0:
            for module in range(learner.bases.shape[0]):
                learn(rule, learner, memory, agent, module, 0.0)
        memory.steps_since_action[agent] = -1
        memory.own.lengths[agent] = 0
