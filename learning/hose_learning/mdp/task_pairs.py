"""Pairs of tasks for Definition 11: how a task's states project onto another's, ready examples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hose_learning.mdp.explicit_mdp import WrittenTask, write_out
from hose_learning.mdp.partially_constrained import ABSENT
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import TURN, Integers
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task


@dataclass(frozen=True)
class Pair:
    """Two tasks and what Definition 11 says about them.

    Attributes:
        meaning: in a line.
        source: id of the source task.
        target: id of the target task.
        settings: options of both.
        source_settings: options of the source alone.
        target_settings: options of the target alone.
        violated: the properties that do not hold.
    """

    meaning: str
    source: str
    target: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    source_settings: Mapping[str, Any] = field(default_factory=dict)
    target_settings: Mapping[str, Any] = field(default_factory=dict)
    violated: tuple[int, ...] = ()


_FLOOR = {"n_robots": 2, "hose_length": 20, "start": ((1, 1), (1, 0)), "goal": (2, 2)}
_HOSE = {"n_robots": 2, "hose_length": 4, "half_width": 3, "start": ((2, 0), (1, 0))}
PAIRS = {
    "wide-floor": Pair(
        "the source's floor is wider, so leaving it is noticed later",
        *("line", "line", _FLOOR, {"half_width": 3}, {"half_width": 2}),
    ),
    "hose-passes": Pair(
        "in the source only robots are in the way, in the target the hose too",
        *("line", "line", {**_HOSE, "goal": (3, 0)}, {"collision": "robots"}, {}),
    ),
    "narrow-source": Pair(
        "the target has cells that the source lacks or forbids",
        *("line", "line", _FLOOR, {"half_width": 2}, {"half_width": 3}, (1, 3)),
    ),
    "cancelled-moves": Pair(
        "the target cancels impossible moves, the source makes them",
        *("line", "line", {**_HOSE, "goal": (3, 0)}, {}, {"move_rule": "cancelling"}, (2,)),
    ),
    "dearer-goal": Pair(
        "the goal is worth more in the target",
        *("line", "line", {**_HOSE, "goal": (3, 0)}, {}, {"goal_reward": 200.0}, (3,)),
    ),
    "fewer-passengers": Pair(
        "the source's taxi is done while the target's second passenger waits",
        *("taxi", "taxi", {"starts": ((2, 2),)}, {"passengers": (("R", "B"),)}, {}, (1, 2, 3, 4)),
    ),
    "goal-under-the-hose": Pair(
        "as hose-passes, but the hose can lie on the goal: the source rewards a forbidden move",
        *("line", "line", {**_HOSE, "goal": (0, 1)}, {"collision": "robots"}, {}, (4,)),
    ),
}
"""Ready pairs: the first two are PCMs, the others each miss what `violated` says."""


@dataclass(frozen=True, eq=False)
class WrittenPair:
    """Two tasks written out, and [s], the source state of each target state (n_target_states,)."""

    source: WrittenTask
    target: WrittenTask
    projection: Integers


def make_tasks(pair: Pair) -> tuple[Task, Task]:
    """Makes source and target."""
    return (
        make_task(pair.source, **{**pair.settings, **pair.source_settings}),
        make_task(pair.target, **{**pair.settings, **pair.target_settings}),
    )


def write_pair(
    source: Task, target: Task, random: np.random.Generator, limit: int = 10**5
) -> WrittenPair:
    """Writes two tasks out from one start, drawn for the target.

    Args:
        source: a task with the parts of the target's state, or fewer or shorter ones.
        target: a task with the same agents and actions.
        random: draws the start.
        limit: largest number of states of a task.

    Raises:
        InputError: agents, actions or parts that differ, or more states than the limit.
    """
    for name, given, valid in (
        ("agents of the target", target.agents, source.agents),
        ("actions of the target", target.action_names, source.action_names),
    ):
        if given != valid:
            raise InputError(name, given, f"the source's, {valid}")
    sizes = {name: _measure(place) for name, place in target.layout.items()}
    for name, place in source.layout.items():
        if _measure(place) > sizes.get(name, 0):
            raise InputError(f"size of {name!r} in the source", _measure(place), "the target's")
    start = target.reset(make_stream(random))
    written_source = write_out(source, [project_state(source, target, start)], limit)
    written_target = write_out(target, [start], limit)
    return WrittenPair(
        written_source,
        written_target,
        _project_all(source, target, written_source, written_target),
    )


def _measure(place: slice) -> int:
    return int(place.stop - place.start)


def project_state(source: Task, target: Task, state: Integers) -> Integers:
    """Returns the source's state with the target state's turn and parts, the events left aside.

    Of a part that is longer in the target (two passengers, one in the source) the first are kept.
    """
    projected = source.make_state()
    projected[TURN] = state[TURN]
    for name, place in source.layout.items():
        projected[place] = state[target.layout[name]][: _measure(place)]
    return projected


def _project_all(
    source: Task, target: Task, written_source: WrittenTask, written_target: WrittenTask
) -> Integers:
    """Returns [s] of each target state.

    The events that led to a state are variables of it. Those that the source has in such a state
    are kept; where the source can only be there without them, they are among the variables removed.
    """
    projection = np.full(len(written_target.states), ABSENT)
    anywhere: dict[bytes, int] = {}
    for (place, _), number in written_source.numbers.items():
        anywhere.setdefault(place, number)
    bits = {name: 1 << bit for bit, name in enumerate(source.events)}
    for k, state in enumerate(written_target.states):
        key = project_state(source, target, state).tobytes()
        names = target.name_events(int(written_target.events[k]))
        known = sum(bits.get(name, 0) for name in names)
        found = (written_source.numbers.get((key, events)) for events in (known, 0))
        projection[k] = next((n for n in found if n is not None), anywhere.get(key, ABSENT))
    return projection
