"""What every task can do, one function name for all of them, in compiled and in plain Python code.

The first argument of each function is the task's kernel record, whose type selects the code: a
NamedTuple of numbers and arrays for a compiled task, any other object for one in plain Python. A
loop written with these functions compiles for the former, with the task's code inlined and the
result kept on disk, and runs unchanged for the latter.

The state is one int64 array. `state[TURN]` is the agent to move, `state[STEPS]` counts the moves of
single agents since the reset, and what follows is the task's own. Events are bits of one integer.

Every record has these fields:

- `n_agents`, `n_actions`: actions are 0 .. n_actions - 1 for each agent;
- `step_limit`: moves of single agents after which an episode is cut off; a joint move counts
  n_agents of them;
- `terminal`: the events that end an episode;
- `violations`: the events that break a constraint;
- `success`: the events that mean that the task is done;
- `shared`: the events that every agent is rewarded for; the others concern the mover alone;
- `reward_table`: reward of each set of events, by signal (2^n_events, n_signals).
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, cast

import numpy as np
import numpy.typing as npt
from numba.extending import overload

from hose_mj.jit import compiled, jitable
from hose_mj.tasks.stream import Stream, draw_below

TURN, STEPS = 0, 1
HEADER = 2  # where a task's own part of the state begins

Integers = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]


class Dispatched(Protocol):
    """A function that `dispatched` made."""

    def __call__(self, record: Any, *arguments: Any) -> Any:
        """Runs the code of the record's type."""
        ...

    def register(self, kind: Any, function: Any = None) -> Callable[[Callable[..., Any]], Any]:
        """Makes a function the code of one type of record."""
        ...


def dispatched(function: Callable[..., Any]) -> Dispatched:
    """Makes a function whose code depends on the type of its first argument.

    Like `functools.singledispatch`, and with `register` as there, but compiled code may call it
    too. (Compiled functions handed over as arguments would miss the cache in every process.)
    """
    chooser = functools.singledispatch(function)

    # Inlined: a call would copy all fields of the record onto the stack, at every move.
    @overload(chooser, jit_options={"forceinline": True})
    def choose(record: Any, *arguments: Any) -> Any:
        implementation = chooser.dispatch(record.instance_class)

        def call(record: Any, *arguments: Any) -> Any:
            return implementation(record, *arguments)

        return call

    return cast(Dispatched, chooser)


@dispatched
def reset(record: Any, state: Integers, stream: Stream) -> None:
    """Writes an initial state; every random choice is drawn from the stream."""
    raise NotImplementedError(type(record).__name__)


@dispatched
def apply(record: Any, state: Integers, agent: int, action: int) -> int:
    """Lets one agent move, advances turn and step count, and returns the events."""
    raise NotImplementedError(type(record).__name__)


@dispatched
def apply_joint(record: Any, state: Integers, actions: Integers, caused_events: Integers) -> int:
    """Lets all agents move at once and returns all events.

    The state is advanced in place, the turn goes back to agent 0. There is an action for each agent
    (n_agents,); the events that each caused are written to `caused_events` (n_agents,).
    """
    raise NotImplementedError(type(record).__name__)


@dispatched
def observe(record: Any, state: Integers, agent: int, values: Integers) -> None:
    """Writes the values of the task's variables as the agent sees them (n_variables,).

    Each lies in 0 .. cardinality - 1, in a state that broke a constraint too (clipped there).
    """
    raise NotImplementedError(type(record).__name__)


@dispatched
@jitable
def mask(record: Any, state: Integers, agent: int) -> int:
    """Returns the available actions as bits; all of them, unless the task says otherwise."""
    return (1 << record.n_actions) - 1


@jitable
def begin(state: Integers) -> None:
    """Sets turn and step count of an initial state."""
    state[TURN] = 0
    state[STEPS] = 0


@jitable
def end_turn(record: Any, state: Integers, agent: int) -> None:
    """Hands the turn to the next agent and counts the move."""
    state[TURN] = agent + 1 if agent + 1 < record.n_agents else 0
    state[STEPS] += 1


@jitable
def end_joint(record: Any, state: Integers) -> None:
    """Hands the turn to agent 0 and counts a move of every agent."""
    state[TURN] = 0
    state[STEPS] += record.n_agents


@jitable
def is_over(record: Any, events: int) -> bool:
    """Whether the events end the episode."""
    return events & record.terminal != 0


@jitable
def is_cut_off(record: Any, state: Integers) -> bool:
    """Whether the step limit is reached."""
    return state[STEPS] >= record.step_limit


@jitable
def add_rewards(record: Any, events: int, mover: int, agent: int, rewards: Floats) -> None:
    """Adds what the agent gets for the events of a move of `mover`, by signal (n_signals,)."""
    counted = events if agent == mover else events & record.shared
    for signal in range(rewards.shape[0]):
        rewards[signal] += record.reward_table[counted, signal]


