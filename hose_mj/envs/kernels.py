"""What the interfaces add to a task's rules, compiled: who moves when, feels what, sees what.

The first argument of each function is the task's kernel record, as in `hose_mj.tasks.kernels`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from hose_mj.jit import jitable, kernel
from hose_mj.tasks.kernels import (
    TURN,
    Floats,
    Integers,
    add_rewards,
    apply,
    apply_joint,
    is_cut_off,
    is_over,
    mask,
    observe,
    reset,
)

Flags = npt.NDArray[np.int8]


class Sight(NamedTuple):
    """Which variables are seen, and through whose eyes.

    Attributes:
        agents: the agent that sees each entry, rising (n_seen,).
        columns: its place among the task's variables (n_seen,).
    """

    agents: Integers
    columns: Integers


class Batch(NamedTuple):
    """Many copies of a task and what happened to them, all written in place.

    Attributes:
        states: (n, state_size).
        streams: random numbers of each copy (n, 1).
        over: 1 where the episode has ended, so that the next step starts a new one (n,).
        charged: the events that each agent caused (n, n_agents).
        felt: reward of each mover's events, for each agent, by signal
            (n, n_agents, n_agents, n_signals).
        values: work arrays of observed values (n, n_variables).
        seen: the chosen values (n, n_seen).
        allowed: 1 where an action is available (n, n_agents, n_actions).
        events: all events of the step (n,).
        terminated: 1 where an event ended the episode (n,).
        truncated: 1 where the step limit did (n,).
    """

    states: Integers
    streams: npt.NDArray[np.uint64]
    over: Flags
    charged: Integers
    felt: Floats
    values: Integers
    seen: Integers
    allowed: Flags
    events: Integers
    terminated: Flags
    truncated: Flags


@jitable
def forget(charged, felt):  # type: ignore[no-untyped-def]
    """Clears what the last step left: the agents' events, and who felt what; see `Batch`."""
    charged[:] = 0
    felt[:] = 0.0


@jitable
def play_turn(record, state, action, charged, felt):  # type: ignore[no-untyped-def]
    """Lets the agent whose turn it is move, adds to its rows and returns the events."""
    mover = state[TURN]
    events = apply(record, state, mover, action)
    charged[mover] |= events
    for agent in range(record.n_agents):
        add_rewards(record, events, mover, agent, felt[mover, agent])
    return events


@jitable
def play_round(record, state, actions, charged, felt):  # type: ignore[no-untyped-def]
    """Lets all agents move, each in its turn until the episode ends, and returns all events."""
    forget(charged, felt)
    events = 0
    for agent in range(record.n_agents):
        events |= play_turn(record, state, actions[agent], charged, felt)
        if is_over(record, events) or is_cut_off(record, state):
            break
    return events


@jitable
def play_joint(record, state, actions, charged, felt):  # type: ignore[no-untyped-def]
    """Lets all agents move at once and returns all events."""
    forget(charged, felt)
    events = apply_joint(record, state, actions, charged)
    for mover in range(record.n_agents):
        for agent in range(record.n_agents):
            add_rewards(record, charged[mover], mover, agent, felt[mover, agent])
    return events


@jitable
def look(record, state, sight, values, seen):  # type: ignore[no-untyped-def]
    """Writes the chosen values (n_seen,); `values` is work space (n_variables,)."""
    last = -1
    for place in range(seen.shape[0]):
        agent = sight.agents[place]
        if agent != last:
            observe(record, state, agent, values)
            last = agent
        seen[place] = values[sight.columns[place]]


@jitable
def allow(record, state, allowed):  # type: ignore[no-untyped-def]
    """Writes the action masks of all agents (n_agents, n_actions)."""
    for agent in range(allowed.shape[0]):
        bits = mask(record, state, agent)
        for action in range(allowed.shape[1]):
            allowed[agent, action] = bits >> action & 1


@jitable
def play_one(record, batch, sight, actions, at_once, i):  # type: ignore[no-untyped-def]
    """Steps copy `i`, or starts its next episode if the last one has ended."""
    state, charged, felt = batch.states[i], batch.charged[i], batch.felt[i]
    if batch.over[i]:
        reset(record, state, batch.streams[i])
        forget(charged, felt)
        events = 0
    elif at_once:
        events = play_joint(record, state, actions[i], charged, felt)
    else:
        events = play_round(record, state, actions[i], charged, felt)
    fresh = batch.over[i]
    batch.events[i] = events
    batch.terminated[i] = not fresh and is_over(record, events)
    batch.truncated[i] = not fresh and not batch.terminated[i] and is_cut_off(record, state)
    batch.over[i] = batch.terminated[i] or batch.truncated[i]
    look(record, state, sight, batch.values[i], batch.seen[i])
    allow(record, state, batch.allowed[i])


@jitable
def play_some(record, batch, sight, actions, at_once, begin, end):  # type: ignore[no-untyped-def]
    """Steps the copies begin .. end - 1 on one core; `actions` is (n, n_agents)."""
    for i in range(begin, end):
        play_one(record, batch, sight, actions, at_once, i)


@numba.njit(cache=True, parallel=True, error_model="numpy")
def play_all(record, batch, sight, actions, at_once, bounds):  # type: ignore[no-untyped-def]
    """Steps all copies over all cores, each part of them, bounds[k] .. bounds[k + 1] - 1, on one.

    The parts are few, because handing the arrays over counts references, for which the cores would
    wait for each other.
    """
    for part in numba.prange(bounds.shape[0] - 1):
        play_some(record, batch, sight, actions, at_once, bounds[part], bounds[part + 1])


_COMPILED = {
    function: kernel(function)
    for function in (play_turn, play_round, play_joint, look, allow, play_some)
}


def choose(function: Callable[..., Any], record: Any) -> Callable[..., Any]:
    """Returns the function, compiled for a compiled task and as it stands for one in Python."""
    return _COMPILED[function] if isinstance(record, tuple) else function
