"""The interfaces' part of the rules, compiled: who moves when, gets which rewards, sees what.

The first argument of each function is the task's kernel record, as in `hose_mj.tasks.kernels`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from hose_mj.jit import jitable, kernel, parallel
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import Stream

Flags = npt.NDArray[np.int8]


class Sight(NamedTuple):
    """Which variables are seen, and through whose eyes."""

    agents: Integers  # the agent that sees each entry, rising (n_seen,)
    columns: Integers  # its place among the task's variables (n_seen,)


class Batch(NamedTuple):
    """Many copies of a task and what happened to them, all written in place."""

    states: Integers  # (n, state_size)
    streams: Stream  # random numbers of each copy (n, 1)
    over: Flags  # 1 where the episode has ended, so that the next step starts a new one (n,)
    caused_events: Integers  # the events that each agent caused (n, n_agents)
    # Reward of each mover's events, for each agent, by signal (n, n_agents, n_agents, n_signals).
    reward_by_mover: Floats
    values: Integers  # work arrays of observed values (n, n_variables)
    seen: Integers  # the chosen values (n, n_seen)
    allowed: Flags  # 1 where an action is available (n, n_agents, n_actions)
    events: Integers  # all events of the step (n,)
    terminated: Flags  # 1 where an event ended the episode (n,)
    truncated: Flags  # 1 where the step limit did (n,)


@jitable
def forget(caused_events: Integers, reward_by_mover: Floats) -> None:
    """Clears what the last step left: the agents' events, and the rewards; see `Batch`."""
    caused_events[:] = 0
    reward_by_mover[:] = 0.0


@jitable
def play_turn(
    record: Any, state: Integers, action: int, caused_events: Integers, reward_by_mover: Floats
) -> int:
    """Lets the agent whose turn it is move, adds to its rows and returns the events."""
    mover = state[kernels.TURN]
    events = kernels.apply(record, state, mover, action)
    caused_events[mover] |= events
    for agent in range(record.n_agents):
        kernels.add_rewards(record, events, mover, agent, reward_by_mover[mover, agent])
    return events


@jitable
def play_round(record, state, actions, caused_events, reward_by_mover):
    """Lets all agents move, each in its turn until the episode ends, and returns all events."""
    forget(caused_events, reward_by_mover)
    events = 0
    for agent in range(record.n_agents):
        events |= play_turn(record, state, actions[agent], caused_events, reward_by_mover)
        if kernels.is_over(record, events) or kernels.is_cut_off(record, state):
            break
    return events


@jitable
def play_joint(record, state, actions, caused_events, reward_by_mover):
    """Lets all agents move at once and returns all events."""
    forget(caused_events, reward_by_mover)
    events = kernels.apply_joint(record, state, actions, caused_events)
    for mover in range(record.n_agents):
        for agent in range(record.n_agents):
            kernels.add_rewards(
                record, caused_events[mover], mover, agent, reward_by_mover[mover, agent]
            )
    return events


@jitable
def look(record: Any, state: Integers, sight: Sight, values: Integers, seen: Integers) -> None:
    """Writes the chosen values (n_seen,); `values` is work space (n_variables,)."""
    last = -1
    for place in range(seen.shape[0]):
        agent = sight.agents[place]
        if agent != last:
            kernels.observe(record, state, agent, values)
            last = agent
        seen[place] = values[sight.columns[place]]


@jitable
def allow(record: Any, state: Integers, allowed: Flags) -> None:
    """Writes the action masks of all agents (n_agents, n_actions)."""
    for agent in range(allowed.shape[0]):
        bits = kernels.mask(record, state, agent)
        for action in range(allowed.shape[1]):
            allowed[agent, action] = bits >> action & 1


@jitable
def play_one(
    record: Any, batch: Batch, sight: Sight, actions: Integers, at_once: bool, i: int
) -> None:
    """Steps copy `i`, or starts its next episode if the last one has ended."""
    state, caused_events = batch.states[i], batch.caused_events[i]
    reward_by_mover = batch.reward_by_mover[i]
    if batch.over[i]:
        kernels.reset(record, state, batch.streams[i])
        forget(caused_events, reward_by_mover)
        events = 0
    elif at_once:
        events = play_joint(record, state, actions[i], caused_events, reward_by_mover)
    else:
        events = play_round(record, state, actions[i], caused_events, reward_by_mover)
    fresh = batch.over[i]
    batch.events[i] = events
    batch.terminated[i] = not fresh and kernels.is_over(record, events)
    batch.truncated[i] = not fresh and not batch.terminated[i] and kernels.is_cut_off(record, state)
    batch.over[i] = batch.terminated[i] or batch.truncated[i]
    look(record, state, sight, batch.values[i], batch.seen[i])
    allow(record, state, batch.allowed[i])


@jitable
def play_some(
    record: Any, batch: Batch, sight: Sight, actions: Integers, at_once: bool, begin: int, end: int
) -> None:
    """Steps the copies begin .. end - 1 on one core; `actions` is (n, n_agents)."""
    for i in range(begin, end):
        play_one(record, batch, sight, actions, at_once, i)


@parallel
def play_all(
    record: Any, batch: Batch, sight: Sight, actions: Integers, at_once: bool, bounds: Integers
) -> None:
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
