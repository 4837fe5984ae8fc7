"""The shortest way to the goal, by breadth-first search: what a learned policy is held against."""

from __future__ import annotations

import numpy as np

from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.search_kernels import NOT_FOUND, TOO_MANY, search
from hose_mj.tasks.task import Task


def find_shortest(task: Task, state: Integers, limit: int = 4_000_000) -> int | None:
    """Returns the fewest moves of single agents, in turns, from a state to the goal.

    The step limit plays no part in it.

    Args:
        task: a compiled task without chance.
        state: where the search starts; its turn counts.
        limit: most states to visit.

    Returns:
        The number of moves, or None if the goal cannot be reached.

    Raises:
        InputError: more states than the limit.
    """
    width = len(state)
    slots = 1 << int(np.ceil(np.log2(2 * limit)))
    states = np.zeros((limit, width), np.int16)
    moves = search(
        task.kernel, state.copy(), states, np.full(slots, -1, np.int32), np.zeros(width, np.int64)
    )
    if moves == TOO_MANY:
        raise InputError("task", task.id, f"one that {limit} states are enough for")
    return None if moves == NOT_FOUND else int(moves)
