"""Attributes of the classifiers: what the agent saw and did, as numbers in [0, 1] (section 8.2)."""

import math
import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hose_learning.experience import Experience
from hose_mj.errors import check_choice
from hose_mj.tasks.kernels import Floats, Integers

GRID_VARIABLES = {
    "taxi": r"taxi_\d",
    "taxi-single-agent": r"taxi_\d",
    "line": r"goal|p|r_g",
    "line-non-cooperative": r"goal|p|r_g",
    "line-single-agent": r"goal|(p|r_g)_\d",
    "line-2015": r"goal|p|r_g",
}
"""The variables of each task that number the cells of a square grid, row by row."""


@dataclass(frozen=True, kw_only=True)
class Encoding:
    """How states and actions become attributes.

    Attributes:
        action: "integer" is one attribute, the action's number. "one-hot" is an attribute for each
            action, with which neighbours almost always share the action.
        cells: "coordinates" gives a cell of a square grid as two attributes, row and column;
            "number" as one.

    Raises:
        InputError: another value.
    """

    action: Literal["integer", "one-hot"] = "integer"
    cells: Literal["coordinates", "number"] = "coordinates"

    def __post_init__(self) -> None:
        check_choice("action", self.action, ("integer", "one-hot"))
        check_choice("cells", self.cells, ("coordinates", "number"))


def make_attributes(experience: Experience, encoding: Encoding) -> tuple[Floats, tuple[str, ...]]:
    """Returns the attributes of all moves (n, n_attributes), each in [0, 1], and their names."""
    columns: list[Floats] = []
    names: list[str] = []

    def add(name: str, values: Integers, cardinality: int) -> None:
        columns.append(values / max(cardinality - 1, 1))
        names.append(name)

    grids = GRID_VARIABLES.get(experience.task)
    for k, variable in enumerate(experience.variables):
        values, cardinality = experience.values[:, k], int(experience.cardinalities[k])
        is_grid = grids is not None and re.fullmatch(grids, variable) is not None
        if is_grid and encoding.cells == "coordinates":
            width = math.isqrt(cardinality)
            add(f"{variable}_row", values // width, width)
            add(f"{variable}_column", values % width, width)
        else:
            add(variable, values, cardinality)
    if encoding.action == "integer":
        add("action", experience.actions, len(experience.action_names))
    else:
        for action, name in enumerate(experience.action_names):
            add(name, (experience.actions == action).astype(np.int64), 2)
    return np.column_stack(columns), tuple(names)
