"""Undesired state-action prediction (Algorithms 8.1 and 8.3): a classifier vetoes for the learner.

Round-robin Q-learning, of one agent (8.1) or several (8.3). Each move is an instance for the
agent's classifier, which is fitted anew every so often; from then on an action that it holds for
undesired with probability 1/2 or more is not taken.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hose_learning import rules
from hose_learning.learner import make_learner
from hose_learning.learners.round_robin import add_rewards, finish, meet
from hose_learning.prediction.usap import UndesiredPredictor
from hose_learning.prediction.usap_kernels import (
    SAFE,
    UNDESIRED,
    Buffer,
    Forest,
    add_instance,
    compute_veto_mask,
)
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, check_range, get_options
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats
from hose_mj.tasks.task import Task

OPTIONS: dict[str, float | str] = {"classifier": "tree", "minimum": 5, "capacity": 1000}
"""See `prediction.usap.UndesiredPredictor`. The thesis keeps 100 instances of each action and
class, with which the taxi is not learned."""


class Usap(NamedTuple):
    """The rule's constants.

    Attributes:
        discounts: 1, gamma, .., gamma^N (n_agents + 1,).
        undesired: the events that make a move undesired.
    """

    discounts: Floats
    undesired: int


class Prediction(NamedTuple):
    """What the classifiers learn from and what they learned, and their random numbers (1,)."""

    buffer: Buffer
    forest: Forest
    stream: npt.NDArray[np.uint64]


def make(
    task: Task, settings: LearnerSettings, generator: np.random.Generator
) -> tuple[Learner, Memory]:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: a wrong option (see `OPTIONS`).
    """
    predictor = _make_predictor(task, settings, generator)
    own = Prediction(predictor.buffer, predictor.forest, predictor.stream)
    discounts = float(settings.discount) ** np.arange(task.n_agents + 1.0)
    rule = Usap(discounts, int(task.kernel.violations))
    return make_learner(task, settings, rule, generator, own)


def _make_predictor(
    task: Task, settings: LearnerSettings, generator: np.random.Generator
) -> UndesiredPredictor:
    options: dict[str, Any] = get_options(settings, OPTIONS)
    for name in ("minimum", "capacity"):
        check_range(name, options[name], 1, 10**6)
        options[name] = int(options[name])
    return UndesiredPredictor(task, generator, **options)


def refresh(task: Task, settings: LearnerSettings, memory: Memory) -> None:
    """Fits the classifiers of all agents to their instances."""
    predictor = _make_predictor(task, settings, np.random.default_rng(0))
    predictor.buffer, predictor.forest, predictor.stream = memory.own
    for agent in range(task.n_agents):
        predictor.fit(agent)


@rules.restrict.register(Usap)
@jitable
def restrict(rule, memory, agent, allowed):  # type: ignore[no-untyped-def]
    """Leaves the actions with p(s, a) < 1/2."""
    return allowed & ~compute_veto_mask(memory.own.forest, memory.values, agent)


@rules.gather.register(Usap)
@jitable
def gather(rule, learner, memory, agent, action, events):  # type: ignore[no-untyped-def]
    """Keeps the instance <s_t, a_t, omega(r_t)>, and adds rewards as in Algorithm 6.3."""
    label = UNDESIRED if events & rule.undesired else SAFE
    own = memory.own
    add_instance(own.buffer, memory.values, agent, action, label, own.stream)
    add_rewards(rule, learner, memory, agent, events)


# All else is as in Algorithm 6.3.
rules.meet.register(Usap)(meet)
rules.finish.register(Usap)(finish)
