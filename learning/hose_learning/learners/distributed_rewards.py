"""Distributed rewards (section 3.6.1; Schneider, Wong, Moore and Riedmiller 1999).

Each agent learns alone, from a weighted mean of its own reward and those of its neighbours along
the hose.
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


class DistributedRewards(NamedTuple):
    """The rule's constants."""

    discount: float  # gamma
    weights: Floats  # f(i, j), what agent j weighs for agent i (n_agents, n_agents)


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: a wrong option (see `joint.NEIGHBOUR_OPTIONS`).
    """
    rule = DistributedRewards(float(settings.discount), joint.make_weights(task.n_agents, settings))
    return make_learner(task, settings, rule, generator)


rules.choose_joint.register(DistributedRewards)(joint.choose_each)


@rules.learn_joint.register(DistributedRewards)
@jitable
def learn_joint(rule: DistributedRewards, learner: Learner, memory: Memory, is_over: bool) -> None:
    """Moves the value of each agent's action towards the neighbours' rewards and its own future.

    Q^i(s, a) <- (1 - alpha) Q^i(s, a) + alpha [sum_j f(i, j) r_j + gamma max_a' Q^i(s', a')]
    """
    alpha = get_learning_rate(learner, memory)
    for agent in range(memory.actions.shape[0]):
        action = memory.actions[agent]
        for module in range(learner.bases.shape[0]):
            td_target = rule.discount * joint.compute_next_value(memory, agent, module, is_over)
            for other in range(memory.actions.shape[0]):
                td_target += rule.weights[agent, other] * memory.rewards[other, module]
            value = joint.get_last_value(memory, agent, module, action)
            if td_target != value:  # a row of zeros that stays so is not stored
                value += alpha * (td_target - value)
                joint.set_last_value(memory, agent, module, action, value)
