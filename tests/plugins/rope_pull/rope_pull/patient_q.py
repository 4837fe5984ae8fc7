"""Q-learning of agents that move at once: what speaks against an action counts by half."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from hose_learning import rules
from hose_learning.learner import make_learner
from hose_learning.learners.joint import (
    choose_each,
    compute_next_value,
    get_last_value,
    set_last_value,
)
from hose_learning.learners.round_robin import get_learning_rate
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings

from hose_mj.jit import jitable
from hose_mj.tasks.task import Task


class Patient(NamedTuple):
    """The rule's constant: gamma."""

    discount: float


def make(
    task: Task, settings: LearnerSettings, generator: np.random.Generator
) -> tuple[Learner, Memory]:
    """Makes the learner; see `hose_learning.learner.make_learner`."""
    return make_learner(task, settings, Patient(float(settings.discount)), generator)


rules.choose_joint.register(Patient)(choose_each)


@rules.learn_joint.register(Patient)
@jitable
def learn_joint(rule: Patient, learner: Learner, memory: Memory, is_over: bool) -> None:
    """Moves the value of each agent's action towards its target."""
    for agent in range(memory.actions.shape[0]):
        action = memory.actions[agent]
        for module in range(learner.bases.shape[0]):
            following = compute_next_value(memory, agent, module, is_over)
            target = memory.rewards[agent, module] + rule.discount * following
            value = get_last_value(memory, agent, module, action)
            rate = get_learning_rate(learner, memory) * (1.0 if target > value else 0.5)
            set_last_value(memory, agent, module, action, value + rate * (target - value))
