"""The modules of a learner as data (thesis, chapters 4 and 5), and the arrays made from them.

A module sees some of the task's variables. A *value* module learns Q-values of some reward signals;
with a threshold it also vetoes what lies below it (Definition 4). A *veto* module remembers which
actions led to certain events in what it sees, and vetoes them from then on (section 5.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from hose_mj.errors import InputError, check_choice
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.task import Task
from hose_mj.tasks.variables import LARGEST_SIZE

Kind = Literal["value", "veto"]
Credit = Literal["cycle", "own"]


@dataclass(frozen=True, kw_only=True)
class Module:
    """What one module sees and learns from; `InputError` for an unknown kind or credit."""

    name: str  # for messages and listings
    variables: tuple[str, ...]  # names of the task's variables; none at all is a single state
    kind: Kind = "value"  # "value" or "veto"
    signals: tuple[str, ...] = ()  # reward signals that a value module adds up
    events: tuple[str, ...] = ()  # events that a veto module answers to
    # Who learns from a reward or an event: everyone who acted within the "cycle", or the mover for
    # its "own" action alone.
    credit: Credit = "cycle"
    # A value module vetoes actions whose values lie below it; None vetoes nothing.
    threshold: float | None = None
    actions: tuple[str, ...] = ()  # the actions that a veto module is about; by default all of them

    def __post_init__(self) -> None:
        for name, choices in (("kind", get_args(Kind)), ("credit", get_args(Credit))):
            check_choice(f"{name} of module {self.name}", getattr(self, name), choices)


@dataclass(frozen=True)
class Arrays:
    """What loops need of modules of one kind."""

    columns: Integers  # the variables' places among all (n_modules, width)
    strides: Integers  # what a step of each adds to the key; 0 where it pads (n_modules, width)
    bases: Integers  # the first key of each agent (n_modules, n_agents)
    size: int  # number of keys


def make_arrays(task: Task, modules: Sequence[Module], n_parts: int) -> Arrays:
    """Lays the states that the modules of one kind see one after the other.

    Each has `n_parts`: one for each agent, or one for a team. `InputError` is raised for an unknown
    variable, or more than 2^62 keys in all.
    """
    projections = [task.make_projection(module.variables) for module in modules]
    width = max([1, *(len(p.columns) for p in projections)])
    columns = np.zeros((len(modules), width), np.int64)
    strides = np.zeros((len(modules), width), np.int64)
    bases = np.zeros((len(modules), n_parts), np.int64)
    size = 0
    for row, projection in enumerate(projections):
        columns[row, : len(projection.columns)] = projection.columns
        strides[row, : len(projection.strides)] = projection.strides
        for part in range(n_parts):
            bases[row, part] = size
            size += projection.size
            if size > LARGEST_SIZE:
                names = [m.name for m in modules]
                raise InputError("modules", names, "modules that see fewer than 2^62 states")
    return Arrays(columns, strides, bases, size)


def make_module_rewards(task: Task, modules: Sequence[Module]) -> Floats:
    """Makes what each value module is rewarded with, by events and by whose move it was.

    Returns:
        rewards (2^n_events, 2, n_modules): [events, 0] for what another agent caused (its shared
        part), [events, 1] for one's own move.

    Raises:
        InputError: an unknown signal.
    """
    table = task.kernel.reward_table
    shared = np.arange(len(table)) & task.kernel.shared
    rewards = np.zeros((len(table), 2, len(modules)))
    for place, module in enumerate(modules):
        for signal in module.signals:
            check_choice("signal", signal, task.rewards)
            column = task.rewards.index(signal)
            rewards[:, 1, place] += table[:, column]
            if module.credit == "cycle":
                rewards[:, 0, place] += table[shared, column]
    return rewards


def make_masks(thing: str, names: Sequence[str], chosen: Sequence[Sequence[str]]) -> Integers:
    """Returns some names of each module as bits of one integer (n_modules,).

    Bit k stands for the k-th of all `names`. `thing` is what they name, for the `InputError` that
    an unknown one raises.
    """
    masks = np.zeros(len(chosen), np.int64)
    for place, name in ((place, name) for place, own in enumerate(chosen) for name in own):
        check_choice(thing, name, names)
        masks[place] |= 1 << names.index(name)
    return masks
