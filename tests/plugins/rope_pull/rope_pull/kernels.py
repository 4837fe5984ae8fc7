"""Two robots hold a rope; each move shifts it, and it must not leave the ground on the left."""

from __future__ import annotations

from typing import NamedTuple

from hose_mj.jit import inlined, jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import HEADER, Floats, Integers, begin, end_joint, end_turn
from hose_mj.tasks.stream import Stream, draw_below

OFF, GOAL = 1, 2
PULL = 1
"""Cells that a pull shifts the rope by."""


class Rope(NamedTuple):
    """The rules; state: header, then the rope's cell.

    Attributes:
        n_cells: the rope's cells are 0 .. n_cells - 1, the mark is the last one.
    """

    n_agents: int
    n_actions: int
    step_limit: int
    terminal: int
    violations: int
    success: int
    shared: int
    reward_table: Floats
    n_cells: int


@jitable
def shift(record: Rope, state: Integers, action: int) -> int:
    """Lets go (0), holds (1) or pulls (2), and returns the events."""
    state[HEADER] += PULL * (action - 1)
    if state[HEADER] < 0:
        state[HEADER] = 0
        return OFF
    return GOAL if state[HEADER] >= record.n_cells - 1 else 0


@kernels.reset.register(Rope)
@inlined
def reset_rope(record: Rope, state: Integers, stream: Stream) -> None:
    """Lays the rope on one of the first two cells."""
    begin(state)
    state[HEADER] = draw_below(stream, 2)


@kernels.apply.register(Rope)
@inlined
def apply_rope(record: Rope, state: Integers, agent: int, action: int) -> int:
    """Lets one robot act."""
    end_turn(record, state, agent)
    return shift(record, state, action)


@kernels.apply_joint.register(Rope)
@inlined
def apply_joint_rope(
    record: Rope, state: Integers, actions: Integers, caused_events: Integers
) -> int:
    """Lets both act, one after the other in the same move."""
    events = 0
    for agent in range(record.n_agents):
        caused_events[agent] = 0
        if not events & GOAL:
            caused_events[agent] = shift(record, state, actions[agent])
        events |= caused_events[agent]
    end_joint(record, state)
    return events


@kernels.observe.register(Rope)
@inlined
def observe_rope(record: Rope, state: Integers, agent: int, values: Integers) -> None:
    """Writes the rope's cell."""
    values[0] = min(state[HEADER], record.n_cells - 1)
