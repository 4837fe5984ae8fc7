"""`SavedLearner`: what `hose-mj train line` has learned, as a policy of `hose-mj rollout`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from hose_learning import loop
from hose_learning.evaluation import make_probe
from hose_learning.study.run_folder import RunFolder

from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import STEPS, TURN
from hose_mj.tasks.line.kernels import Line
from hose_mj.tasks.stream import make_stream
from hose_mj.world.actions import Actions, compute_cells
from hose_mj.world.driving import Driver
from hose_mj.world.world import World


class SavedLearner:
    """What a training learned, acting greedily, one robot after the other.

    Before each turn the robots' and the goal's cells become the task's state; the learner's choice
    is then driven in the world. Steps of the world between two turns are the task's one move.

    Args:
        path: the run folder of a training on the task `line`.

    Raises:
        InputError: no run, or one of another task or of a learner whose agents move at once.
    """

    ends_at_goal = True

    def __init__(self, path: Path) -> None:
        self._path = path
        self._training, _ = RunFolder(path).open()
        task = self._training.task
        if not isinstance(task.kernel, Line) or task.kernel.own_goals:
            raise InputError("task of the run", task.id, "line, with one goal")
        if self._training.entry.schedule == "joint":
            valid = "one whose agents move in turns"
            raise InputError("learner of the run", self._training.learner_id, valid)

    def start(self, world: World, monitor: Monitor, generator: np.random.Generator) -> None:
        """Begins with the tip's robot.

        Raises:
            InputError: a scene with another number of robots, hose or goal than the task's.
        """
        self._world = world
        self._check_fit(world)
        self._memory = make_probe(self._training.memory)
        self._memory.stream[:] = make_stream(generator)
        self._actions = Actions(Driver(world))
        self._moves = 0
        self._vetoed: tuple[str, ...] = ()

    def update(self) -> None:
        """Lets the next robot begin where the last has done, then drives all."""
        if self._actions.is_done():
            self._actions.begin(*self._choose())
        self._actions.update()

    def describe(self) -> Mapping[str, Any]:
        """The turn's owner, its move, and what was vetoed to it."""
        return {**self._actions.describe(), "vetoed": self._vetoed}

    def _check_fit(self, world: World) -> None:
        settings = self._training.task.settings
        length = world.scene.spec.length / world.scene.cell_size
        facts: dict[str, tuple[Any, Any]] = {
            "robots": (world.n_robots, settings.n_robots),
            "cells along the hose": (round(length, 6), settings.hose_length),
        }
        if isinstance(settings.goal, tuple):
            goal = compute_cells(world, world.goal_position())
            facts["goal's cell"] = ((int(goal[0]), int(goal[1])), settings.goal)
        for name, (found, learned) in facts.items():
            if found != learned:
                raise InputError(f"{name} of the scene", found, f"{learned}, as in {self._path}")

    def _choose(self) -> tuple[int, str]:
        """The robot whose turn it is, and its action."""
        task, learner, memory = self._training.task, self._training.learner, self._memory
        h = task.settings.half_width
        cells = compute_cells(self._world, self._world.site_positions()[:-1])[:, :2]
        goal = compute_cells(self._world, self._world.goal_position())[:2]
        memory.state[task.layout["robots"]] = np.clip(cells, -h, h).ravel()
        memory.state[task.layout["source"]] = 0
        memory.state[task.layout["goals"]] = np.clip(goal, -h, h)
        agent = self._moves % task.n_agents
        memory.state[TURN], memory.state[STEPS] = agent, self._moves
        self._moves += 1
        with np.errstate(over="ignore"):  # the stream's arithmetic is modulo 2^64
            allowed = loop.see(task.kernel, learner, memory, agent)
            action = loop.choose(task.kernel, learner, memory, agent, allowed, False)
        names = task.action_names
        self._vetoed = tuple(name for k, name in enumerate(names) if not int(allowed) >> k & 1)
        if task.schedule != "single":
            return agent, names[action]
        name, _, robot = names[action].rpartition("_")
        return int(robot), name
