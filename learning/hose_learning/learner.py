"""Makes a learner's records from its settings."""

from __future__ import annotations

from typing import Any

import numpy as np

from hose_learning.mediators import MEDIATORS
from hose_learning.modules import (
    make_action_masks,
    make_arrays,
    make_event_masks,
    make_module_rewards,
)
from hose_learning.records import (
    EPSILON,
    FRESH,
    N_COUNTERS,
    N_NUMBERS,
    TEMPERATURE,
    Learner,
    Memory,
)
from hose_learning.settings import POLICIES, LearnerSettings
from hose_learning.tables import make_table
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task


def make_learner(
    task: Task,
    settings: LearnerSettings,
    rule: Any,
    generator: np.random.Generator,
    own: Any = (),
    width: int | None = None,
    n_parts: int | None = None,
) -> tuple[Learner, Memory]:
    """Makes a learner that has learned nothing, and its memory.

    Args:
        task: the task it is for.
        settings: its settings.
        rule: record of its update rule.
        generator: seeds the choices and the resets.
        own: what the rule keeps beside the tables, a NamedTuple of arrays.
        width: length of a row of Q-values; by default the number of actions.
        n_parts: tables of each value module; by default one for each agent.

    Raises:
        InputError: a module names what the task does not have, or sees too much.
    """
    values = [module for module in settings.modules if module.kind == "value"]
    vetoes = [module for module in settings.modules if module.kind == "veto"]
    n_agents, n_actions = task.n_agents, task.n_actions
    seen = make_arrays(task, values, n_parts or n_agents)
    vetoed = make_arrays(task, vetoes, n_agents)
    thresholds = np.array([-np.inf if m.threshold is None else m.threshold for m in values])
    exploration = settings.exploration
    has_none = settings.fallback == "none" and "none" in task.action_names
    learner = Learner(
        rule=rule,
        columns=seen.columns,
        strides=seen.strides,
        bases=seen.bases,
        rewards=make_module_rewards(task, values),
        thresholds=thresholds,
        has_thresholds=bool(np.isfinite(thresholds).any()),
        veto_columns=vetoed.columns,
        veto_strides=vetoed.strides,
        veto_bases=vetoed.bases,
        veto_events=make_event_masks(task, vetoes),
        veto_actions=make_action_masks(task, vetoes),
        shares_vetoes=settings.share_vetoes,
        worth=task.kernel.reward_table.sum(axis=1),
        mediator=MEDIATORS[settings.mediator],
        policy=POLICIES.index(exploration.policy),
        fallback=task.action_names.index("none") if has_none else -1,
        learning_rate=float(settings.learning_rate),
        learning_rate_decay=float(settings.learning_rate_decay),
        per_episode=float(exploration.per_episode),
        per_success=float(exploration.per_success),
        least_epsilon=float(exploration.least),
        temperature_factor=float(exploration.temperature_factor),
    )
    numbers = np.zeros(N_NUMBERS)
    numbers[EPSILON] = exploration.epsilon
    numbers[TEMPERATURE] = exploration.epsilon * exploration.temperature_factor
    counters = np.zeros(N_COUNTERS, np.int64)
    counters[FRESH] = 1

    def integers(*shape: int) -> Integers:
        return np.zeros(shape, np.int64)

    memory = Memory(
        table=make_table(seen.size, width or n_actions, np.float64, settings.hashed),
        vetoes=make_table(vetoed.size, 1, np.int64, settings.hashed),
        state=task.make_state(),
        values=integers(len(task.variables)),
        scores=np.zeros(n_actions),
        keys=integers(n_agents, len(values)),
        veto_keys=integers(n_agents, len(vetoes)),
        last_keys=integers(n_agents, len(values)),
        last_veto_keys=integers(n_agents, len(vetoes)),
        actions=integers(n_agents),
        allowed=integers(n_agents),
        rewards=np.zeros((n_agents, len(values))),
        waited=np.full(n_agents, -1, np.int64),
        charged=integers(n_agents),
        numbers=numbers,
        counters=counters,
        event_counts=integers(len(task.events)),
        stream=make_stream(generator),
        starts=make_stream(generator),
        own=own,
    )
    return learner, memory
