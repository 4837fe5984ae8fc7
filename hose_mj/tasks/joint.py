"""Joint moves that are resolved: who has to stay when several robots want the same cell.

The actions of a joint move are packed into one integer, three bits for each robot, so that kernels
need no work array. A robot whose move is cancelled has the action CANCELLED, which moves nothing.
"""

from typing import Any

from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Integers, dispatched

CANCELLED = 7
FIRST, SECOND, NEITHER = 0, 1, 2
"""Who gets a cell that two robots enter at once; robots are counted in the order of their turns."""


@dispatched
def compute_target(record: Any, state: Integers, robot: int, action: int) -> int:
    """Returns the number of the cell that an action leads to, or of the robot's own."""
    raise NotImplementedError(type(record).__name__)


@jitable
def pack(actions: Integers) -> int:
    """Packs the actions (n,), each below 7."""
    packed = 0
    for robot in range(actions.shape[0]):
        packed |= actions[robot] << 3 * robot
    return packed


@jitable
def unpack(packed: int, robot: int) -> int:
    """Returns a robot's action."""
    return packed >> 3 * robot & 7


@jitable
def cancel(packed: int, robot: int) -> int:
    """Returns the packed actions with the robot's cancelled."""
    return packed | CANCELLED << 3 * robot


@jitable
def settle(record: Any, state: Integers, n_robots: int, packed: int, winner: int) -> int:
    """Cancels moves until all that are left can be made at once, and returns the packed actions.

    A robot that stays keeps its cell, two that would change places both stay, and of two that enter
    one cell `winner` (FIRST, SECOND or NEITHER) gets in.
    """
    changed = True
    while changed:
        before = packed
        for one in range(n_robots):
            for other in range(one + 1, n_robots):
                packed = settle_pair(record, state, packed, one, other, winner)
        changed = packed != before
    return packed


@jitable
def settle_pair(
    record: Any, state: Integers, packed: int, one: int, other: int, winner: int
) -> int:
    """Cancels what two robots cannot do at once and returns the packed actions."""
    from_one = compute_target(record, state, one, CANCELLED)
    from_other = compute_target(record, state, other, CANCELLED)
    to_one = compute_target(record, state, one, unpack(packed, one))
    to_other = compute_target(record, state, other, unpack(packed, other))
    if to_one == to_other:
        if to_one != from_one and (to_other == from_other or winner != FIRST):
            packed = cancel(packed, one)
        if to_other != from_other and (to_one == from_one or winner != SECOND):
            packed = cancel(packed, other)
    elif to_one == from_other and to_other == from_one:
        packed = cancel(cancel(packed, one), other)
    return packed
