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

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
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
    """Where a learner is and what it is.

    Attributes:
        module: where it is, imported when it is made.
        factory: the function there that makes it.
        schedule: whether its agents move in "turns" (or alone) or jointly.
        section: where the thesis has it, or whose it is.
        description: one line for listings.
        values, vetoes: its modules by default, see `hose_learning.presets`.
        settings: fields of `LearnerSettings` that differ from its defaults.
        composes: whether its greedy policies are composed into joint moves (section 6.4).
        refresh_moves: moves after which its module's `refresh` is called, in plain Python; 0 for
            never.
    """

    module: str
    schedule: Schedule
    section: str
    description: str
    factory: str = "make"
    values: str = "goal"
    vetoes: str = "none"
    settings: Mapping[str, Any] = field(default_factory=dict)
    composes: bool = False
    refresh_moves: int = 0


def _turns(file: str, section: str, description: str, **rest: Any) -> LearnerEntry:
    module = f"hose_learning.learners.{file}"
    shared = {"schedule": "turns", "section": section, "description": description}
    return LearnerEntry(module=module, **{**shared, **rest})


def _joint(file: str, section: str, description: str) -> LearnerEntry:
    return _turns(file, section, description, schedule="joint", values="monolithic")


LEARNERS: dict[str, LearnerEntry] = {
    "q-learning": _turns(
        "round_robin",
        "Algorithm 3.1",
        "one table of all rewards; with several agents each learns alone",
        values="monolithic",
    ),
    "modular-q": _turns(
        "round_robin",
        "Algorithm 4.1",
        "a value module for the goal and for each constraint, and a mediator",
        factory="make_cycle_sum",
        vetoes="values",
    ),
    "thresholded-msav": _turns(
        "round_robin",
        "4.5, eq. 4.4",
        "modular Q-learning where values below a threshold veto an action",
        factory="make_cycle_sum",
        vetoes="thresholds",
    ),
    "safe-msav": _turns(
        "round_robin",
        "5.3, eq. 5.2",
        "a goal module, and modules that veto what once broke a constraint",
        factory="make_cycle_sum",
        vetoes="modules",
    ),
    "rr-q": _turns(
        "central",
        "Algorithm 6.1",
        "one learner for everybody's turn, whose turn it is being part of the state",
        values="monolithic",
    ),
    "d-rr-ql-messages": _turns(
        "messages",
        "Algorithm 6.2",
        "a table for each agent, which learns from its successor's best value",
        values="monolithic",
        composes=True,
    ),
    "d-rr-ql": _turns(
        "round_robin",
        "Algorithm 6.3",
        "each agent learns alone from whole cycles of turns, with vetoes",
        vetoes="modules",
        composes=True,
    ),
    "d-rr-ql-traces": _turns(
        "traces",
        "author's experiment of 2015",
        "d-rr-ql with optimistic replacing traces",
        vetoes="modules",
        settings={"learning_rate": 0.1},
        composes=True,
    ),
    "usap": _turns(
        "usap",
        "8.2, Algorithms 8.1, 8.3",
        "a classifier predicts what would break a constraint, and vetoes it",
        refresh_moves=1000,
    ),
    "risk-q": _turns(
        "risk_q", "3.2.1 (Geibel)", "a second table learns the risk of breaking a constraint"
    ),
    "d-ql": _joint(
        "distributed_q",
        "3.6.1 (Lauer and Riedmiller)",
        "agents that move at once, each of whom takes the best that ever followed",
    ),
    "team-q": _joint(
        "team_q", "3.1, team learning", "one table over the joint actions of all agents"
    ),
    "hysteretic-q": _joint(
        "hysteretic_q",
        "3.6.1 (Matignon et al.)",
        "d-ql that forgets slowly: values fall by a smaller rate than they rise",
    ),
    "distributed-rewards": _joint(
        "distributed_rewards",
        "3.6.1 (Schneider et al.)",
        "each agent learns from its neighbours' rewards too",
    ),
    "distributed-values": _joint(
        "distributed_values",
        "3.6.1 (Schneider et al.)",
        "each agent learns from its neighbours' values too",
    ),
    "coordinated-q": _joint(
        "coordinated_q",
        "3.6.3 (Guestrin et al.)",
        "local values over a coordination graph, one error for all of them",
    ),
    "sparse-q": _joint(
        "sparse_q",
        "3.6.3 (Kok and Vlassis)",
        "local values over a coordination graph, an error for each edge or agent",
    ),
}
"""Those of this package."""


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
