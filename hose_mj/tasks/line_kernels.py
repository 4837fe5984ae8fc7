"""The line-segment hose task (thesis B.2), compiled: its record and what can be asked of a state.

Points 0 .. N - 1 are the robots, tip first, and point N is the source; segment j joins the points
j and j + 1, so robot i ends the segments i - 1 and i.
"""

from __future__ import annotations

from typing import NamedTuple

from hose_mj.compiled import jitable
from hose_mj.tasks.kernels import HEADER, Floats, Integers
from hose_mj.tasks.line_geometry import covers

OUT, STRETCH, COLLISION, GOAL, ALL_GOALS = 1, 2, 4, 8, 16
UP, DOWN, LEFT, RIGHT, NONE = range(5)
ENTERING, SWEEPING, ROBOTS = 0, 1, 2
"""Collision rules: entering a held or covered cell, any robot being on one, robots alone."""
FIXED, RANDOM, ABSENT = 0, 1, 2
"""Where the goal comes from."""


class Line(NamedTuple):
    """The rules; state: header, x and y of robots 0 .. N - 1, of the source, of the goals.

    Attributes:
        n_robots: N.
        single_agent: whether one agent moves all robots with actions 4 robot + direction.
        own_goals: whether each robot has a goal of its own (non-cooperative task).
        cancelling: whether impossible moves are cancelled (the author's rule) before the events.
        collision: ENTERING, SWEEPING or ROBOTS.
        half_width: h; the grid is [-h, h]^2.
        largest_square: square of the longest segment, L_s^2 rounded down.
        offsets: offsets allowed between neighbours (k, 2).
        offset_table: their numbers, see `line_geometry.make_offset_table`.
        random_start: whether the robots' first cells are drawn from the feasible set.
        starts: their first cells otherwise (N, 2).
        goal_mode: FIXED, RANDOM or ABSENT.
        goals: the goals where they are fixed (n_goals, 2).
        goal_cells: cells that the tip can reach (m, 2).
        distance_table, direction_table: d_g and theta_g by G - P, (0, 0) in the middle.
    """

    n_agents: int
    n_actions: int
    step_limit: int
    terminal: int
    violations: int
    success: int
    shared: int
    reward_table: Floats
    n_robots: int
    single_agent: bool
    own_goals: bool
    cancelling: bool
    collision: int
    half_width: int
    largest_square: int
    offsets: Integers
    offset_table: Integers
    random_start: bool
    starts: Integers
    goal_mode: int
    goals: Integers
    goal_cells: Integers
    distance_table: Integers
    direction_table: Integers


@jitable
def get_x(state, point):  # type: ignore[no-untyped-def]
    """Returns x of a robot or the source."""
    return state[HEADER + 2 * point]


@jitable
def get_y(state, point):  # type: ignore[no-untyped-def]
    """Returns y of a robot or the source."""
    return state[HEADER + 2 * point + 1]


@jitable
def put(state, point, x, y):  # type: ignore[no-untyped-def]
    """Puts a robot, or with point = N + 1 + k goal k, on a cell."""
    state[HEADER + 2 * point] = x
    state[HEADER + 2 * point + 1] = y


@jitable
def step_x(action):  # type: ignore[no-untyped-def]
    """Returns by how much an action raises x."""
    return (action == RIGHT) - (action == LEFT)


@jitable
def step_y(action):  # type: ignore[no-untyped-def]
    """Returns by how much an action raises y."""
    return (action == UP) - (action == DOWN)


@jitable
def is_inside(record, x, y):  # type: ignore[no-untyped-def]
    """Whether a cell is on the grid."""
    return abs(x) <= record.half_width and abs(y) <= record.half_width


@jitable
def is_held(record, state, robot, x, y):  # type: ignore[no-untyped-def]
    """Whether another robot stands on the cell."""
    for other in range(record.n_robots):
        if other != robot and get_x(state, other) == x and get_y(state, other) == y:
            return True
    return False


@jitable
def is_covered(state, segment, x, y):  # type: ignore[no-untyped-def]
    """Whether the segment covers the cell."""
    ax, ay = get_x(state, segment), get_y(state, segment)
    return covers(ax, ay, get_x(state, segment + 1), get_y(state, segment + 1), x, y)


@jitable
def is_blocked(record, state, robot, x, y):  # type: ignore[no-untyped-def]
    """Whether another robot holds the cell or a segment that the robot does not end covers it."""
    if is_held(record, state, robot, x, y):
        return True
    if record.collision != ROBOTS:
        for segment in range(record.n_robots):
            if segment != robot and segment + 1 != robot and is_covered(state, segment, x, y):
                return True
    return False


@jitable
def is_too_long(record, state, segment):  # type: ignore[no-untyped-def]
    """Whether a segment is longer than L_s."""
    dx = get_x(state, segment + 1) - get_x(state, segment)
    dy = get_y(state, segment + 1) - get_y(state, segment)
    return dx * dx + dy * dy > record.largest_square


@jitable
def is_stretched(record, state, robot):  # type: ignore[no-untyped-def]
    """Whether a segment that the robot ends is longer than L_s."""
    return is_too_long(record, state, robot) or (
        robot > 0 and is_too_long(record, state, robot - 1)
    )


@jitable
def is_in_the_way(record, state, robot):  # type: ignore[no-untyped-def]
    """Whether the robot stands where it should not: with another one, or on the hose."""
    return is_blocked(record, state, robot, get_x(state, robot), get_y(state, robot))


@jitable
def is_at_goal(record, state, robot, goal):  # type: ignore[no-untyped-def]
    """Whether the robot stands on the goal of that number."""
    at = record.n_robots + 1 + goal
    return get_x(state, robot) == get_x(state, at) and get_y(state, robot) == get_y(state, at)
