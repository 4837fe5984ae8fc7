"""The line task's initial states: uniform over the feasible ones."""

from __future__ import annotations

from hose_mj.jit import inlined, jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import begin
from hose_mj.tasks.line.geometry import NONE
from hose_mj.tasks.line.kernels import (
    ABSENT,
    RANDOM,
    ROBOTS,
    Line,
    find_covered_by,
    get_x,
    get_y,
    is_at_goal,
    is_inside,
    put,
)
from hose_mj.tasks.stream import draw_below


@jitable
def fits(record, state, robot):  # type: ignore[no-untyped-def]
    """Whether the robot and its segment agree with the robots nearer to the source."""
    x, y = get_x(state, robot), get_y(state, robot)
    if not is_inside(record, x, y):
        return False
    hose_blocks = record.collision != ROBOTS
    covered = 0
    for other in range(robot + 1, record.n_robots):
        covered |= find_covered_by(record, state, other, other + hose_blocks, x, y)
    for other in range(robot + 2, record.n_robots if hose_blocks else 0):
        ox, oy = get_x(state, other), get_y(state, other)
        covered |= find_covered_by(record, state, robot, robot + 1, ox, oy)
    return (covered >> NONE & 1) == 0


@jitable
def draw_chain(record, state, stream):  # type: ignore[no-untyped-def]
    """Draws the robots' cells uniformly from the feasible set.

    Every chain of allowed offsets is equally likely to be tried, and one that breaks a constraint
    is given up as a whole, so those that are left remain equally likely.
    """
    robot = record.n_robots - 1
    while robot >= 0:
        offset = draw_below(stream, record.offsets.shape[0])
        x = get_x(state, robot + 1) + record.offsets[offset, 0]
        put(state, robot, x, get_y(state, robot + 1) + record.offsets[offset, 1])
        robot = robot - 1 if fits(record, state, robot) else record.n_robots - 1


@jitable
def place_goals(record, state, stream):  # type: ignore[no-untyped-def]
    """Places the goals: own ones on a feasible chain, a common one where the tip can get."""
    first = record.n_robots + 1
    if record.goal_mode == RANDOM and record.own_goals:
        draw_chain(record, state, stream)
        for robot in range(record.n_robots):
            put(state, first + robot, get_x(state, robot), get_y(state, robot))
    elif record.goal_mode == RANDOM:
        cell = draw_below(stream, record.goal_cells.shape[0])
        put(state, first, record.goal_cells[cell, 0], record.goal_cells[cell, 1])
    else:
        for goal in range(record.goals.shape[0]):
            put(state, first + goal, record.goals[goal, 0], record.goals[goal, 1])


@jitable
def place_robots(record, state, stream):  # type: ignore[no-untyped-def]
    """Puts the robots on their first cells, fixed or drawn."""
    if record.random_start:
        draw_chain(record, state, stream)
    else:
        for robot in range(record.n_robots):
            put(state, robot, record.starts[robot, 0], record.starts[robot, 1])


@jitable
def is_solved(record, state):  # type: ignore[no-untyped-def]
    """Whether the tip, or with own goals every robot, stands on its goal."""
    for robot in range(record.n_robots if record.own_goals else 1):
        if not is_at_goal(record, state, robot, robot):
            return False
    return record.goal_mode != ABSENT


@kernels.reset.register(Line)
@inlined
def reset_line(record, state, stream):  # type: ignore[no-untyped-def]
    """Places goals and robots, again and again until the task is not solved at the start."""
    begin(state)
    put(state, record.n_robots, 0, 0)
    solved = True
    while solved:
        place_goals(record, state, stream)
        place_robots(record, state, stream)
        solved = is_solved(record, state)
