"""Distributed Q-learning (section 3.6.1; Lauer and Riedmiller 2000).

Each agent knows its own actions alone and takes the best that ever followed one of them for what
follows it: its teammates will find their part. Values only rise, so there is no learning rate.
"""

import math
from typing import NamedTuple

from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners import joint
from hose_learning.mediators import mediate
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, get_options
from hose_learning.tables import find
from hose_mj.errors import InputError
from hose_mj.jit import jitable
from hose_mj.tasks.checks import check_choice
from hose_mj.tasks.task import Task

OPTIONS = {"keeps_policy": "no"}
"""Whether an agent goes on with the action that first had its state's highest value ("yes"): so the
paper's agents agree where several joint actions are best. The thesis leaves it out ("no")."""


class DistributedQ(NamedTuple):
    """The rule's constants."""

    discount: float  # gamma
    keeps_policy: bool  # see `OPTIONS`; the action, counted from 1, then stands last in each row


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: a wrong option (see `OPTIONS`), or a policy to keep with several value modules
            or a soft max.
    """
    keeps_policy = get_options(settings, OPTIONS)["keeps_policy"]
    check_choice("keeps_policy", keeps_policy, ("no", "yes"))
    n_values = len(settings.select("value"))
    if keeps_policy == "yes" and (n_values > 1 or settings.exploration.policy == "soft-max"):
        valid = "'no' with several value modules or a soft max, which know no action to keep"
        raise InputError("keeps_policy", keeps_policy, valid)
    rule = DistributedQ(float(settings.discount), keeps_policy == "yes")
    width = task.n_actions + rule.keeps_policy
    return make_learner(task, settings, rule, generator, width=width)


rules.choose_joint.register(DistributedQ)(joint.choose_each)


@rules.score.register(DistributedQ)
@jitable
def score(rule: DistributedQ, learner: Learner, memory: Memory, agent: int) -> None:
    """Writes the scores of the actions; that of the kept one is above all others."""
    mediate(learner, memory, agent)
    if rule.keeps_policy:
        row = find(memory.table, memory.keys[agent, 0])
        kept = int(memory.table.rows[row, memory.scores.shape[0]]) - 1
        if kept >= 0:
            memory.scores[kept] = math.inf


@rules.learn_joint.register(DistributedQ)
@jitable
def learn_joint(rule: DistributedQ, learner: Learner, memory: Memory, is_over: bool) -> None:
    """Raises the value of each agent's action to what it was worth now, if that is more.

    Q^i(s, a) <- max {Q^i(s, a), r + gamma max_a' Q^i(s', a')}
    """
    for agent in range(memory.actions.shape[0]):
        action = memory.actions[agent]
        for module in range(learner.bases.shape[0]):
            following = joint.compute_next_value(memory, agent, module, is_over)
            td_target = memory.rewards[agent, module] + rule.discount * following
            if td_target > joint.get_last_value(memory, agent, module, action):
                highest = joint.compute_highest_value(memory, memory.last_keys[agent, module])
                joint.set_last_value(memory, agent, module, action, td_target)
                if rule.keeps_policy and td_target > highest:
                    kept = memory.scores.shape[0]
                    joint.set_last_value(memory, agent, module, kept, action + 1.0)
