"""Q-learning with a second table for the risk of an undesired terminal state (section 3.2.1).

After Geibel (2001) and Geibel and Wysotzki (2005): the risk of an action is the probability that a
constraint will break, learned as an undiscounted sum of ones. Actions are chosen by
xi Q(s, a) - Q_risk(s, a); xi is 0 until the risk has settled, then it rises for as long as the risk
stays below a bound omega.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners import round_robin
from hose_learning.learners.round_robin import learn
from hose_learning.modules import Module
from hose_learning.policies import compute_best, find_lowest_bit
from hose_learning.records import EPISODES, XI, Learner, Memory
from hose_learning.settings import LearnerSettings, check_range, get_options
from hose_learning.tables import find
from hose_mj.errors import InputError
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats
from hose_mj.tasks.task import Task

GOAL, RISK = 0, 1
OPTIONS = {"risk_bound": 0.1, "xi_step": 1e-3, "xi_most": 1.0, "settle_episodes": 2000}
"""omega, what xi rises by in an episode, its highest value, and episodes at xi = 0 before that."""
AVERAGED_EPISODES = 100


class Risk(NamedTuple):
    """The rule's constants."""

    discounts: Floats  # gamma^k for the goal, 1 for the risk (2, n_agents + 1)
    # risk_bound, xi_step, xi_most, settle_episodes: see `OPTIONS`.
    risk_bound: float
    xi_step: float
    xi_most: float
    settle_episodes: int


class Measured(NamedTuple):
    """The risk of an episode: its running mean, and that of the first move (2,)."""

    risk: Floats


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; its risk module sees what the value module sees.

    Raises:
        InputError: an option out of range (see `OPTIONS`), or more than one value module.
    """
    options = get_options(settings, OPTIONS)
    check_range("risk_bound", options["risk_bound"], 0.0, 1.0)
    check_range("xi_step", options["xi_step"], 0.0, 1e9)
    check_range("xi_most", options["xi_most"], 0.0, 1e9)
    check_range("settle_episodes", options["settle_episodes"], 0, 1e12)
    values = settings.select("value")
    if len(values) > 1:
        names = [module.name for module in values]
        raise InputError("modules", names, "one value module alone for risk-q")
    goal = values[0]
    risk = Module(name="risk", variables=goal.variables)
    others = settings.select("veto")
    settings = dataclasses.replace(settings, modules=(goal, risk, *others))
    discounts = np.ones((2, task.n_agents + 1))
    discounts[GOAL] = float(settings.discount) ** np.arange(task.n_agents + 1.0)
    rule = Risk(
        discounts,
        float(options["risk_bound"]),
        float(options["xi_step"]),
        float(options["xi_most"]),
        int(options["settle_episodes"]),
    )
    learner, memory = make_learner(task, settings, rule, generator, Measured(np.zeros(2)))
    breaks = (np.arange(len(learner.rewards)) & task.kernel.violations) != 0
    learner.rewards[:, :, RISK] = breaks[:, None]
    return learner, memory


@rules.score.register(Risk)
@jitable
def score(rule: Risk, learner: Learner, memory: Memory, agent: int) -> None:
    """Writes the scores xi Q(s, a) - Q_risk(s, a)."""
    goal = find(memory.table, memory.keys[agent, GOAL])
    risk = find(memory.table, memory.keys[agent, RISK])
    rows = memory.table.rows
    for action in range(memory.scores.shape[0]):
        value = memory.numbers[XI] * rows[goal, action]
        memory.scores[action] = value - rows[risk, action]


@rules.on_observe.register(Risk)
@jitable
def on_observe(rule: Risk, learner: Learner, memory: Memory, agent: int) -> None:
    """Both tables learn from the action a* that is best now, by goal and risk together.

    Q(s, a) <- r + gamma Q(s', a*), Q_risk(s, a) <- [a constraint broke] + Q_risk(s', a*)
    """
    score(rule, learner, memory, agent)
    best = find_lowest_bit(compute_best(memory.scores, (1 << memory.scores.shape[0]) - 1))
    if memory.steps_since_action[agent] < 0:
        if agent == 0:
            row = find(memory.table, memory.keys[agent, RISK])
            memory.own.risk[1] = memory.table.rows[row, best]
        return
    for module in range(2):
        row = find(memory.table, memory.keys[agent, module])
        following = rule.discounts[module, -1] * memory.table.rows[row, best]
        learn(learner, memory, agent, module, following)


@rules.accumulate.register(Risk)
@jitable
def accumulate(
    rule: Risk, learner: Learner, memory: Memory, agent: int, action: int, events: int
) -> None:
    """Adds rewards and broken constraints to the cycle of everyone who has moved."""
    for module in range(2):
        memory.rewards[agent, module] = 0.0
    for other in range(memory.steps_since_action.shape[0]):
        steps = memory.steps_since_action[other]
        if steps >= 0:
            for module in range(2):
                reward = learner.rewards[events, int(other == agent), module]
                memory.rewards[other, module] += rule.discounts[module, steps] * reward
            memory.steps_since_action[other] = steps + 1


@rules.end_episode.register(Risk)
@jitable
def end_episode(rule: Risk, learner: Learner, memory: Memory, is_over: bool) -> None:
    """After a terminal state nothing follows; xi moves towards the bound of the risk."""
    round_robin.end_episode(rule, learner, memory, is_over)
    risk = memory.own.risk
    risk[0] += (risk[1] - risk[0]) / AVERAGED_EPISODES
    if memory.counters[EPISODES] >= rule.settle_episodes:
        step = rule.xi_step if risk[0] <= rule.risk_bound else -rule.xi_step
        memory.numbers[XI] = min(max(memory.numbers[XI] + step, 0.0), rule.xi_most)
