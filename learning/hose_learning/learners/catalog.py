"""All learners by id, imported when they are made.

Another package adds learners by entry points of the group `hose_learning.learners`, each of which
names a `LearnerEntry` of its own:

    [project.entry-points."hose_learning.learners"]
    my-rule = "my_package.learners:MY_RULE"

The entry names a module with a factory, `make(task, settings, generator)`, which returns what
`hose_learning.learner.make_learner` makes of the rule's record; the module registers what the rule
does in `hose_learning.rules`, with functions that are `hose_mj.jit.jitable`, as the files of this
folder do. The command line trains it, and the contract tests hold it to what all learners do.
"""

import dataclasses
import importlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal, cast

from numpy.random import Generator

from hose_learning.learner import Made
from hose_learning.presets import make_modules
from hose_learning.records import Memory
from hose_learning.settings import LearnerSettings
from hose_mj.errors import InputError, check_choice
from hose_mj.plugins import find_plugins, load_plugin, load_plugins
from hose_mj.tasks.task import Task

GROUP = "hose_learning.learners"
Schedule = Literal["turns", "joint"]


@dataclass(frozen=True, kw_only=True)
class LearnerEntry:
    """Where a learner is and what it is."""

    module: str  # where it is, imported when it is made
    section: str  # where the thesis has it, or whose it is
    description: str  # one line for listings
    schedule: Schedule = "turns"  # whether its agents move in "turns" (or alone) or jointly
    factory: str = "make"  # the function there that makes it
    # values, vetoes: its modules by default, see `hose_learning.presets`.
    values: str = "goal"
    vetoes: str = "none"
    # Fields of `LearnerSettings` that differ from its defaults.
    settings: Mapping[str, Any] = field(default_factory=dict)
    # Whether its greedy policies are composed into joint moves (section 6.4).
    composes: bool = False
    # Moves after which its module's `refresh` is called, in plain Python; 0 for never.
    refresh_moves: int = 0


def _read_own() -> dict[str, LearnerEntry]:
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    return {
        id: LearnerEntry(**{**entry, "module": f"{GROUP}.{entry['module']}"})
        for id, entry in tomllib.loads(text).items()
    }


LEARNERS = _read_own()  # those of this package, in catalog.toml


def list_learners() -> dict[str, LearnerEntry]:
    """Returns all learners by id, those of other packages last.

    Raises:
        InputError: an entry point of another package takes a name of ours.
    """
    load = partial(load_plugin, kind=LearnerEntry)
    return {**LEARNERS, **load_plugins(find_plugins(GROUP, LEARNERS), load)}


def find_learner(id: str) -> LearnerEntry:
    """Returns the entry of a learner; `InputError` if there is none of that id."""
    if id in LEARNERS:
        return LEARNERS[id]
    plugins = find_plugins(GROUP, LEARNERS)
    if id not in plugins:
        raise InputError("learner", id, "one of " + ", ".join([*LEARNERS, *plugins]))
    return cast(LearnerEntry, load_plugin(plugins[id], LearnerEntry))


def make_settings(
    id: str,
    task: Task,
    values: str | None = None,
    vetoes: str | None = None,
    threshold: float | None = None,
    **settings: Any,
) -> LearnerSettings:
    """Makes a learner's settings for a task.

    Args:
        id: one of `list_learners`.
        task: the task.
        values: what the value modules see (`hose_learning.presets.VALUES`); None for its default.
        vetoes: what vetoes (`hose_learning.presets.VETOES`); None for its default.
        threshold: of vetoing values; None for the thesis's.
        settings: fields of `LearnerSettings`; `modules` replaces those made here.

    Raises:
        InputError: an unknown id or choice, or a value outside its range.
    """
    entry = find_learner(id)
    if "modules" not in settings:
        limit = {} if threshold is None else {"threshold": threshold}
        modules = make_modules(task, values or entry.values, vetoes or entry.vetoes, **limit)
        settings = {"modules": modules, **settings}
    known = [f.name for f in dataclasses.fields(LearnerSettings)]
    for name in settings:
        check_choice("setting", name, known)
    return LearnerSettings(**{**entry.settings, **settings})


def make(id: str, task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes a learner that has learned nothing, from its id; the generator seeds all of its chance.

    `InputError` is raised for an unknown id, or settings that the task or the rule does not allow.
    """
    entry = find_learner(id)
    factory = getattr(importlib.import_module(entry.module), entry.factory)
    return cast(Made, factory(task, settings, generator))


def refresh(id: str, task: Task, settings: LearnerSettings, memory: Memory) -> None:
    """Lets a learner do what it does from time to time in plain Python, its memory in place."""
    importlib.import_module(find_learner(id).module).refresh(task, settings, memory)