@jitable
def compute_rewards(record: Any, events: int, mover: int, agent: int, rewards: Floats) -> None:
    """Writes what the agent gets for the events of a move of `mover`, by signal (n_signals,)."""
    rewards[:] = 0.0
    add_rewards(record, events, mover, agent, rewards)


@jitable
def compute_joint_rewards(
    record: Any, caused_events: Integers, agent: int, rewards: Floats
) -> None:
    """Writes what the agent gets for a joint move, by signal (n_signals,).

    It is the sum over the movers of what `compute_rewards` gives for each one's events.
    """
    rewards[:] = 0.0
    for mover in range(record.n_agents):
        add_rewards(record, caused_events[mover], mover, agent, rewards)


@jitable
def compute_safe_mask(record: Any, state: Integers, agent: int, scratch: Integers) -> int:
    """Returns, as bits, the available actions that break no constraint at once.

    It tries each of them on `scratch`, an array of the state's length.
    """
    available = mask(record, state, agent)
    safe = 0
    for action in range(record.n_actions):
        if available >> action & 1:
            for k in range(state.shape[0]):
                scratch[k] = state[k]
            if apply(record, scratch, agent, action) & record.violations == 0:
                safe |= 1 << action
    return safe


class Projection(NamedTuple):
    """A set of variables as one mixed-radix number; made by `variables.make_projection`.

    The variables' places among all (k,), the fastest running one last; what a step of each adds to
    the index (k,); and the number of different indices.
    """

    columns: Integers
    strides: Integers
    size: int


@jitable
def project(projection: Projection, values: Integers) -> int:
    """Returns the index of the values (n_variables,) that `observe` wrote."""
    index = 0
    for k in range(projection.columns.shape[0]):
        index += values[projection.columns[k]] * projection.strides[k]
    return index


@compiled
def run_random(
    record: Any, state: Integers, stream: Stream, n_moves: int, values: Integers, counts: Integers
) -> None:
    """Plays random moves, agents in turn, observing before each one; for timing and tests.

    The state, an initial one, is advanced through as many episodes as it takes. `values` is a work
    array (n_variables,); `counts` are raised: episodes ended, successes, violations, sum of all
    values (4,).
    """
    episodes = successes = violations = total = 0
    for _ in range(n_moves):
        agent = state[TURN]
        observe(record, state, agent, values)
        for value in values:
            total += value
        events = apply(record, state, agent, draw_below(stream, record.n_actions))
        successes += events & record.success != 0
        violations += events & record.violations != 0
        if is_over(record, events) or is_cut_off(record, state):
            episodes += 1
            reset(record, state, stream)
    counts[0] += episodes
    counts[1] += successes
    counts[2] += violations
    counts[3] += total


Shorts = npt.NDArray[np.int16]
Slots = npt.NDArray[np.int32]

NOT_FOUND, TOO_MANY = -1, -2


@jitable
def find_slot(states: Shorts, slots: Slots, state: Integers) -> int:
    """Returns the slot of a state, or the free one where it belongs; its step count is left out."""
    mixed = 0
    for k in range(state.shape[0]):
        if k != STEPS:
            mixed = (mixed * 1_000_003 + state[k]) & 0xFFFFFFFFFFF
    slot = (mixed >> 20 ^ mixed) & (slots.shape[0] - 1)
    while slots[slot] >= 0:
        same = True
        for k in range(state.shape[0]):
            same = same and (k == STEPS or states[slots[slot], k] == state[k])
        if same:
            break
        slot = (slot + 1) & (slots.shape[0] - 1)
    return slot


@compiled
def search(task: Any, start: Integers, states: Shorts, slots: Slots, state: Integers) -> int:
    """Returns the moves to the goal; `states` is the queue, in which a step count is a depth."""
    used = 1
    for k in range(start.shape[0]):
        states[0, k] = start[k]
    states[0, STEPS] = 0
    slots[find_slot(states, slots, start)] = 0
    done = 0
    while done < used:
        agent = states[done, TURN]
        for action in range(task.n_actions):
            for k in range(state.shape[0]):
                state[k] = states[done, k]
            if not mask(task, state, agent) >> action & 1:
                continue
            events = apply(task, state, agent, action)
            depth = states[done, STEPS] + 1
            if events & task.success:
                return depth
            if is_over(task, events):
                continue
            slot = find_slot(states, slots, state)
            if slots[slot] < 0:
                if used == states.shape[0]:
                    return TOO_MANY
                for k in range(state.shape[0]):
                    states[used, k] = state[k]
                states[used, STEPS] = depth
                slots[slot] = used
                used += 1
        done += 1
    return NOT_FOUND
