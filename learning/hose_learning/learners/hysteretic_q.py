"""Hysteretic Q-learning (Matignon, Laurent and Le Fort-Piat 2007).

Independent learners that trust good news more than bad news, which may be a teammate's exploration:
a value rises with the learning rate alpha and falls with a smaller one, beta.
"""

from typing import NamedTuple

from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners import joint
from hose_learning.learners.round_robin import get_learning_rate
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, check_range, get_options
from hose_mj.jit import jitable
from hose_mj.tasks.task import Task

OPTIONS = {"beta_ratio": 0.1}
"""beta / alpha: 1 for independent Q-learning, 0 for an optimist that never forgets."""


class Hysteretic(NamedTuple):
    """The rule's constants: gamma and beta / alpha."""

    discount: float
    beta_ratio: float


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: a wrong option (see `OPTIONS`).
    """
    beta_ratio = get_options(settings, OPTIONS)["beta_ratio"]
    check_range("beta_ratio", beta_ratio, 0.0, 1.0)
    rule = Hysteretic(float(settings.discount), float(beta_ratio))
    return make_learner(task, settings, rule, generator)


rules.choose_joint.register(Hysteretic)(joint.choose_each)


@rules.learn_joint.register(Hysteretic)
@jitable
def learn_joint(rule: Hysteretic, learner: Learner, memory: Memory, is_over: bool) -> None:
    """Moves the value of each agent's action up fast or down slowly.

    delta = r + gamma max_a' Q^i(s', a') - Q^i(s, a)
    Q^i(s, a) <- Q^i(s, a) + (alpha if delta > 0, else beta) delta
    """
    alpha = get_learning_rate(learner, memory)
    for agent in range(memory.actions.shape[0]):
        action = memory.actions[agent]
        for module in range(learner.bases.shape[0]):
            following = joint.compute_next_value(memory, agent, module, is_over)
            td_target = memory.rewards[agent, module] + rule.discount * following
            value = joint.get_last_value(memory, agent, module, action)
            delta = td_target - value
            rate = alpha if delta > 0.0 else rule.beta_ratio * alpha
            if rate * delta != 0.0:  # a row of zeros that stays so is not stored
                joint.set_last_value(memory, agent, module, action, value + rate * delta)
