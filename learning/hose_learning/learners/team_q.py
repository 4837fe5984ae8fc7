"""Team Q-learning: one table of joint actions for all agents (section 3.6.1's central table).

The team is one learner that sees what all agents see and chooses for all of them: Q-learning of the
game's joint actions, which is exact and grows exponentially with the number of agents.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners.joint import (
    allow_fallbacks,
    compute_next_value,
    draw_each,
    get_last_value,
    set_last_value,
    sum_team_reward,
)
from hose_learning.learners.round_robin import get_learning_rate
from hose_learning.mediators import mediate
from hose_learning.records import EPSILON, Learner, Memory
from hose_learning.settings import LearnerSettings, get_options
from hose_learning.tables import find
from hose_mj.errors import InputError
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import Stream, draw_below, draw_unit
from hose_mj.tasks.task import Task

LARGEST_WIDTH = 1024  # most joint actions


class Team(NamedTuple):
    """The rule's constants: gamma, and how many actions each agent has."""

    discount: float
    n_actions: int


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: too many joint actions, a value module that sees what differs between agents, a
            soft max, or any option.
    """
    get_options(settings, {})
    check_team(task, settings)
    width = task.n_actions**task.n_agents
    if width > LARGEST_WIDTH:
        valid = f"at most {LARGEST_WIDTH}: fewer agents, or a learner without joint actions"
        raise InputError("number of joint actions", width, valid)
    rule = Team(float(settings.discount), task.n_actions)
    learner, memory = make_learner(task, settings, rule, generator, width=width, n_parts=1)
    return learner, memory._replace(scores=np.zeros(width))


def check_team(task: Task, settings: LearnerSettings) -> None:
    """Raises `InputError` for settings that make no sense for a team with one view."""
    if settings.exploration.policy != "epsilon-greedy":
        valid = "'epsilon-greedy' for a learner of joint actions"
        raise InputError("policy", settings.exploration.policy, valid)
    differ = {variable.name for variable in task.variables if variable.per_agent}
    for module in settings.modules:
        seen = sorted(differ.intersection(module.variables))
        if module.kind == "value" and seen and task.n_agents > 1:
            shared = [v.name for v in task.variables if not v.per_agent]
            valid = "variables that all agents see alike: " + ", ".join(shared)
            raise InputError(f"variables of the team's module {module.name!r}", seen, valid)


@jitable
def number_joint(actions: Integers, n_actions: int) -> int:
    """Returns the number of a joint action; the last agent's runs fastest."""
    joint = 0
    for agent in range(actions.shape[0]):
        joint = joint * n_actions + actions[agent]
    return joint


@jitable
def write_joint(joint: int, n_actions: int, actions: Integers) -> None:
    """Writes the actions of a joint action (n_agents,)."""
    for agent in range(actions.shape[0] - 1, -1, -1):
        actions[agent] = joint % n_actions
        joint //= n_actions


@jitable
def forbid(rule: Team, learner: Learner, memory: Memory) -> None:
    """Writes -inf as score of joint actions with a vetoed part or below a module's threshold."""
    for joint in range(memory.scores.shape[0]):
        write_joint(joint, rule.n_actions, memory.actions)
        for agent in range(memory.actions.shape[0]):
            if memory.allowed[agent] >> memory.actions[agent] & 1 == 0:
                memory.scores[joint] = -math.inf
    if learner.has_thresholds:
        for module in range(learner.bases.shape[0]):
            row = find(memory.table, memory.keys[0, module])
            for joint in range(memory.scores.shape[0]):
                if memory.table.rows[row, joint] < learner.thresholds[module]:
                    memory.scores[joint] = -math.inf


@jitable
def draw_best(scores: Floats, stream: Stream) -> int:
    """Draws one of the places with the highest score, or returns -1 if all are -inf."""
    highest, count = -math.inf, 0
    for place in range(scores.shape[0]):
        if scores[place] > highest:
            highest, count = scores[place], 0
        count += scores[place] == highest
    if highest == -math.inf:
        return -1
    left = draw_below(stream, count) if count > 1 else 0
    place = 0
    while scores[place] != highest or left > 0:
        left -= scores[place] == highest
        place += 1
    return place


@rules.choose_joint.register(Team)
@jitable
def choose_joint(rule: Team, task: Any, learner: Learner, memory: Memory, explores: bool) -> None:
    """Chooses a joint action epsilon-greedily; to explore is to hold all of them for equal."""
    allow_fallbacks(task, learner, memory)
    if explores and draw_unit(memory.stream) < memory.numbers[EPSILON]:
        memory.scores[:] = 0.0
    else:
        mediate(learner, memory, 0)
    forbid(rule, learner, memory)
    joint = draw_best(memory.scores, memory.stream)
    if joint >= 0:
        write_joint(joint, rule.n_actions, memory.actions)
    elif learner.fallback >= 0:  # thresholds leave nothing
        memory.actions[:] = learner.fallback
    else:
        draw_each(memory)


@rules.learn_joint.register(Team)
@jitable
def learn_joint(rule: Team, learner: Learner, memory: Memory, is_over: bool) -> None:
    """Moves the value of the joint action towards the team's reward and future.

    Q(s, a) <- (1 - alpha) Q(s, a) + alpha [r + gamma max_a' Q(s', a')], a = (a_1, .., a_N)
    """
    alpha = get_learning_rate(learner, memory)
    joint = number_joint(memory.actions, rule.n_actions)
    for module in range(learner.bases.shape[0]):
        following = compute_next_value(memory, 0, module, is_over)
        td_target = sum_team_reward(learner, memory, module) + rule.discount * following
        value = get_last_value(memory, 0, module, joint)
        if td_target != value:  # a row of zeros that stays so is not stored
            set_last_value(memory, 0, module, joint, value + alpha * (td_target - value))
