"""The line-segment hose task (thesis B.2): settings, and the task made from them."""

import math
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any, Literal, cast

import numpy as np

from hose_mj.errors import InputError
from hose_mj.tasks.checks import check_cell, check_cells, check_choice, check_finite, check_integer
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.line import geometry
from hose_mj.tasks.line import kernels as rules
from hose_mj.tasks.task import Task, compose_task
from hose_mj.tasks.variables import Variable

Cell = tuple[int, int]

COLLISIONS = {"entering": rules.ENTERING, "sweeping": rules.SWEEPING, "robots": rules.ROBOTS}
GOAL_MODES = {"random": rules.RANDOM, "none": rules.ABSENT}
VIOLATIONS = ("out", "stretch", "collision")
N_DISTANCES, N_SQUARES = 24, 256
"""Values of d_g (Table 4.1: distances; with own goals their squares)."""
DIRECTIONS = ("up", "down", "left", "right")


@dataclass(frozen=True, kw_only=True)
class LineSettings:
    """N robots that pull a hose of straight segments over a grid (thesis B.2).

    Raises:
        InputError: a value outside its valid set; the robots' cells are checked by `make_line`.
    """

    n_robots: int = 4  # N, robot 0 at the tip
    hose_length: int = 16  # L_hose in cells; a segment is at most L_s = L_hose / N long
    half_width: int = 10  # h; the cells are [-h, h]^2 around the source
    own_goals: bool = False  # each robot has a goal of its own (the non-cooperative task)
    # One agent moves all robots, one at a time, with 4 N actions (chapter 5).
    single_agent: bool = False
    # The robots' first cells, tip first, or "random" for the uniform feasible ones.
    start: tuple[Cell, ...] | Literal["random"] = "random"
    # The tip's goal or with `own_goals` each robot's, "random", or "none".
    goal: Cell | tuple[Cell, ...] | Literal["random", "none"] = "random"
    # What a robot collides with: by "entering" a cell that another robot holds or the hose covers;
    # also when the hose is "sweeping" over any robot; or "robots" alone.
    collision: Literal["entering", "sweeping", "robots"] = "entering"
    # Whether an impossible move is an event in the state after it ("simultaneous", for joint moves)
    # or is left out ("cancelling", the author's later rule).
    move_rule: Literal["simultaneous", "cancelling"] = "simultaneous"
    violations_end: bool = True  # whether an event that breaks a constraint ends the episode
    goal_reward: float = 100.0  # for the goal
    violation_reward: float = -50.0  # for each broken constraint
    step_limit: int = 400  # moves of single robots after which an episode is cut off

    def __post_init__(self) -> None:
        check_integer("n_robots", self.n_robots, 1, 8)
        check_integer("hose_length", self.hose_length, 1, 1000)
        if self.hose_length < self.n_robots:
            valid = f"at least {self.n_robots}, a cell for each segment"
            raise InputError("hose_length", self.hose_length, valid)
        check_integer("half_width", self.half_width, 1, 100)
        for name in ("own_goals", "single_agent", "violations_end"):
            check_choice(name, getattr(self, name), (True, False))
        if self.own_goals and self.single_agent:
            raise InputError("own_goals", True, "False where a single agent moves all robots")
        check_choice("collision", self.collision, COLLISIONS)
        check_choice("move_rule", self.move_rule, ("simultaneous", "cancelling"))
        check_finite("goal_reward", self.goal_reward)
        check_finite("violation_reward", self.violation_reward)
        check_integer("step_limit", self.step_limit, 1, 10**9)
        h = self.half_width
        if self.start != "random":
            check_cells("start", self.start, self.n_robots, -h, h)
        if self.goal in ("random", "none"):
            return
        if self.own_goals:
            check_cells("goal", self.goal, self.n_robots, -h, h)
        else:
            check_cell("goal", self.goal, (-h, h), (-h, h))
            x, y = cast(Cell, self.goal)
            if x * x + y * y > self.hose_length**2:
                valid = f"a cell within the hose's length {self.hose_length} of the source"
                raise InputError("goal", self.goal, valid)
            if self.goal == (0, 0) and self.n_robots > 1 and self.collision != "robots":
                raise InputError("goal", self.goal, "a cell other than the source's, which is held")


def make_line(settings: LineSettings) -> Task:
    """Makes the line task.

    Raises:
        InputError: first cells or own goals that the hose does not allow, or a solved start.
    """
    n = settings.n_robots
    n_goals = n if settings.own_goals else 1
    agents = ("robots",) if settings.single_agent else tuple(f"robot_{i}" for i in range(n))
    actions: tuple[str, ...] = (*DIRECTIONS, "none")
    if settings.single_agent:
        actions = tuple(f"{name}_{robot}" for robot in range(n) for name in DIRECTIONS)
    success = ("all_goals",) if settings.own_goals else ("goal",)
    tables = _make_tables(settings)
    task = compose_task(
        partial(
            rules.Line,
            n_robots=n,
            single_agent=settings.single_agent,
            own_goals=settings.own_goals,
            cancelling=settings.move_rule == "cancelling",
            collision=COLLISIONS[settings.collision],
            half_width=settings.half_width,
            random_start=settings.start == "random",
            starts=_read_cells(settings.start, n),
            goal_mode=GOAL_MODES.get(str(settings.goal), rules.FIXED),
            goals=_read_cells(settings.goal, n_goals),
            goal_cells=_list_goal_cells(settings),
            **tables,
        ),
        id="line",
        agents=agents,
        action_names=actions,
        variables=_list_variables(settings, len(tables["offsets"])),
        events=(*VIOLATIONS, "goal", "all_goals")[: 5 if settings.own_goals else 4],
        rewards={
            "goal": {"goal": settings.goal_reward},
            **{name: {name: settings.violation_reward} for name in ("stretch", "out", "collision")},
        },
        schedule="single" if settings.single_agent else "turns",
        settings=settings,
        sizes={"robots": 2 * n, "source": 2, "goals": 2 * n_goals},
        terminal=(*success, *VIOLATIONS) if settings.violations_end else success,
        violations=VIOLATIONS,
        success=success,
        shared=success,
    )
    _check_cells_fit(task)
    return task


