"""The line task's state variables (thesis B.2.2)."""

from __future__ import annotations

from hose_mj.jit import inlined, jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.line.geometry import NONE
from hose_mj.tasks.line.kernels import (
    Line,
    clip,
    find_blocked,
    get_x,
    get_y,
    is_inside,
    look_up,
    step_x,
    step_y,
)


@jitable
def number_offset(record, state, point, behind):  # type: ignore[no-untyped-def]
    """Returns the number of the point's place relative to the one behind it, or to itself."""
    m = record.offset_table.shape[0] // 2
    dx = clip(get_x(state, point) - get_x(state, behind), m)
    dy = clip(get_y(state, point) - get_y(state, behind), m)
    return look_up(record.offset_table, dx + m, dy + m)


@jitable
def number_cell(record, x, y):  # type: ignore[no-untyped-def]
    """Returns the number of a cell of the grid."""
    return (x + record.half_width) * (2 * record.half_width + 1) + y + record.half_width


@jitable
def observe_robot(record, state, robot, ahead, behind, values, at):  # type: ignore[no-untyped-def]
    """Writes p, r_g, d_g, theta_g, r_n, r_p and the four flags of a robot, from place `at` on.

    Of these r_n and r_p, `ahead` and `behind`, are known already.
    """
    h = record.half_width
    px, py = clip(get_x(state, robot), h), clip(get_y(state, robot), h)
    goal = record.n_robots + 1 + (robot if record.own_goals else 0)
    gx, gy = get_x(state, goal) - px + 2 * h, get_y(state, goal) - py + 2 * h
    values[at] = number_cell(record, px, py)
    values[at + 1] = gx * (4 * h + 1) + gy
    values[at + 2] = look_up(record.distance_table, gx, gy)
    values[at + 3] = look_up(record.direction_table, gx, gy)
    values[at + 4] = ahead
    values[at + 5] = behind
    blocked = find_blocked(record, state, robot)
    x, y = get_x(state, robot), get_y(state, robot)
    for action in range(NONE):
        inside = is_inside(record, x + step_x(action), y + step_y(action))
        values[at + 6 + action] = inside & (blocked >> action & 1)


@kernels.observe.register(Line)
@inlined
def observe_line(record, state, agent, values):  # type: ignore[no-untyped-def]
    """Writes the goal, what concerns the agent's robot (or each), and the formation r_n_1 .. N."""
    goal = record.n_robots + 1 + (agent if record.own_goals else 0)
    values[0] = number_cell(record, get_x(state, goal), get_y(state, goal))
    at = 1
    ahead = number_offset(record, state, 0, 0)
    if record.single_agent:
        for robot in range(record.n_robots):
            behind = number_offset(record, state, robot, robot + 1)
            observe_robot(record, state, robot, ahead, behind, values, at)
            ahead = behind
            at += 10
        values[at] = ahead
    else:
        formation = at + 10
        for segment in range(record.n_robots):
            values[formation + segment] = number_offset(record, state, segment, segment + 1)
        if agent > 0:
            ahead = values[formation + agent - 1]
        observe_robot(record, state, agent, ahead, values[formation + agent], values, at)
