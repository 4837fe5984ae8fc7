"""Ready modules for the tasks of the thesis: what its chapters let goal and veto modules see."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hose_learning.modules import Module
from hose_mj.errors import check_choice
from hose_mj.tasks.task import Task

VALUES = ("goal", "local", "monolithic")
"""A module for the goal's reward alone, such a one that sees only what is near the agent, or one
for all rewards that sees the whole state."""
VETOES = ("none", "modules", "monolithic", "thresholds", "values")
"""No vetoes; a boolean module for each constraint (section 5.3); one on the whole state; a value
module for each with a threshold (section 4.5); such modules without a threshold (Algorithm 4.1)."""
VETO_THRESHOLD = -10.0  # v_t of section 4.6


@dataclass(frozen=True)
class Constraint:
    """What one way to break a constraint has to do with."""

    name: str
    variables: tuple[str, ...]  # tell it
    events: tuple[str, ...]
    signals: tuple[str, ...]
    actions: tuple[str, ...] = ()  # those concerned, none for all


@dataclass(frozen=True)
class Parts:
    """What a task consists of for a modular learner, each part as names of variables."""

    state: tuple[str, ...]  # together the whole state, as far as it matters
    goal: tuple[str, ...]  # what the goal module sees
    local: tuple[str, ...]  # or what of it is near the agent
    signals: tuple[str, ...]  # what the goal module learns from
    constraints: tuple[Constraint, ...]


def find_parts(task: Task) -> Parts:
    """Returns the parts of a task; of one that is not listed, modules that see everything."""
    return PARTS.get(task.id, _find_any)(task)


def make_modules(
    task: Task, values: str, vetoes: str, threshold: float = VETO_THRESHOLD
) -> tuple[Module, ...]:
    """Makes modules for a task, by names of `VALUES` and `VETOES`.

    The threshold is that of the modules of "thresholds". `InputError` is raised for an unknown
    choice.
    """
    check_choice("values", values, VALUES)
    check_choice("vetoes", vetoes, VETOES)
    parts = find_parts(task)
    if values == "monolithic":
        goal = Module(name="monolithic", variables=parts.state, signals=task.rewards)
    else:
        seen = parts.local if values == "local" else parts.goal
        goal = Module(name="goal", variables=seen, signals=parts.signals)
    return (goal, *_make_constraint_modules(parts, vetoes, threshold))


def _make_constraint_modules(parts: Parts, vetoes: str, threshold: float) -> Sequence[Module]:
    if vetoes == "none":
        return ()
    if vetoes in ("thresholds", "values"):
        limit = threshold if vetoes == "thresholds" else None
        return [
            Module(
                name=c.name, variables=c.variables, signals=c.signals, credit="own", threshold=limit
            )
            for c in parts.constraints
        ]
    return [
        Module(
            name=c.name,
            kind="veto",
            variables=parts.state if vetoes == "monolithic" else c.variables,
            events=c.events,
            actions=c.actions,
        )
        for c in parts.constraints
    ]


def _find_line(task: Task) -> Parts:
    """Chapters 4 to 7: the formation where the goal is fixed, else the goal's place (d_g, theta_g).

    Near an agent are its cell, or where the goal moves the way there, and both neighbours.
    Distances, collisions and the grid are constraints of each robot by itself.
    """
    settings = task.settings
    formation = tuple(f"r_n_{i}" for i in range(1, settings.n_robots + 1))
    is_fixed = settings.goal not in ("random", "none")
    robots = range(settings.n_robots) if settings.single_agent else [None]
    constraints = [c for robot in robots for c in _find_line_constraints(task, robot)]
    seen_goal = ("d_g_0", "theta_g_0") if settings.single_agent else ("d_g", "theta_g")
    goal = formation if is_fixed else seen_goal
    near = ("p" if is_fixed else "r_g", "r_n", "r_p")
    return Parts(
        state=formation if is_fixed else ("goal", *formation),
        goal=goal,
        local=goal if settings.single_agent else near,
        signals=("goal",),
        constraints=tuple(constraints),
    )


def _find_line_constraints(task: Task, robot: int | None) -> list[Constraint]:
    """The constraints of a robot that a single agent moves, or of the agent's own (None)."""
    tail = "" if robot is None else f"_{robot}"
    actions = () if robot is None else tuple(a for a in task.action_names if a.endswith(tail))
    flags = tuple(f"o_{way}{tail}" for way in ("up", "down", "left", "right"))
    seen = {
        "stretch": ("distances", (f"r_n{tail}", f"r_p{tail}")),
        "collision": ("collisions", flags),
        "out": ("grid", (f"p{tail}",)),
    }
    return [
        Constraint(f"{name}{tail}", variables, (event,), (event,), actions)
        for event, (name, variables) in seen.items()
    ]


def _find_taxi(task: Task) -> Parts:
    """B.3: taxis and passengers; only collisions, by the four flags, are a constraint."""
    state = tuple(v.name for v in task.variables if not v.name.startswith("o_"))
    constraints = []
    for event in task.events:
        if event.startswith("collision"):
            tail = event.removeprefix("collision")
            flags = tuple(f"o_{way}{tail}" for way in ("up", "down", "left", "right"))
            constraints.append(Constraint(f"flags{tail}", flags, (event,), ("collision",)))
    return Parts(state, state, state, ("goal",), tuple(constraints))


def _find_corridor(task: Task) -> Parts:
    """Example 1: both robots' cells say everything."""
    state = ("p_0", "p_1")
    collision = Constraint("collisions", state, ("collision",), ("collision",))
    return Parts(state, state, state, ("goal",), (collision,))


def _find_maze(task: Task) -> Parts:
    """Table 5.1: where the robot is; its flags tell walls."""
    flags = tuple(v.name for v in task.variables if v.name.startswith("o_"))
    collision = Constraint("walls", flags, ("collision",), ("collision",))
    return Parts(("x", "y"), ("x", "y"), ("x", "y"), ("goal",), (collision,))


def _find_any(task: Task) -> Parts:
    """Everything that is seen, for each event that breaks a constraint."""
    state = tuple(variable.name for variable in task.variables)
    breaks = [name for bit, name in enumerate(task.events) if task.kernel.violations >> bit & 1]
    goal = tuple(name for name in task.rewards if name not in breaks)
    constraints = tuple(
        Constraint(name, state, (name,), (name,) if name in task.rewards else ()) for name in breaks
    )
    return Parts(state, state, state, goal, constraints)


PARTS: dict[str, Callable[[Any], Parts]] = {
    "line": _find_line,
    "line-non-cooperative": _find_line,
    "line-single-agent": _find_line,
    "line-2015": _find_line,
    "taxi": _find_taxi,
    "taxi-single-agent": _find_taxi,
    "corridor": _find_corridor,
    "maze": _find_maze,
}
