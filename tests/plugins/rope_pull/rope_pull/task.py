"""The task: its settings, and the names that go with its kernels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from hose_mj.errors import InputError
from hose_mj.tasks.task import Task, compose_task
from hose_mj.tasks.variables import Variable
from rope_pull.kernels import Rope


@dataclass(frozen=True, kw_only=True)
class RopeSettings:
    """Two robots that pull a rope over `n_cells` cells."""

    n_cells: int = 5
    step_limit: int = 40

    def __post_init__(self) -> None:
        if not isinstance(self.n_cells, int) or self.n_cells < 3:
            raise InputError("n_cells", self.n_cells, "an integer, at least 3")


def make_rope_pull(settings: RopeSettings) -> Task:
    """Makes the task."""
    return compose_task(
        partial(Rope, n_cells=settings.n_cells),
        id="rope-pull",
        agents=("left", "right"),
        action_names=("loose", "none", "pull"),
        variables=(Variable("rope", settings.n_cells, "the rope's cell"),),
        events=("off", "goal"),
        rewards={"goal": {"goal": 100.0}, "off": {"off": -10.0}},
        settings=settings,
        sizes={"rope": 1},
        terminal=("goal",),
        violations=("off",),
        success=("goal",),
        shared=("goal",),
    )
