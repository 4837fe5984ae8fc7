"""Which state variables matter for which constraint (thesis section 5.4, Algorithm 5.1).

A variable is irrelevant for a signal if what is left of the state without it still tells the signal
of every logged pair (s, a). What remains is what a veto module has to see: the fewer states it can
tell apart, the sooner it knows them all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task
from learning.components.experience import Bools, Experience
from learning.modules import Module

_LARGEST_NUMBER = 2**62


@dataclass(frozen=True)
class Signal:
    """What one veto module would answer to.

    Attributes:
        name: for listings.
        event: the task's event.
        actions: the actions concerned; none for all.
    """

    name: str
    event: str
    actions: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Relevance:
    """What Algorithm 5.1 found.

    Attributes:
        variables: the variables tested, in their order in the log.
        signals: the signals.
        relevant: whether a variable matters for a signal (n_variables, n_signals).
        n_seen: logged moves with the signal's event (n_signals,).
        is_told: whether all variables together tell the signal of every logged pair (n_signals,);
            where they do not, the algorithm finds whatever it tests first relevant.
    """

    variables: tuple[str, ...]
    signals: tuple[Signal, ...]
    relevant: Bools
    n_seen: Integers
    is_told: Bools

    def list_relevant(self, signal: str) -> tuple[str, ...]:
        """Returns the variables that matter for a signal.

        Raises:
            InputError: there is no such signal.
        """
        names = [each.name for each in self.signals]
        if signal not in names:
            raise InputError("signal", signal, "one of " + ", ".join(names))
        column = self.relevant[:, names.index(signal)]
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
            numbers = np.unique(numbers, return_inverse=True)[1]
            size = len(table)
        numbers = numbers * radix + column
        size *= radix
    return np.unique(numbers, return_inverse=True)[1]


def is_told_by(columns: npt.ArrayLike, signal: npt.ArrayLike) -> bool:
    """Whether rows that agree in all columns (n, k) agree in the signal (n,) as well."""
    rows, values = number_rows(columns), np.asarray(signal)
    of_row = np.zeros(len(values), values.dtype)
    of_row[rows] = values  # one of each row's values; all of them, if they agree
    return bool((of_row[rows] == values).all())


def sort_by_range(values: Integers) -> list[int]:
    """Returns the columns (n, k) by observed range, the biggest first; a tie keeps their order."""
    ranges = np.ptp(values, axis=0) if len(values) else np.zeros(values.shape[1], np.int64)
    return [int(k) for k in np.argsort(-ranges, kind="stable")]


def find_relevant(values: Integers, moves: Integers, signal: npt.ArrayLike) -> Bools:
    """Runs Algorithm 5.1 for one signal.

    Args:
        values: of the variables, before each move (n, n_variables).
        moves: what must be the same for two rows to be compared: the action, and who acted where
            agents are told apart (n,).
        signal: what the move caused (n,).

    Returns:
        Whether each variable matters (n_variables,).
    """
    kept = sort_by_range(values)
    for variable in list(kept):
        if len(kept) == 1:
            break
        # X' <- X_j - {x_i}: pairs (s, a), (s', a) with s' |= [s]_X' and another signal?
        left = [column for column in kept if column != variable]
        if is_told_by(np.column_stack([moves, values[:, left]]), signal):
            kept = left
    relevant = np.zeros(values.shape[1], np.bool_)
    relevant[kept] = True
    return relevant


def list_signals(task: Task) -> tuple[Signal, ...]:
    """Lists one signal for each event that breaks a constraint.

    Where one agent moves robot k with actions named `.._k`, each robot has a signal of its own:
    R_k of section 5.5.1.
    """
    events = [name for bit, name in enumerate(task.events) if task.kernel.violations >> bit & 1]
    tails = sorted({name.rpartition("_")[2] for name in task.action_names})
    if task.n_agents > 1 or not all(tail.isdigit() for tail in tails) or "+" in task.action_names[0]:
        return tuple(Signal(event, event) for event in events)
    return tuple(
        Signal(
            f"{event}_{tail}",
            event,
            tuple(a for a in task.action_names if a.endswith(f"_{tail}")),
        )
        for event in events
        for tail in tails
    )


def find_relevance(
    experience: Experience,
    signals: Sequence[Signal],
    variables: Sequence[str] | None = None,
    pooled: bool = False,
) -> Relevance:
    """Runs Algorithm 5.1 on logged moves.

    Args:
        experience: the log.
        signals: see `list_signals`.
        variables: those to test; all of the log's by default.
        pooled: whether moves of different agents are compared, which assumes that their modules
            could share one table; by default each agent's are compared with its own.

    Raises:
        InputError: an unknown variable, event or action, or none at all.
    """
    names = experience.variables if variables is None else tuple(variables)
    if not names:
        raise InputError("variables", names, "at least one of " + ", ".join(experience.variables))
    columns = [_find("variable", name, experience.variables) for name in names]
    n_actions = len(experience.action_names)
    agents = np.zeros_like(experience.agents) if pooled else experience.agents
    relevant = np.zeros((len(names), len(signals)), np.bool_)
    n_seen = np.zeros(len(signals), np.int64)
    is_told = np.zeros(len(signals), np.bool_)
    for place, signal in enumerate(signals):
        bit = _find("event", signal.event, experience.event_names)
        rows = np.ones(len(experience), np.bool_)
        if signal.actions:
            rows = np.isin(
                experience.actions,
                [_find("action", name, experience.action_names) for name in signal.actions],
            )
        values = experience.values[rows][:, columns]
        moves = (agents * n_actions + experience.actions)[rows]
        happened = experience.events[rows] >> bit & 1
        relevant[:, place] = find_relevant(values, moves, happened)
        n_seen[place] = happened.sum()
        is_told[place] = is_told_by(np.column_stack([moves, values]), happened)
    return Relevance(tuple(names), tuple(signals), relevant, n_seen, is_told)


def _find(thing: str, name: str, names: tuple[str, ...]) -> int:
    """Returns a name's place among all."""
    if name not in names:
        raise InputError(thing, name, "one of " + ", ".join(names))
    return names.index(name)


def make_veto_modules(relevance: Relevance) -> tuple[Module, ...]:
    """Makes a veto module for each signal that was seen, of the variables that matter for it.

    Of an event that never happened in the log nothing is known, so it gets no module.
    """
    return tuple(_make_modules(relevance))


def _make_modules(relevance: Relevance) -> Iterator[Module]:
    for signal, n_seen in zip(relevance.signals, relevance.n_seen, strict=True):
        if n_seen:
            yield Module(
                name=signal.name,
                kind="veto",
                variables=relevance.list_relevant(signal.name),
                events=(signal.event,),
                actions=signal.actions,
            )
