"""Two tiny tasks of the thesis: the corridor of Example 1 and the maze of Table 5.1."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from hose_mj.errors import InputError
from hose_mj.tasks import joint
from hose_mj.tasks.checks import check_cell, check_choice, check_finite, check_integer
from hose_mj.tasks.task import Task, compose_task
from hose_mj.tasks.tiny.kernels import Corridor, Maze
from hose_mj.tasks.variables import Variable

DIRECTIONS = ("up", "down", "left", "right")
WINNERS = {"first": joint.FIRST, "second": joint.SECOND, "neither": joint.NEITHER}


@dataclass(frozen=True, kw_only=True)
class CorridorSettings:
    """Two robots in a corridor of cells 0 .. n_cells - 1 (Example 1, section 6.4).

    Raises:
        InputError: a value outside its range, or robots that start together or on the goal.
    """

    n_cells: int = 3  # length of the corridor
    goal: int = 1  # the goal's cell
    starts: tuple[int, int] = (0, 2)  # first cells of the two robots
    # What reaching the goal ends: the "cycle" of turns (Table 6.2) or the "move".
    goal_ends: Literal["cycle", "move"] = "cycle"
    # Who gets a cell that both enter at once (Table 6.1 allows "first" and "second").
    winner: Literal["first", "second", "neither"] = "first"
    goal_reward: float = 100.0  # for both, when a robot reaches the goal
    collision_reward: float = -10.0  # for both, when a robot hits a wall or the other robot
    step_limit: int = 100  # moves of single robots after which an episode is cut off

    def __post_init__(self) -> None:
        check_integer("n_cells", self.n_cells, 3, 1000)
        last = self.n_cells - 1
        check_integer("goal", self.goal, 0, last)
        check_cell("starts", self.starts, (0, last), (0, last))
        if len({self.goal, *self.starts}) < 3:
            raise InputError("starts", self.starts, "two cells, neither of them the goal's")
        check_choice("goal_ends", self.goal_ends, ("cycle", "move"))
        check_choice("winner", self.winner, WINNERS)
        check_finite("goal_reward", self.goal_reward)
        check_finite("collision_reward", self.collision_reward)
        check_integer("step_limit", self.step_limit, 1, 10**9)


def make_corridor(settings: CorridorSettings) -> Task:
    """Makes the corridor."""
    return compose_task(
        partial(
            Corridor,
            n_cells=settings.n_cells,
            goal=settings.goal,
            starts=np.array(settings.starts, np.int64),
            goal_ends_move=settings.goal_ends == "move",
            winner=WINNERS[settings.winner],
        ),
        id="corridor",
        agents=("robot_0", "robot_1"),
        action_names=("left", "right", "none"),
        variables=tuple(
            Variable(f"p_{robot}", settings.n_cells, f"cell of robot {robot}") for robot in (0, 1)
        ),
        events=("collision", "goal", "done"),
        rewards=_make_rewards(settings),
        settings=settings,
        sizes={"robots": 2},
        terminal=("done",),
        violations=("collision",),
        success=("done",),
        shared=("collision", "goal", "done"),
    )


def _make_rewards(settings: CorridorSettings | MazeSettings) -> dict[str, dict[str, float]]:
    return {
        "goal": {"goal": settings.goal_reward},
        "collision": {"collision": settings.collision_reward},
    }


@dataclass(frozen=True, kw_only=True)
class MazeSettings:
    """One robot in the rooms of Table 5.1: 4 x 2 cells, walls above (0, 0) and (2, 0).

    Raises:
        InputError: a value outside its range, or a robot that starts on the goal.
    """

    actions: Literal["all", "up"] = "all"  # "all" four directions, or "up" alone as in the table
    goal: tuple[int, int] = (0, 1)  # cell (x, y) whose entry ends the episode; y counts upwards
    # First cell (x, y), or "random" for any but the goal's.
    start: tuple[int, int] | Literal["random"] = "random"
    goal_reward: float = 100.0  # for entering the goal's cell
    collision_reward: float = -10.0  # -k of the table
    step_limit: int = 100  # moves after which an episode is cut off

    def __post_init__(self) -> None:
        check_choice("actions", self.actions, ("all", "up"))
        check_cell("goal", self.goal, (0, MAZE_SHAPE[0] - 1), (0, MAZE_SHAPE[1] - 1))
        if self.start != "random":
            check_cell("start", self.start, (0, MAZE_SHAPE[0] - 1), (0, MAZE_SHAPE[1] - 1))
            if self.start == self.goal:
                raise InputError("start", self.start, "a cell other than the goal's")
        check_finite("goal_reward", self.goal_reward)
        check_finite("collision_reward", self.collision_reward)
        check_integer("step_limit", self.step_limit, 1, 10**9)


MAZE_SHAPE = (4, 2)
MAZE_WALLS_ABOVE = ((0, 0), (2, 0))


def make_maze(settings: MazeSettings) -> Task:
    """Makes the maze."""
    actions = DIRECTIONS if settings.actions == "all" else ("up",)
    width, height = MAZE_SHAPE
    start = (-1, -1) if settings.start == "random" else settings.start
    return compose_task(
        partial(
            Maze,
            width=width,
            height=height,
            goal_x=settings.goal[0],
            goal_y=settings.goal[1],
            start_x=start[0],
            start_y=start[1],
            walls=_make_walls(),
        ),
        id="maze",
        agents=("robot_0",),
        action_names=actions,
        variables=(
            Variable("x", width, "column"),
            Variable("y", height, "row, counted upwards"),
            *(Variable(f"o_{name}", 2, f"1 when a wall is {name}", True) for name in actions),
        ),
        events=("collision", "goal"),
        rewards=_make_rewards(settings),
        schedule="single",
        settings=settings,
        sizes={"robots": 2},
        terminal=("goal",),
        violations=("collision",),
        success=("goal",),
        shared=(),
    )


def _make_walls() -> np.ndarray[tuple[int, int, int], np.dtype[np.int64]]:
    """Makes the walls (width, height, direction), the outer ones too."""
    walls = np.zeros((*MAZE_SHAPE, 4), np.int64)
    walls[:, -1, 0] = walls[:, 0, 1] = walls[0, :, 2] = walls[-1, :, 3] = 1
    for x, y in MAZE_WALLS_ABOVE:
        walls[x, y, 0] = walls[x, y + 1, 1] = 1
    return walls
