"""`Experience`: logged moves of random agents on any task, with the names of all that is in them.

What learns from a log instead of a running task starts here: the classifiers of chapter 8, and the
relevance of state variables (Algorithm 5.1).
"""

from __future__ import annotations

import io
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hose_learning.loop import Rows, fill_rows
from hose_mj.errors import InputError
from hose_mj.jit import compile_notice
from hose_mj.recording.files import write_atomically
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False, kw_only=True)
class Experience:
    """A log of n moves of a task; the arrays are those of `hose_learning.loop.Rows`."""

    task: str  # its id
    variables: tuple[str, ...]  # the columns of `values`
    cardinalities: Integers  # how many values each has (n_variables,)
    agent_names: tuple[str, ...]  # by number, as those of the actions
    action_names: tuple[str, ...]
    event_names: tuple[str, ...]  # event k is bit k
    reward_names: tuple[str, ...]  # the columns of `rewards`
    violations: int  # the events that break a constraint, as bits
    values: Integers
    agents: Integers
    actions: Integers
    events: Integers
    rewards: Floats
    next_values: Integers

    def __len__(self) -> int:
        return len(self.agents)

    @property
    def undesired(self) -> Bools:
        """Whether each move broke a constraint: the class c_1 of chapter 8 (n,)."""
        return (self.events & self.violations) != 0

    def select(self, agent: int) -> Experience:
        """Returns the moves of one agent."""
        own = self.agents == agent
        return replace(self, **{name: getattr(self, name)[own] for name in Rows._fields})


def record_experience(task: Task, n_moves: int, generator: np.random.Generator) -> Experience:
    """Plays random available actions (epsilon = 1), agents in turn, and logs every move.

    An episode that ends, or reaches the task's step limit, is followed by another one. The task may
    be compiled or in plain Python; `n_moves` are moves of single agents, and `InputError` is raised
    for fewer than one. The generator seeds actions and initial states.
    """
    if n_moves < 1:
        raise InputError("n_moves", n_moves, "a whole number, at least 1")
    rows = make_rows(task, n_moves)
    stream = make_stream(generator)
    state = task.reset(stream)
    # A record that is no NamedTuple is a task in plain Python.
    fill = fill_rows if isinstance(task.kernel, tuple) else fill_rows.py_func
    with compile_notice("task's kernels"):
        fill(task.kernel, state, stream, rows)
    return Experience(
        task=task.id,
        variables=tuple(variable.name for variable in task.variables),
        cardinalities=np.array([variable.cardinality for variable in task.variables], np.int64),
        agent_names=task.agents,
        action_names=task.action_names,
        event_names=task.events,
        reward_names=task.rewards,
        violations=int(task.kernel.violations),
        **rows._asdict(),
    )


def make_rows(task: Task, n_moves: int) -> Rows:
    """Makes rows of zeros, to be written by `hose_learning.loop.fill_rows`."""
    shape = (n_moves, len(task.variables))
    return Rows(
        values=np.zeros(shape, np.int64),
        agents=np.zeros(n_moves, np.int64),
        actions=np.zeros(n_moves, np.int64),
        events=np.zeros(n_moves, np.int64),
        rewards=np.zeros((n_moves, len(task.rewards))),
        next_values=np.zeros(shape, np.int64),
    )


def write_experience(path: Path, experience: Experience) -> None:
    """Writes a log as an npz file that holds plain arrays alone."""
    data = io.BytesIO()
    entries: dict[str, Any] = {
        field.name: np.asarray(getattr(experience, field.name)) for field in fields(Experience)
    }
    np.savez_compressed(data, **entries)
    write_atomically(path, data.getvalue())
