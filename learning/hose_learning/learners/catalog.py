"""All learners by id, imported when they are made."""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, cast

import numpy as np

from hose_learning.presets import make_modules
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings
from hose_mj.errors import InputError
from hose_mj.tasks.task import Task

Schedule = Literal["turns", "joint"]


@dataclass(frozen=True, kw_only=True)
class LearnerEntry:
    """Where a learner is and what it is.

    Attributes:
        file: its module under `hose_learning.learners`.
        factory: the function there that makes it.
        schedule: whether its agents move in "turns" (or alone) or jointly.
        section: where the thesis has it.
        description: one line for listings.
        values, vetoes: its modules by default, see `hose_learning.presets`.
        settings: fields of `LearnerSettings` that differ from its defaults.
        composes: whether its greedy policies are composed into joint moves (section 6.4).
        refresh_moves: moves after which its file's `refresh` is called, in plain Python; 0 for
            never.
    """

    file: str
    schedule: Schedule
    section: str
    description: str
    factory: str = "make"
    values: str = "goal"
    vetoes: str = "none"
    settings: Mapping[str, Any] = field(default_factory=dict)
    composes: bool = False
    refresh_moves: int = 0


LEARNERS: dict[str, LearnerEntry] = {
    "q-learning": LearnerEntry(
        file="round_robin",
        schedule="turns",
        section="Algorithm 3.1",
        description="one table of all rewards; with several agents each learns alone",
        values="monolithic",
    ),
    "modular-q": LearnerEntry(
        file="round_robin",
        factory="make_cycle_sum",
        schedule="turns",
        section="Algorithm 4.1",
        description="a value module for the goal and for each constraint, and a mediator",
        vetoes="values",
    ),
    "thresholded-msav": LearnerEntry(
        file="round_robin",
        factory="make_cycle_sum",
        schedule="turns",
        section="4.5, eq. 4.4",
        description="modular Q-learning where values below a threshold veto an action",
        vetoes="thresholds",
    ),
    "safe-msav": LearnerEntry(
        file="round_robin",
        factory="make_cycle_sum",
        schedule="turns",
        section="5.3, eq. 5.2",
        description="a goal module, and modules that veto what once broke a constraint",
        vetoes="modules",
    ),
    "rr-q": LearnerEntry(
        file="central",
        schedule="turns",
        section="Algorithm 6.1",
        description="one learner for everybody's turn, whose turn it is being part of the state",
        values="monolithic",
    ),
    "d-rr-ql-messages": LearnerEntry(
        file="messages",
        schedule="turns",
        section="Algorithm 6.2",
        description="a table for each agent, which learns from its successor's best value",
        values="monolithic",
        composes=True,
    ),
    "d-rr-ql": LearnerEntry(
        file="round_robin",
        schedule="turns",
        section="Algorithm 6.3",
        description="each agent learns alone from whole cycles of turns, with vetoes",
        vetoes="modules",
        composes=True,
    ),
    "d-rr-ql-traces": LearnerEntry(
        file="traces",
        schedule="turns",
        section="author's experiment of 2015",
        description="d-rr-ql with optimistic replacing traces",
        vetoes="modules",
        settings={"learning_rate": 0.1},
        composes=True,
    ),
    "usap": LearnerEntry(
        file="usap",
        schedule="turns",
        section="8.2, Algorithms 8.1, 8.3",
        description="a classifier predicts what would break a constraint, and vetoes it",
        refresh_moves=1000,
    ),
    "risk-q": LearnerEntry(
        file="risk_q",
        schedule="turns",
        section="3.2.1 (Geibel)",
        description="a second table learns the risk of breaking a constraint",
    ),
    "d-ql": LearnerEntry(
        file="distributed_q",
        schedule="joint",
        section="3.6.1 (Lauer and Riedmiller)",
        description="agents that move at once, each of whom takes the best that ever followed",
        values="monolithic",
    ),
    "team-q": LearnerEntry(
        file="team_q",
        schedule="joint",
        section="3.1, team learning",
        description="one table over the joint actions of all agents",
        values="monolithic",
    ),
    "hysteretic-q": LearnerEntry(
        file="hysteretic_q",
        schedule="joint",
        section="3.6.1 (Matignon et al.)",
        description="d-ql that forgets slowly: values fall by a smaller rate than they rise",
        values="monolithic",
    ),
    "distributed-rewards": LearnerEntry(
        file="distributed_rewards",
        schedule="joint",
        section="3.6.1 (Schneider et al.)",
        description="each agent learns from its neighbours' rewards too",
        values="monolithic",
    ),
    "distributed-values": LearnerEntry(
        file="distributed_values",
        schedule="joint",
        section="3.6.1 (Schneider et al.)",
        description="each agent learns from its neighbours' values too",
        values="monolithic",
    ),
    "coordinated-q": LearnerEntry(
        file="coordinated_q",
        schedule="joint",
        section="3.6.3 (Guestrin et al.)",
        description="local values over a coordination graph, one error for all of them",
        values="monolithic",
    ),
    "sparse-q": LearnerEntry(
        file="sparse_q",
        schedule="joint",
        section="3.6.3 (Kok and Vlassis)",
        description="local values over a coordination graph, an error for each edge or agent",
        values="monolithic",
    ),
}


def find_learner(id: str) -> LearnerEntry:
    """Returns the entry of a learner.

    Raises:
        InputError: there is none of that id.
    """
    if id not in LEARNERS:
        raise InputError("learner", id, "one of " + ", ".join(LEARNERS))
    return LEARNERS[id]


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
        id: a key of `LEARNERS`.
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
        if name not in known:
            raise InputError("setting", name, "one of " + ", ".join(known))
    return LearnerSettings(**{**entry.settings, **settings})


def make(
    id: str, task: Task, settings: LearnerSettings, generator: np.random.Generator
) -> tuple[Learner, Memory]:
    """Makes a learner that has learned nothing.

    Args:
        id: a key of `LEARNERS`.
        task: the task it is for.
        settings: its settings.
        generator: seeds its choices and the resets.

    Raises:
        InputError: an unknown id, or settings that the task or the rule does not allow.
    """
    entry = find_learner(id)
    module = _import(entry)
    made = getattr(module, entry.factory)(task, settings, generator)
    return cast("tuple[Learner, Memory]", made)


def refresh(id: str, task: Task, settings: LearnerSettings, memory: Memory) -> None:
    """Lets a learner do what it does from time to time in plain Python, its memory in place."""
    _import(find_learner(id)).refresh(task, settings, memory)


def _import(entry: LearnerEntry) -> Any:
    return importlib.import_module(f"hose_learning.learners.{entry.file}")
