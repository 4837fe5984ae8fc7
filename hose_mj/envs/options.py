"""The options that all interfaces share, turned into a task."""

from __future__ import annotations

from typing import Any

from hose_mj.errors import InputError
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.task import Task


def build_task(task: str | Task, options: dict[str, Any], max_cycles: int | None = None) -> Task:
    """Returns a task.

    Args:
        task: its id in `hose_mj.tasks.registry`, or a task made before.
        options: options of the task; none if it is made already.
        max_cycles: rounds of moves after which an episode is cut off, in place of the task's
            `step_limit`, which counts the moves of single agents.

    Raises:
        InputError: an unknown task or option, or a value outside its valid set.
    """
    if isinstance(task, Task):
        if options or max_cycles is not None:
            given = sorted(options) + ["max_cycles"] * (max_cycles is not None)
            raise InputError("options", given, "none beside a Task, which has its own")
        return task
    made = make_task(task, **options)
    if max_cycles is None:
        return made
    if "step_limit" in options:
        raise InputError("max_cycles", max_cycles, "given without step_limit")
    if isinstance(max_cycles, bool) or not isinstance(max_cycles, int) or max_cycles < 1:
        raise InputError("max_cycles", max_cycles, "an integer, at least 1")
    return make_task(task, **options, step_limit=max_cycles * made.n_agents)


def refuse_reset_options(options: dict[str, Any] | None) -> None:
    """Raises `InputError` for options of a reset: there are none."""
    if options:
        raise InputError(
            "options of reset", sorted(options), "none; a task's options are made with it"
        )
