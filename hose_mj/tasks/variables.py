"""Named state variables, and projections onto some of them: what a module of a learner sees."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hose_mj.errors import InputError, check_choice
from hose_mj.tasks.kernels import Projection

LARGEST_SIZE = 2**62


@dataclass(frozen=True)
class Variable:
    """One state variable, whose values are 0 .. cardinality - 1; their meaning is in words."""

    name: str
    cardinality: int
    meaning: str
    per_agent: bool = False  # whether each agent sees a value of its own


def make_projection(variables: Sequence[Variable], names: Iterable[str]) -> Projection:
    """Makes the projection onto the named variables.

    The index is mixed-radix with the last name running fastest, as numpy.ravel_multi_index has it.

    Args:
        variables: all of them, in the order in which `kernels.observe` writes their values.
        names: those to keep; none at all projects every state onto 0.

    Raises:
        InputError: an unknown or doubled name, or a product of cardinalities beyond 2^62.
    """
    names = list(names)
    places = {variable.name: place for place, variable in enumerate(variables)}
    for name in names:
        check_choice("variable", name, places)
        if names.count(name) > 1:
            raise InputError("variables", names, f"{name!r} only once")
    columns = [places[name] for name in names]
    radices = [variables[column].cardinality for column in columns]
    size = math.prod(radices)
    if size > LARGEST_SIZE:
        raise InputError("variables", names, f"fewer: their {size:.1e} states exceed 2^62")
    strides = [math.prod(radices[k + 1 :]) for k in range(len(radices))]
    return Projection(np.array(columns, np.int64), np.array(strides, np.int64), size)
