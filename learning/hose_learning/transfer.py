"""What was learned on a partially constrained model, as a start on the task itself (chapter 7).

The source sees a part of the target's variables. Each value and each veto of the source holds for
all states of the target that look like its own:

    Q_t(s, a) = Q_s([s], a)     (7.1)        A_t(s) = A_s([s])     (7.2)

A table's row is copied to the rows of all those states. What was never written reads as zeros in
the source and in the target alike, so only written rows have to be copied, in hashed tables too.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hose_learning.learners import catalog
from hose_learning.modules import Kind, Module
from hose_learning.settings import Exploration
from hose_learning.study.training import Training
from hose_learning.tables import Table, count_free, grow, write_rows
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task

LARGEST = 2**24  # most rows that a table may be given


@dataclass(frozen=True)
class Image:
    """Where the keys of one module of the source lie in that of the target."""

    strides: Integers  # of each source variable in the source's key (k,)
    cardinalities: Integers  # of these variables (k,)
    images: Integers  # what a step of each adds to the target's key (k,)
    # What each combination of the variables that only the target sees adds to it (n,).
    offsets: Integers
    size: int  # number of the source's keys

    def map(self, keys: Integers) -> Integers:
        """Returns all keys of the target that are projected onto each of the source's (n_keys, n).

        [s] = key of the source; its digits in mixed radix are the values of the shared variables.
        """
        digits = keys[:, None] // self.strides % self.cardinalities
        return (digits @ self.images)[:, None] + self.offsets


def make_image(source: Task, source_module: Module, target: Task, target_module: Module) -> Image:
    """Relates the keys of two modules through the variables' names.

    Raises:
        InputError: a variable of the source that the target's module does not see or counts
            otherwise, or too many states that look alike.
    """
    below = source.make_projection(source_module.variables)
    above = target.make_projection(target_module.variables)
    strides = dict(zip(target_module.variables, above.strides.tolist(), strict=True))
    counts = {variable.name: variable.cardinality for variable in target.variables}
    known = {variable.name: variable.cardinality for variable in source.variables}
    for name in source_module.variables:
        if name not in strides:
            seen = ", ".join(target_module.variables)
            raise InputError(f"variable of the source's module {source_module.name}", name, seen)
        if counts[name] != known[name]:
            valid = f"{counts[name]}, as in the target"
            raise InputError(f"number of values of the source's {name}", known[name], valid)
    extra = [name for name in target_module.variables if name not in source_module.variables]
    n_alike = math.prod(counts[name] for name in extra)
    if n_alike > LARGEST:
        raise InputError("variables that only the target sees", extra, f"at most {LARGEST} states")
    offsets = np.zeros(1, np.int64)
    for name in extra:
        steps = np.arange(counts[name], dtype=np.int64) * strides[name]
        offsets = np.add.outer(offsets, steps).ravel()
    return Image(
        strides=below.strides,
        cardinalities=np.array([known[n] for n in source_module.variables], np.int64),
        images=np.array([strides[n] for n in source_module.variables], np.int64),
        offsets=offsets,
        size=below.size,
    )


@dataclass(frozen=True)
class Match:
    """A module that source and target have in common."""

    name: str
    table: str  # field of the memory that holds its rows
    image: Image  # how its keys relate
    parts: tuple[tuple[int, int], ...]  # first key of each agent in source and target


def transfer(source: Training, target: Training) -> tuple[str, ...]:
    """Starts a learner from what another one has learned on a partially constrained model.

    Modules are matched by kind and name. Exploration, counters and what a rule keeps beside its
    tables stay the target's own.

    Args:
        source: the learner that was trained.
        target: one that has not made a move yet; changed in place.

    Returns:
        The names of the modules that were transferred.

    Raises:
        InputError: agents, actions or modules that do not fit, or a target that has learned. The
            target is then as it was.
    """
    if target.moves:
        raise InputError("moves of the target", target.moves, "0: it must not have learned yet")
    matches = match_modules(source, target)
    tables = {"table": target.memory.table, "vetoes": target.memory.vetoes}
    for match in matches:
        written = getattr(source.memory, match.table)
        tables[match.table] = carry(written, tables[match.table], match.image, match.parts)
    target.restore(target.memory._replace(table=tables["table"], vetoes=tables["vetoes"]))
    return tuple(match.name for match in matches)


def match_modules(source: Training, target: Training) -> list[Match]:
    """Finds the modules that source and target have in common.

    Raises:
        InputError: agents, actions or modules that do not fit, nothing in common, or more rows to
            write than `LARGEST`.
    """
    for name in ("agents", "action_names"):
        ours, theirs = getattr(source.task, name), getattr(target.task, name)
        if ours != theirs:
            raise InputError(f"{name} of the source", ours, f"those of the target, {theirs}")
    if describe_rows(source) != describe_rows(target):
        valid = f"one whose tables are laid out as those of {target.learner_id}"
        raise InputError("learner of the source", source.learner_id, valid)
    matches = []
    kinds: tuple[tuple[Kind, str, str], ...] = (
        ("value", "table", "bases"),
        ("veto", "vetoes", "veto_bases"),
    )
    for kind, table, bases in kinds:
        modules = source.settings.select(kind)
        others = target.settings.select(kind)
        names = [module.name for module in others]
        n_written = len(list_written(getattr(source.memory, table))[0])
        for place, module in enumerate(modules):
            if module.name not in names:
                continue
            other = names.index(module.name)
            image = make_image(source.task, module, target.task, others[other])
            if n_written * len(image.offsets) > LARGEST:
                n_rows = n_written * len(image.offsets)
                raise InputError(f"rows of module {module.name}", n_rows, f"at most {LARGEST}")
            first_keys = getattr(source.learner, bases)[place].tolist()
            other_first_keys = getattr(target.learner, bases)[other].tolist()
            parts = tuple(zip(first_keys, other_first_keys, strict=True))
            matches.append(Match(module.name, table, image, parts))
    if not matches:
        known = ", ".join(module.name for module in source.settings.modules)
        seen = tuple(module.name for module in target.settings.modules)
        raise InputError("modules of the target", seen, f"some of the source's: {known}")
    return matches


def carry(source: Table, target: Table, image: Image, parts: Iterable[tuple[int, int]]) -> Table:
    """Copies the written rows of one module; returns the target's table, grown where it must be.

    `image` says where keys go, `parts` the first key of each agent in the source and in the target,
    which is written in place where it has room.
    """
    keys, places = list_written(source)
    for base, other_base in parts:
        own = (keys >= base) & (keys < base + image.size)
        mapped = image.map(keys[own] - base) + other_base
        while count_free(target) < mapped.size:
            target = grow(target)
        origins = np.repeat(places[own], mapped.shape[1])
        write_rows(target, mapped.ravel(), source.rows, origins)
    return target


def describe_rows(training: Training) -> tuple[int, int]:
    """Returns the length of a row of Q-values, and the tables of each value module."""
    return training.memory.table.rows.shape[1], training.learner.bases.shape[1]


def list_written(table: Table) -> tuple[Integers, Integers]:
    """Returns the keys of all rows that hold something, and the places of these rows."""
    if len(table.keys):
        places = np.flatnonzero(table.keys)
        return table.keys[places] - 1, places
    places = np.flatnonzero(table.rows[:-1].any(axis=1))
    return places, places


LEARNER = "d-rr-ql"
PER_SUCCESS = 0.001  # what epsilon falls by with each goal reached on the source (section 4.6.1)


@dataclass(frozen=True, kw_only=True)
class TransferPlan:
    """What to run."""

    # source, target: ids of the tasks.
    source: str
    target: str
    # source_options, target_options: their options.
    source_options: Mapping[str, Any]
    target_options: Mapping[str, Any]
    moves: int  # of training on the source
    episodes: int  # greedy learning episodes on the target
    # What a move on the target costs, in moves on the source; a control for each.
    exchange: tuple[float, ...]
    values: str = "goal"  # what the goal modules see (`hose_learning.presets.VALUES`)


@dataclass(frozen=True)
class TransferOutcome:
    """What came of one configuration."""

    modules: tuple[str, ...]  # names of the modules transferred
    reached: tuple[bool, ...]  # whether each greedy episode on the target reached its goal
    moves: int  # of single agents in these episodes
    source_reached: bool  # whether the greedy policy reaches the goal on the source itself
    # For each exchange rate the moves explored, and whether they reached the goal.
    controls: tuple[tuple[int, bool], ...]
    # vetoes_before, vetoes_after: vetoed actions in the target's tables, before and after its
    # episodes.
    vetoes_before: int
    vetoes_after: int
    vetoes_lost: int  # those of before that are not there after


def run_trial(plan: TransferPlan, generator: np.random.Generator) -> TransferOutcome:
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
    return TransferOutcome(
        modules=modules,
        reached=tuple(ended.find_successes(target_task).tolist()),
        moves=target.moves,
        source_reached=bool(source.test().find_successes(source_task)[0]),
        controls=tuple(controls),
        vetoes_before=len(before),
        vetoes_after=len(after),
        vetoes_lost=len(before - after),
    )


def make_tasks(plan: TransferPlan, generator: np.random.Generator) -> tuple[Task, Task]:
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
    plan: TransferPlan, task: Task, exploration: Exploration, generator: np.random.Generator
) -> Training:
    settings = catalog.make_settings(LEARNER, task, plan.values, exploration=exploration)
    return Training(task, LEARNER, settings, generator.spawn(1)[0])


def list_vetoes(training: Training) -> set[tuple[int, int]]:
    """Returns all vetoed pairs of a veto module's state and an action."""
    table = training.memory.vetoes
    keys, places = list_written(table)
    bits = table.rows[places, 0, None] >> np.arange(training.task.n_actions) & 1
    return {(int(keys[k]), int(action)) for k, action in np.argwhere(bits)}
