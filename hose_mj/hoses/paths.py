"""Paths of holds: where they are to be at the end of each of many steps, in one call."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.inputs import read_numbers
from hose_mj.hoses.protocol import Array, Hold

if TYPE_CHECKING:
    from hose_mj.hoses.protocol import HoseModel

Rows = Mapping[Hold, ArrayLike]
"""A row (3,) for each step, (n, 3), by hold."""


class HoldPath(NamedTuple):
    """One hold's positions (n, 3), m, and tangents (n, 3); None for what stays as it is."""

    positions: Array | None
    tangents: Array | None


def check_paths(positions: Rows, tangents: Rows | None) -> tuple[int, dict[Hold, HoldPath]]:
    """Returns the number of steps and the path of each hold.

    Raises:
        InputError: what is no mapping from holds to finite numbers of one shape (n, 3), tangents of
            an attachment.
    """
    found: list[dict[Hold, Array]] = []
    for name, rows in (("positions", positions), ("tangents", tangents or {})):
        valid = "a mapping from holds to arrays (n, 3)"
        if not isinstance(rows, Mapping) or not all(isinstance(hold, Hold) for hold in rows):
            raise InputError(name, type(rows).__name__, valid)
        found.append({hold: read_numbers(name, row, valid) for hold, row in rows.items()})
    every = [array for arrays in found for array in arrays.values()]
    shape = (len(every[0]) if every and every[0].ndim else 0, 3)
    for array in every:
        if array.shape != shape or not np.all(np.isfinite(array)):
            raise InputError("shape of a path", array.shape, f"{shape}, finite numbers")
    for hold in found[1]:
        if not hold.fixes_tangent:
            raise InputError("tangents", hold, "None for an attachment (use clamp)")
    holds = dict.fromkeys([*found[0], *found[1]])
    return shape[0], {hold: HoldPath(found[0].get(hold), found[1].get(hold)) for hold in holds}


def follow_in_steps(hose: HoseModel, positions: Rows, tangents: Rows | None) -> None:
    """`HoseModel.follow` by `move` and `step` in turn, for models without a loop of their own."""
    n_steps, paths = check_paths(positions, tangents)
    for k in range(n_steps):
        for hold, path in paths.items():
            place, aim = (None if rows is None else rows[k] for rows in path)
            hose.move(hold, place, aim)
        hose.step()
