"""The loop that logs the moves of agents that act at random."""

from __future__ import annotations

from typing import NamedTuple

from hose_learning.policies import draw_allowed
from hose_mj.jit import compiled
from hose_mj.tasks.kernels import (
    TURN,
    Floats,
    Integers,
    apply,
    compute_rewards,
    is_cut_off,
    is_over,
    mask,
    observe,
    reset,
)


class Rows(NamedTuple):
    """One row for each move of an agent.

    Attributes:
        values: all variables as the mover saw them before the move (n, n_variables).
        agents: who moved (n,).
        actions: its action (n,).
        events: what the move caused, as bits (n,).
        rewards: what the mover got for it, by signal (n, n_signals).
        next_values: what the mover saw right after its move, before anyone else's
            (n, n_variables).
    """

    values: Integers
    agents: Integers
    actions: Integers
    events: Integers
    rewards: Floats
    next_values: Integers


@compiled
def fill_rows(record, state, stream, rows):  # type: ignore[no-untyped-def]
    """Plays random available actions, agents in turn, until all rows are written.

    Args:
        record: the task's kernel record.
        state: an initial state, advanced in place through as many episodes as it takes.
        stream: random numbers for the actions and the resets.
        rows: written in place.
    """
    for k in range(rows.agents.shape[0]):
        agent = state[TURN]
        observe(record, state, agent, rows.values[k])
        action = draw_allowed(mask(record, state, agent), stream)
        events = apply(record, state, agent, action)
        rows.agents[k] = agent
        rows.actions[k] = action
        rows.events[k] = events
        compute_rewards(record, events, agent, agent, rows.rewards[k])
        observe(record, state, agent, rows.next_values[k])
        if is_over(record, events) or is_cut_off(record, state):
            reset(record, state, stream)
