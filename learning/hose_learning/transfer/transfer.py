"""What was learned on a partially constrained model, as a start on the task itself (chapter 7).

The source sees a part of the target's variables. Each value and each veto of the source holds for
all states of the target that look like its own:

    Q_t(s, a) = Q_s([s], a)     (7.1)        A_t(s) = A_s([s])     (7.2)

A table's row is copied to the rows of all those states. What was never written reads as zeros in
the source and in the target alike, so only written rows have to be copied, in hashed tables too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hose_learning.modules import Module
from hose_learning.study.training import Training
from hose_learning.tables import Table, count_free, grow
from hose_learning.transfer.transfer_kernels import write_rows
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task

LARGEST = 2**24
"""Most rows that a table may be given."""


@dataclass(frozen=True)
class Image:
    """Where the keys of one module of the source lie in that of the target.

    Attributes:
        strides: of each source variable in the source's key (k,).
        cardinalities: of these variables (k,).
        images: what a step of each adds to the target's key (k,).
        offsets: what each combination of the variables that only the target sees adds to it (n,).
        size: number of the source's keys.
    """

    strides: Integers
    cardinalities: Integers
    images: Integers
    offsets: Integers
    size: int

    def map(self, keys: Integers) -> Integers:
        """Returns all keys of the target that are projected onto each of the source's (n_keys, n).

        [s] = key of the source; its digits in mixed radix are the values of the shared variables.
        """
        digits = keys[:, None] // self.strides % self.cardinalities
        mapped: Integers = (digits @ self.images)[:, None] + self.offsets
        return mapped


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
    """A module that source and target have in common.

    Attributes:
        name: its name.
        table: the field of the memory that holds its rows.
        image: how its keys relate.
        parts: first key of each agent in the source and in the target.
    """

    name: str
    table: str
    image: Image
    parts: tuple[tuple[int, int], ...]


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
    for kind, table, bases in (("value", "table", "bases"), ("veto", "vetoes", "veto_bases")):
        modules = [module for module in source.settings.modules if module.kind == kind]
        others = [module for module in target.settings.modules if module.kind == kind]
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

    Args:
        source: the source's table.
        target: the target's, written in place where it has room.
        image: where keys go.
        parts: first key of each agent in the source and in the target.
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
