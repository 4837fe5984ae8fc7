"""Distributed value functions (section 3.6.1; Schneider, Wong, Moore and Riedmiller 1999).

Each agent learns from its own reward and a weighted mean of what it and its neighbours along the
hose expect from then on; so rewards reach all agents, the later the farther they are away.
"""

from typing import NamedTuple

from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners import joint
from hose_learning.learners.round_robin import get_learning_rate
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats
from hose_mj.tasks.task import Task


class DistributedValues(NamedTuple):
    """The rule's constants."""

    discount: float  # gamma
    weights: Floats  # f(i, j), what agent j weighs for agent i (n_agents, n_agents)


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; its options are those of `distributed_rewards`.

    Raises:
        InputError: a wrong option.
    """
    rule = DistributedValues(float(settings.discount), joint.make_weights(task.n_agents, settings))
    return make_learner(task, settings, rule, generator)


rules.choose_joint.register(DistributedValues)(joint.choose_each)


@rules.learn_joint.register(DistributedValues)
@jitable
def learn_joint(rule: DistributedValues, learner: Learner, memory: Memory, is_over: bool) -> None:
    """Moves the value of each agent's action towards its reward and the neighbours' future.

    Q^i(s, a) <- (1 - alpha) Q^i(s, a) + alpha [r_i + gamma sum_j f(i, j) max_a' Q^j(s', a')]
    """
    n_agents = memory.actions.shape[0]
    td_targets = memory.rewards  # all are complete before any value changes
    for agent in range(n_agents):
        for module in range(learner.bases.shape[0]):
            for other in range(n_agents):
                following = joint.compute_next_value(memory, other, module, is_over)
                discount = rule.discount * rule.weights[agent, other]
                td_targets[agent, module] += discount * following
    alpha = get_learning_rate(learner, memory)
    for agent in range(n_agents):
        action = memory.actions[agent]
        for module in range(learner.bases.shape[0]):
            value = joint.get_last_value(memory, agent, module, action)
            td_target = td_targets[agent, module]
            if td_target != value:  # a row of zeros that stays so is not stored
                value += alpha * (td_target - value)
                joint.set_last_value(memory, agent, module, action, value)
