"""The line-segment hose task (thesis B.2), compiled: its record and what can be asked of a state.

Points 0 .. N - 1 are the robots, tip first, and point N is the source; segment j joins the points
j and j + 1, so robot i ends the segments i - 1 and i.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.jit import jitable
from hose_mj.tasks.kernels import HEADER, Floats, Integers
from hose_mj.tasks.line.geometry import DOWN, LEFT, NONE, RIGHT, UP, Bytes, find_covered

OUT, STRETCH, COLLISION, GOAL, ALL_GOALS = 1, 2, 4, 8, 16
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
        cover_reach, cover_table: m and the table of `line_geometry.make_cover_table`.
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
    cover_reach: int
    cover_table: Bytes
    random_start: bool
    starts: Integers
    goal_mode: int
    goals: Integers
    goal_cells: Integers
    distance_table: Integers
    direction_table: Integers


@jitable
def look_up(table, i, j):  # type: ignore[no-untyped-def]
    """Returns table[i, j]; unsigned, the indices need no test for counting from the end."""
    return table[np.uint64(i), np.uint64(j)]


@jitable
def get_x(state, point):  # type: ignore[no-untyped-def]
    """Returns x of a robot or the source; for the unsigned index see `look_up`."""
    return state[np.uint64(HEADER + 2 * point)]


@jitable
def get_y(state, point):  # type: ignore[no-untyped-def]
    """Returns y of a robot or the source."""
    return state[np.uint64(HEADER + 2 * point + 1)]


@jitable
def put(state, point, x, y):  # type: ignore[no-untyped-def]
    """Puts a robot, or with point = N + 1 + k goal k, on a cell."""
    state[HEADER + 2 * point] = x
    state[HEADER + 2 * point + 1] = y


@jitable
def clip(value, bound):  # type: ignore[no-untyped-def]
    """Returns the nearest value in [-bound, bound]."""
    return min(max(value, -bound), bound)


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
    return max(abs(x), abs(y)) <= record.half_width


@jitable
def is_held(record, state, robot, x, y):  # type: ignore[no-untyped-def]
    """Whether another robot stands on the cell."""
    for other in range(record.n_robots):
        if other != robot and get_x(state, other) == x and get_y(state, other) == y:
            return True
    return False


@jitable
def find_covered_by(record, state, start, end, x, y):  # type: ignore[no-untyped-def]
    """Returns `line_geometry.find_covered` for the straight line from one point to another."""
    ax, ay, bx, by = get_x(state, start), get_y(state, start), get_x(state, end), get_y(state, end)
    dx, dy = bx - ax, by - ay
    m = record.cover_reach
    if max(abs(dx), abs(dy)) > m:
        return find_covered(ax, ay, bx, by, x, y)
    to_x, to_y = clip(x - ax, m + 2), clip(y - ay, m + 2)
    segment = (dx + m) * (2 * m + 1) + dy + m
    cell = (to_x + m + 2) * (2 * m + 5) + to_y + m + 2
    return np.int64(look_up(record.cover_table, segment, cell))


@jitable
def find_blocked(record, state, robot):  # type: ignore[no-untyped-def]
    """Returns which of the cells that the actions lead to are blocked for the robot.

    Bit a is the cell of action a. Another robot blocks its cell, and so does the segment behind it
    those it covers, unless the robot itself is at the segment's end or no segment ever blocks.
    """
    x, y = get_x(state, robot), get_y(state, robot)
    blocked = 0
    for k in range(record.n_robots - 1):
        other = k + (k >= robot)
        end = other + ((record.collision != ROBOTS) & (other + 1 != robot))
        blocked |= find_covered_by(record, state, other, end, x, y)
    return blocked


@jitable
def is_too_long(record, state, segment):  # type: ignore[no-untyped-def]
    """Whether a segment is longer than L_s."""
    dx = get_x(state, segment + 1) - get_x(state, segment)
    dy = get_y(state, segment + 1) - get_y(state, segment)
    return dx * dx + dy * dy > record.largest_square


@jitable
def is_stretched(record, state, robot):  # type: ignore[no-untyped-def]
    """Whether a segment that the robot ends is longer than L_s."""
    return is_too_long(record, state, robot) | is_too_long(record, state, max(robot - 1, 0))


@jitable
def is_in_the_way(record, state, robot):  # type: ignore[no-untyped-def]
    """Whether the robot stands where it should not: with another one, or on the hose."""
    return (find_blocked(record, state, robot) >> NONE & 1) == 1


@jitable
def is_at_goal(record, state, robot, goal):  # type: ignore[no-untyped-def]
    """Whether the robot stands on the goal of that number."""
    at = record.n_robots + 1 + goal
    return get_x(state, robot) == get_x(state, at) and get_y(state, robot) == get_y(state, at)
