"""The tasks by id, imported when they are made; those of other packages too.

A package adds a task by an entry point of the group `hose_mj.tasks`, named as the task's id, whose
value is a `TaskEntry`:

    [project.entry-points."hose_mj.tasks"]
    rope-pull = "my_package:ROPE_PULL"

    ROPE_PULL = TaskEntry("my_package.rope_pull", "Settings", "make", "two robots pull a rope")

Its module has the settings, a frozen dataclass with a field `step_limit`, and the factory, which
takes the settings and returns a `Task` (`hose_mj.tasks.task.compose_task` makes one) after its
kernels have been registered. Commands, learners and environments then take its id.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING, Any, cast

from hose_mj.errors import InputError, check_choice
from hose_mj.plugins import find_plugins, load_plugin, load_plugins

if TYPE_CHECKING:
    from hose_mj.tasks.task import Task


@dataclass(frozen=True)
class TaskEntry:
    """Where a task is and what it is."""

    module: str  # module with the settings class and the factory, which takes the settings
    settings: str  # name of the settings class
    factory: str  # name of the factory
    description: str  # one line for listings
    # Settings that make the id; they cannot be given.
    presets: Mapping[str, Any] = field(default_factory=dict)
    # Settings that differ from the class's defaults; they can.
    defaults: Mapping[str, Any] = field(default_factory=dict)
    is_alone: bool = False  # whether the task has one agent whatever its settings


_LINE = ("hose_mj.tasks.line.settings", "LineSettings", "make_line")
_TAXI = ("hose_mj.tasks.taxi.settings", "TaxiSettings", "make_taxi")
_TINY = "hose_mj.tasks.tiny.settings"
TASKS: dict[str, TaskEntry] = {
    "line": TaskEntry(
        *_LINE,
        "robots pull a hose of line segments to a common goal (B.2)",
        {"own_goals": False, "single_agent": False},
    ),
    "line-non-cooperative": TaskEntry(
        *_LINE,
        "robots pull a hose of line segments, each to a goal of its own (B.2)",
        {"own_goals": True, "single_agent": False},
    ),
    "line-single-agent": TaskEntry(
        *_LINE,
        "one agent moves all robots of the hose, one at a time (chapter 5)",
        {"own_goals": False, "single_agent": True},
        is_alone=True,
    ),
    "line-2015": TaskEntry(
        *_LINE,
        "the author's experiment of 2015: four robots, fixed start and goal",
        {"own_goals": False, "single_agent": False},
        {
            "half_width": 9,
            "start": ((2, 5), (2, 3), (3, 1), (1, 2)),
            "goal": (-2, -2),
            "collision": "robots",
            "move_rule": "cancelling",
            "goal_reward": 10.0,
            "violation_reward": -1.0,
            "step_limit": 1600,
        },
    ),
    "taxi": TaskEntry(
        *_TAXI, "two taxis and two passengers on Dietterich's map (B.3)", {"single_agent": False}
    ),
    "taxi-single-agent": TaskEntry(
        *_TAXI,
        "one agent chooses for both taxis at once (section 5.5.2)",
        {"single_agent": True},
        is_alone=True,
    ),
    "corridor": TaskEntry(
        *(_TINY, "CorridorSettings", "make_corridor"),
        "two robots in a corridor of three cells (Example 1, section 6.4)",
    ),
    "maze": TaskEntry(
        *(_TINY, "MazeSettings", "make_maze", "one robot among the walls of Table 5.1"),
        is_alone=True,
    ),
}


GROUP = "hose_mj.tasks"


def find_task_plugins() -> dict[str, EntryPoint]:
    """Returns the entry points of other packages' tasks by id; imports none of them.

    Raises:
        InputError: an id that is taken.
    """
    return find_plugins(GROUP, TASKS)


def list_tasks() -> dict[str, TaskEntry]:
    """Returns all tasks by id, those of other packages last.

    Raises:
        InputError: an id that is taken.
    """
    return {**TASKS, **load_plugins(find_task_plugins(), partial(load_plugin, kind=TaskEntry))}


def find_task(id: str) -> TaskEntry:
    """Returns the entry of a task.

    Raises:
        InputError: an unknown id, or a package whose entry cannot be imported.
    """
    if id in TASKS:
        return TASKS[id]
    plugins = find_task_plugins()
    if id not in plugins:
        raise InputError("task", id, "one of " + ", ".join([*TASKS, *plugins]))
    return cast(TaskEntry, load_plugin(plugins[id], TaskEntry))


def make_task(id: str, **settings: Any) -> Task:
    """Makes a task.

    Args:
        id: a key of `list_tasks`.
        settings: options of the task, the fields of its settings class.

    Raises:
        InputError: an unknown id or option, or a value outside its valid set.
    """
    entry = find_task(id)
    module = importlib.import_module(entry.module)
    kind = getattr(module, entry.settings)
    options = [f.name for f in dataclasses.fields(kind) if f.name not in entry.presets]
    for name in settings:
        check_choice(f"option of {id}", name, options)
    made = kind(**{**entry.defaults, **settings, **entry.presets})
    task = getattr(module, entry.factory)(made)
    return cast("Task", dataclasses.replace(task, id=id))