def _make_tables(settings: LineSettings) -> dict[str, Any]:
    """Makes the fields of the record that its geometry is looked up in."""
    largest_square = settings.hose_length**2 // settings.n_robots**2
    offsets = geometry.list_offsets(largest_square)
    cover_reach = min(math.isqrt(largest_square), geometry.LARGEST_REACH)
    reach = 2 * settings.half_width
    levels = N_SQUARES if settings.own_goals else N_DISTANCES
    return {
        "largest_square": largest_square,
        "offsets": offsets,
        "offset_table": geometry.make_offset_table(offsets),
        "cover_reach": cover_reach,
        "cover_table": geometry.make_cover_table(cover_reach),
        "distance_table": geometry.make_distance_table(reach, levels, squared=settings.own_goals),
        "direction_table": geometry.make_direction_table(reach),
    }


def _read_cells(cells: object, number: int) -> Integers:
    """Returns fixed cells as an array (number, 2), and zeros for a word in their place."""
    if isinstance(cells, str):
        return np.zeros((number, 2), np.int64)
    return np.array(cells, np.int64).reshape(number, 2)


def _list_goal_cells(settings: LineSettings) -> Integers:
    """Lists the cells of the grid within the hose's length of the source."""
    span = range(-settings.half_width, settings.half_width + 1)
    limit = settings.hose_length**2
    return np.array([c for c in product(span, span) if c[0] ** 2 + c[1] ** 2 <= limit], np.int64)


def _list_variables(settings: LineSettings, n_offsets: int) -> tuple[Variable, ...]:
    """Lists the variables in the order in which `kernels.observe_line` writes them."""
    cells = (2 * settings.half_width + 1) ** 2
    own = settings.own_goals
    goal = Variable("goal", cells, "goal's cell, (x + h)(2 h + 1) + y + h", own)
    levels, distance = (N_SQUARES, "squared distance") if own else (N_DISTANCES, "distance")
    robot = (
        ("p", cells, "robot's cell, numbered as the goal's"),
        ("r_g", (4 * settings.half_width + 1) ** 2, "G - P, numbered alike"),
        ("d_g", levels, f"{distance} to the goal, rounded down, at most {levels - 1}"),
        ("theta_g", geometry.N_DIRECTIONS, "direction of the goal in eighths: 0 right, 2 up"),
        ("r_n", n_offsets, "next robot's place relative to it, P_(i-1) - P_i; (0, 0) at the tip"),
        ("r_p", n_offsets, "its place relative to the previous robot, P_i - P_(i+1)"),
        *((f"o_{name}", 2, f"1 when stepping {name} would collide") for name in DIRECTIONS),
    )
    n = settings.n_robots
    formation = [
        Variable(f"r_n_{i}", n_offsets, f"P_{i - 1} - P_{i}" + (", the source" if i == n else ""))
        for i in range(1, n + 1)
    ]
    if not settings.single_agent:
        own_ones = (Variable(name, size, says, True) for name, size, says in robot)
        return (goal, *own_ones, *formation)
    each = (
        Variable(f"{name}_{i}", size, f"robot {i}: {says}")
        for i in range(n)
        for name, size, says in robot
    )
    return (goal, *each, formation[-1])


def _check_cells_fit(task: Task) -> None:
    """Raises if the hose does not allow the fixed first cells or own goals, or solves the task."""
    record, settings = task.kernel, task.settings
    fixed_goal = record.goal_mode == rules.FIXED
    chains = {} if record.random_start else {"start": record.starts}
    if fixed_goal and record.own_goals:
        chains["goal"] = record.goals
    for name, cells in chains.items():
        state = task.make_state()
        state[task.layout["robots"]] = cells.ravel()
        for robot in range(record.n_robots):
            if rules.is_too_long(record, state, robot):
                longest = f"segments of at most {settings.hose_length} / {record.n_robots} cells"
                raise InputError(name, getattr(settings, name), longest)
            if not rules.fits(record, state, robot):
                free = "cells that no other robot holds and the hose does not cover"
                raise InputError(name, getattr(settings, name), free)
    if fixed_goal and not record.random_start:
        n_goals = len(record.goals)
        if (record.goals == record.starts[:n_goals]).all():
            raise InputError("goal", settings.goal, "a goal that is not reached at the start")
