"""The line task's state variables (thesis B.2.2)."""

from __future__ import annotations

from hose_mj.compiled import inlined, jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.line_kernels import (
    NONE,
    Line,
    get_x,
    get_y,
    is_blocked,
    is_inside,
    step_x,
    step_y,
)


@jitable
def clip(value, bound):  # type: ignore[no-untyped-def]
    """Returns the nearest value in [-bound, bound]."""
    return min(max(value, -bound), bound)


@jitable
def number_offset(record, state, segment):  # type: ignore[no-untyped-def]
    """Returns the number of P_j - P_(j+1) among the offsets that the hose allows."""
    m = record.offset_table.shape[0] // 2
    dx = clip(get_x(state, segment) - get_x(state, segment + 1), m)
    dy = clip(get_y(state, segment) - get_y(state, segment + 1), m)
    return record.offset_table[dx + m, dy + m]


@jitable
def number_cell(record, x, y):  # type: ignore[no-untyped-def]
    """Returns the number of a cell of the grid."""
    return (x + record.half_width) * (2 * record.half_width + 1) + y + record.half_width


@jitable
def observe_robot(record, state, robot, values, at):  # type: ignore[no-untyped-def]
    """Writes p, r_g, d_g, theta_g, r_n, r_p and the four flags of a robot, from place `at` on."""
    h = record.half_width
    x, y = get_x(state, robot), get_y(state, robot)
    px, py = clip(x, h), clip(y, h)
    goal = record.n_robots + 1 + (robot if record.own_goals else 0)
    gx, gy = get_x(state, goal) - px + 2 * h, get_y(state, goal) - py + 2 * h
    values[at] = number_cell(record, px, py)
    values[at + 1] = gx * (4 * h + 1) + gy
    values[at + 2] = record.distance_table[gx, gy]
    values[at + 3] = record.direction_table[gx, gy]
    zero = record.offset_table.shape[0] // 2
    values[at + 4] = record.offset_table[zero, zero]
    if robot > 0:
        values[at + 4] = number_offset(record, state, robot - 1)
    values[at + 5] = number_offset(record, state, robot)
    for action in range(NONE):
        to_x, to_y = x + step_x(action), y + step_y(action)
        values[at + 6 + action] = is_inside(record, to_x, to_y) and is_blocked(
            record, state, robot, to_x, to_y
        )


@kernels.observe.register(Line)
@inlined
def observe_line(record, state, agent, values):  # type: ignore[no-untyped-def]
    """Writes the goal, what concerns the agent's robot (or each), and the formation r_n_1 .. N."""
    goal = record.n_robots + 1 + (agent if record.own_goals else 0)
    values[0] = number_cell(record, get_x(state, goal), get_y(state, goal))
    at = 1
    if record.single_agent:
        for robot in range(record.n_robots):
            observe_robot(record, state, robot, values, at)
            at += 10
        values[at] = number_offset(record, state, record.n_robots - 1)
    else:
        observe_robot(record, state, agent, values, at)
        for segment in range(record.n_robots):
            values[at + 10 + segment] = number_offset(record, state, segment)
