"""Which state variables matter for which constraint (thesis section 5.4, Algorithm 5.1).

A variable is irrelevant for a signal if what is left of the state without it still tells the signal
of every logged pair (s, a). What remains is what a veto module has to see: the fewer states it can
tell apart, the sooner it knows them all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hose_learning.experience import Bools, Experience
from hose_learning.modules import Module
from hose_mj.errors import InputError, check_choice
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task

_LARGEST_NUMBER = 2**62


@dataclass(frozen=True)
class Signal:
    """What one veto module would answer to: an event and the actions concerned, none for all."""

    name: str
    event: str
    actions: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Relevance:
    """What Algorithm 5.1 found of some variables and signals, in their order."""

    variables: tuple[str, ...]
    signals: tuple[Signal, ...]
    relevant: Bools  # whether a variable matters for a signal (n_variables, n_signals)
    n_seen: Integers  # logged moves with the signal's event (n_signals,)

    def list_relevant(self, signal: Signal) -> tuple[str, ...]:
        """Returns the variables that matter for one of the signals."""
        column = self.relevant[:, self.signals.index(signal)]
        return tuple(n for n, matters in zip(self.variables, column, strict=True) if matters)


def number_rows(columns: npt.ArrayLike) -> Integers:
    """Numbers the rows of non-negative integers (n, k) so that equal ones, and only they, agree.

    A mixed-radix number is what rows are looked up by; it is renumbered from 0 before it overflows.
    """
    table = np.asarray(columns, np.int64)
    numbers, size = np.zeros(len(table), np.int64), 1
    for column in table.T:
        radix = int(column.max(initial=0)) + 1
        if size > _LARGEST_NUMBER // radix:
            numbers, size = np.unique(numbers, return_inverse=True)[1], len(table)
        numbers = numbers * radix + column
        size *= radix
    return np.unique(numbers, return_inverse=True)[1]


def count_contradictions(columns: npt.ArrayLike, signal: npt.ArrayLike) -> int:
    """Counts the rows in which columns (n, k) cannot tell whether a signal (n,) is there.

    Of rows with equal columns these are those with the signal or those without, whichever are
    fewer; none where the columns tell it.
    """
    rows = number_rows(columns)
    n_all = np.bincount(rows)
    n_with = np.bincount(rows[np.asarray(signal, np.bool_)], minlength=len(n_all))
    return int(np.minimum(n_with, n_all - n_with).sum())


def sort_by_range(values: Integers) -> list[int]:
    """Returns the columns (n, k) by observed range, the biggest first; a tie keeps their order."""
    if len(values) == 0:
        return list(range(values.shape[1]))
    return [int(k) for k in np.argsort(-np.ptp(values, axis=0), kind="stable")]


def find_relevant(values: Integers, moves: Integers, signal: Bools) -> Bools:
    """Runs Algorithm 5.1 for one signal; returns whether each variable matters (n_variables,).

    `values` are those before each move (n, n_variables), `moves` what two rows must have in common
    to be compared: the action, and who acted where agents are told apart (n,). `signal` says
    whether the move caused it (n,).
    """
    kept = sort_by_range(values)
    for variable in list(kept):
        if len(kept) == 1:
            break
        # X' <- X_j - {x_i}: are there (s, a), (s', a) with s' |= [s]_X' and different signals?
        left = [column for column in kept if column != variable]
        if count_contradictions(np.column_stack([moves, values[:, left]]), signal) == 0:
            kept = left
    relevant = np.zeros(values.shape[1], np.bool_)
    relevant[kept] = True
    return relevant


def list_signals(task: Task) -> tuple[Signal, ...]:
    """Lists one signal for each event that breaks a constraint.

    Where a single agent names the robot to move (`up_2`), each robot has a signal of its own, R_i
    of section 5.5.1.
    """
    events = [name for bit, name in enumerate(task.events) if task.kernel.violations >> bit & 1]
    robots = sorted({name.partition("_")[2] for name in task.action_names})
    if not all(robot.isdigit() for robot in robots):
        return tuple(Signal(event, event) for event in events)
    actions = {
        robot: tuple(name for name in task.action_names if name.endswith(f"_{robot}"))
        for robot in robots
    }
    return tuple(Signal(f"{e}_{robot}", e, actions[robot]) for e in events for robot in robots)


def list_candidates(task: Task, experience: Experience) -> tuple[str, ...]:
    """Lists the variables to test: what everyone sees alike, then what each agent sees for itself.

    Of equal ranges the first is tested, and so removed, first: an agent's own variables are kept
    rather than the team's. What everyone sees and one agent has as a variable of its own (`r_n_2`
    of the formation is robot 1's `r_p`) is left out: of two copies only one can be relevant.
    """
    own = [k for k, variable in enumerate(task.variables) if variable.per_agent]
    shared = [k for k in range(len(task.variables)) if k not in own]

    def is_copy(column: int) -> bool:
        return any(
            task.variables[column].cardinality == task.variables[other].cardinality
            and bool((moves.values[:, column] == moves.values[:, other]).all())
            for moves in map(experience.select, range(task.n_agents))
            for other in own
            if len(moves)
        )

    kept = [k for k in shared if not is_copy(k)]
    return tuple(task.variables[k].name for k in (*kept, *own))


def find_relevance(
    experience: Experience,
    signals: Sequence[Signal],
    variables: Sequence[str],
    pooled: bool = False,
) -> Relevance:
    """Runs Algorithm 5.1 on logged moves.

    Args:
        experience: the log.
        signals: see `list_signals`.
        variables: those to test, see `list_candidates`.
        pooled: whether moves of different agents are compared, as if their modules shared one
            table; by default an agent's are compared with its own.

    Raises:
        InputError: an unknown variable, event or action, or no variable at all.
    """
    if not variables:
        raise InputError("variables", (), "at least one of " + ", ".join(experience.variables))
    relevant = np.zeros((len(variables), len(signals)), np.bool_)
    n_seen = np.zeros(len(signals), np.int64)
    for place, signal in enumerate(signals):
        values, moves, happened = select_rows(experience, signal, variables, pooled)
        relevant[:, place] = find_relevant(values, moves, happened)
        n_seen[place] = happened.sum()
    return Relevance(tuple(variables), tuple(signals), relevant, n_seen)


def select_rows(
    experience: Experience, signal: Signal, variables: Sequence[str], pooled: bool = False
) -> tuple[Integers, Integers, Bools]:
    """Returns what concerns a signal: values, moves and whether it happened (`find_relevant`).

    Raises:
        InputError: an unknown variable, event or action.
    """
    columns = [_find("variable", name, experience.variables) for name in variables]
    bit = _find("event", signal.event, experience.event_names)
    actions = [
        _find("action", name, experience.action_names)
        for name in signal.actions or experience.action_names
    ]
    rows = np.isin(experience.actions, actions)
    agents = np.zeros_like(experience.agents) if pooled else experience.agents
    moves = agents * len(experience.action_names) + experience.actions
    happened = (experience.events >> bit & 1).astype(np.bool_)
    return experience.values[rows][:, columns], moves[rows], happened[rows]


def count_unexplained(
    relevance: Relevance, signal: Signal, experience: Experience, pooled: bool = False
) -> int:
    """Counts moves of a log that a signal's relevant variables do not tell from others."""
    names = relevance.list_relevant(signal)
    values, moves, happened = select_rows(experience, signal, names, pooled)
    return count_contradictions(np.column_stack([moves, values]), happened)


def make_veto_modules(relevance: Relevance) -> tuple[Module, ...]:
    """Makes a veto module for each signal, of the variables that matter for it.

    Nothing is known of an event that never happened in the log, so it gets no module.
    """
    return tuple(
        Module(
            name=signal.name,
            kind="veto",
            variables=relevance.list_relevant(signal),
            events=(signal.event,),
            actions=signal.actions,
        )
        for signal, n_seen in zip(relevance.signals, relevance.n_seen, strict=True)
        if n_seen
    )


def _find(thing: str, name: str, names: tuple[str, ...]) -> int:
    """Returns a name's place among all."""
    check_choice(thing, name, names)
    return names.index(name)
