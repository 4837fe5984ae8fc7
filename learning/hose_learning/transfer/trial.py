"""Chapter 7's experiment: greedy episodes after a transfer, against exploring from scratch.

One configuration at a time: train on the source, transfer, and play a few greedy learning episodes
on the target. The control explores the target (epsilon 1, from scratch) for the same cost, where a
move on the target costs as much as a number of moves on the source.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hose_learning.learners import catalog
from hose_learning.settings import Exploration
from hose_learning.study.training import Training
from hose_learning.transfer.transfer import match_modules, transfer
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task

LEARNER = "d-rr-ql"
PER_SUCCESS = 0.001
"""What epsilon falls by with each goal reached on the source (section 4.6.1)."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What to run.

    Attributes:
        source, target: ids of the tasks.
        source_options, target_options: their options.
        moves: of training on the source.
        episodes: greedy learning episodes on the target.
        exchange: what a move on the target costs, in moves on the source; a control for each.
        values: what the goal modules see (`hose_learning.presets.VALUES`).
    """

    source: str
    target: str
    source_options: Mapping[str, Any]
    target_options: Mapping[str, Any]
    moves: int
    episodes: int
    exchange: tuple[float, ...]
    values: str = "goal"


@dataclass(frozen=True)
class Outcome:
    """What came of one configuration.

    Attributes:
        modules: names of the modules transferred.
        reached: whether each greedy episode on the target reached its goal.
        moves: of single agents in these episodes.
        source_reached: whether the greedy policy reaches the goal on the source itself.
        controls: for each exchange rate the moves explored, and whether they reached the goal.
        vetoes_before, vetoes_after: vetoed actions in the target's tables, before and after its
            episodes.
        vetoes_lost: those of before that are not there after.
    """

    modules: tuple[str, ...]
    reached: tuple[bool, ...]
    moves: int
    source_reached: bool
    controls: tuple[tuple[int, bool], ...]
    vetoes_before: int
    vetoes_after: int
    vetoes_lost: int


def run_trial(plan: Plan, generator: np.random.Generator) -> Outcome:
    """Runs one configuration; all that is left to chance comes from the generator.

    Raises:
        InputError: tasks that do not fit.
    """
    source_task, target_task = make_tasks(plan, generator)
    source = _make(plan, source_task, Exploration(per_success=PER_SUCCESS), generator)
    target = _make(plan, target_task, Exploration(epsilon=0.0), generator)
    match_modules(source, target)  # better now than after the training
    source.advance(moves=plan.moves)
    modules = transfer(source, target)
    before = list_vetoes(target)
    ended = target.advance(episodes=plan.episodes)
    after = list_vetoes(target)
    controls = []
    for rate in plan.exchange:
        moves = target.moves + int(plan.moves / rate)
        control = _make(plan, target_task, Exploration(), generator)
        found = control.advance(moves=moves).find_successes(target_task)
        controls.append((moves, bool(found.any())))
    return Outcome(
        modules=modules,
        reached=tuple(ended.find_successes(target_task).tolist()),
        moves=target.moves,
        source_reached=bool(source.test().find_successes(source_task)[0]),
        controls=tuple(controls),
        vetoes_before=len(before),
        vetoes_after=len(after),
        vetoes_lost=len(before - after),
    )


def make_tasks(plan: Plan, generator: np.random.Generator) -> tuple[Task, Task]:
    """Makes both tasks; a line task whose start or goal is random gets one that both keep."""
    target = make_task(plan.target, **plan.target_options)
    source = make_task(plan.source, **plan.source_options)
    drawn = _draw(target, generator)
    source_drawn = {name: cells for name, cells in drawn.items() if hasattr(source.settings, name)}
    return (
        make_task(plan.source, **{**plan.source_options, **source_drawn}),
        make_task(plan.target, **{**plan.target_options, **drawn}),
    )


def _draw(task: Task, generator: np.random.Generator) -> dict[str, Any]:
    """Draws the cells of a line task that its options leave to chance."""
    names = {field.name for field in dataclasses.fields(task.settings)}
    parts = {"start": "robots", "goal": "goals"}
    random = {
        name: task.layout[part]
        for name, part in parts.items()
        if name in names and part in task.layout and getattr(task.settings, name) == "random"
    }
    stream = make_stream(generator)
    while True:
        state = task.reset(stream)
        cells = {name: state[part].reshape(-1, 2).tolist() for name, part in random.items()}
        if cells.get("goal") != [[0, 0]]:  # the source's cell, which a fixed goal cannot be
            break
    drawn: dict[str, Any] = {name: tuple(map(tuple, each)) for name, each in cells.items()}
    if len(drawn.get("goal", ())) == 1:
        drawn["goal"] = drawn["goal"][0]
    return drawn


def _make(
    plan: Plan, task: Task, exploration: Exploration, generator: np.random.Generator
) -> Training:
    settings = catalog.make_settings(LEARNER, task, plan.values, exploration=exploration)
    return Training(task, LEARNER, settings, generator.spawn(1)[0])


def list_vetoes(training: Training) -> set[tuple[int, int]]:
    """Returns all vetoed pairs of a veto module's state and an action."""
    table, n_actions = training.memory.vetoes, training.task.n_actions
    vetoes: set[tuple[int, int]] = set()
    hashed = len(table.keys) > 0
    for row in np.flatnonzero(table.rows[:-1, 0]).tolist():
        key = int(table.keys[row]) - 1 if hashed else row
        bits = int(table.rows[row, 0])
        vetoes |= {(key, action) for action in range(n_actions) if bits >> action & 1}
    return vetoes
