"""Makes a learner's records from its settings."""

from typing import Any

import numpy as np
from numpy.random import Generator

from hose_learning import records
from hose_learning.mediators import MEDIATORS
from hose_learning.modules import make_arrays, make_masks, make_module_rewards
from hose_learning.records import Memory
from hose_learning.settings import POLICIES, Exploration, LearnerSettings
from hose_learning.tables import Table, make_table
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task

Made = tuple[records.Learner, Memory]  # what the factory of a learner returns


def make_learner(
    task: Task,
    settings: LearnerSettings,
    rule: Any,
    generator: Generator,
    own: Any = (),
    width: int | None = None,
    n_parts: int | None = None,
) -> Made:
    """Makes a learner that has learned nothing, and its memory; the generator seeds its chance.

    `rule` is the record of its update rule and `own` what that keeps beside the tables, a
    NamedTuple of arrays. A row of Q-values is `width` long, by default the number of actions; each
    value module has `n_parts` tables, by default one for each agent. `InputError` is raised for a
    module that names what the task does not have, or sees too much.
    """
    values = settings.select("value")
    vetoes = settings.select("veto")
    seen = make_arrays(task, values, n_parts or task.n_agents)
    vetoed = make_arrays(task, vetoes, task.n_agents)
    thresholds = np.array([-np.inf if m.threshold is None else m.threshold for m in values])
    exploration = settings.exploration
    has_none = settings.fallback == "none" and "none" in task.action_names
    learner = records.Learner(
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
        veto_events=make_masks("event", task.events, [module.events for module in vetoes]),
        veto_actions=make_masks(
            "action", task.action_names, [m.actions or task.action_names for m in vetoes]
        ),
        shares_vetoes=settings.share_vetoes,
        return_of_event=task.kernel.reward_table.sum(axis=1),
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
    table = make_table(seen.size, width or task.n_actions, np.float64, settings.hashed)
    veto_table = make_table(vetoed.size, 1, np.int64, settings.hashed)
    memory = _make_memory(task, exploration, table, veto_table, (len(values), len(vetoes)), own)
    return learner, memory._replace(stream=make_stream(generator), starts=make_stream(generator))


def _make_memory(
    task: Task,
    exploration: Exploration,
    table: Table,
    vetoes: Table,
    counts: tuple[int, int],
    own: Any,
) -> Memory:
    """Makes a memory in which nobody has moved yet, for so many value and veto modules."""
    n_agents, (n_values, n_vetoes) = task.n_agents, counts
    numbers = np.zeros(records.N_NUMBERS)
    numbers[records.EPSILON] = exploration.epsilon
    numbers[records.TEMPERATURE] = exploration.epsilon * exploration.temperature_factor
    counters = np.zeros(records.N_COUNTERS, np.int64)
    counters[records.FRESH] = 1

    def integers(*shape: int) -> Integers:
        return np.zeros(shape, np.int64)

    return Memory(
        table=table,
        vetoes=vetoes,
        state=task.make_state(),
        values=integers(len(task.variables)),
        scores=np.zeros(task.n_actions),
        keys=integers(n_agents, n_values),
        veto_keys=integers(n_agents, n_vetoes),
        last_keys=integers(n_agents, n_values),
        last_veto_keys=integers(n_agents, n_vetoes),
        actions=integers(n_agents),
        allowed=integers(n_agents),
        rewards=np.zeros((n_agents, n_values)),
        steps_since_action=np.full(n_agents, -1, np.int64),
        caused_events=integers(n_agents),
        numbers=numbers,
        counters=counters,
        event_counts=integers(len(task.events)),
        stream=np.zeros(1, np.uint64),
        starts=np.zeros(1, np.uint64),
        own=own,
    )
