"""The line task's moves, alone and jointly, and the events they cause (thesis B.2.1, B.2.3)."""

from __future__ import annotations

from hose_mj.jit import inlined, jitable
from hose_mj.tasks import joint, kernels
from hose_mj.tasks.kernels import end_joint, end_turn
from hose_mj.tasks.line.geometry import NONE
from hose_mj.tasks.line.kernels import (
    ABSENT,
    ALL_GOALS,
    COLLISION,
    GOAL,
    OUT,
    STRETCH,
    SWEEPING,
    Line,
    get_x,
    get_y,
    is_at_goal,
    is_held,
    is_in_the_way,
    is_inside,
    is_stretched,
    put,
    step_x,
    step_y,
)


@jitable
def find_breaks(record, state, robot, moved):  # type: ignore[no-untyped-def]
    """Returns the constraints that the robot breaks, having moved to another cell or not."""
    inside = is_inside(record, get_x(state, robot), get_y(state, robot))
    looks = moved | (record.collision == SWEEPING)
    return (
        OUT * (not inside)
        | STRETCH * is_stretched(record, state, robot)
        | COLLISION * (looks & is_in_the_way(record, state, robot))
    )


@jitable
def find_goals(record, state, robot):  # type: ignore[no-untyped-def]
    """Returns the goal events of a move of the robot that broke nothing."""
    if record.goal_mode == ABSENT:
        return 0
    if not record.own_goals:
        return GOAL if is_at_goal(record, state, 0, 0) else 0
    if not is_at_goal(record, state, robot, robot):
        return 0
    for other in range(record.n_robots):
        if not is_at_goal(record, state, other, other):
            return GOAL
    return GOAL | ALL_GOALS


@jitable
def move(record, state, robot, direction):  # type: ignore[no-untyped-def]
    """Moves one robot and returns the events, all of them checked on the state after it."""
    x = get_x(state, robot) + step_x(direction)
    y = get_y(state, robot) + step_y(direction)
    moved = direction < NONE
    events = 0
    if record.cancelling and moved:
        if not is_inside(record, x, y):
            events = OUT
        elif is_held(record, state, robot, x, y):
            events = COLLISION
    moved = moved and events == 0
    if moved:
        put(state, robot, x, y)
    events |= find_breaks(record, state, robot, moved)
    if record.collision == SWEEPING:
        for other in range(record.n_robots):
            if is_in_the_way(record, state, other):
                events |= COLLISION
    return events if events else find_goals(record, state, robot)


@kernels.apply.register(Line)
@inlined
def apply_line(record, state, agent, action):  # type: ignore[no-untyped-def]
    """Moves the agent's robot, or the one that a single agent names."""
    end_turn(record, state, agent)
    if record.single_agent:
        return move(record, state, action >> 2, action & 3)
    return move(record, state, agent, action)


@joint.find_target.register(Line)
@jitable
def find_line_target(record, state, robot, action):  # type: ignore[no-untyped-def]
    """Returns the number of the cell an action leads to, of a grid with a rim of one cell."""
    x = get_x(state, robot) + step_x(action) + record.half_width + 1
    y = get_y(state, robot) + step_y(action) + record.half_width + 1
    return x * (2 * record.half_width + 3) + y


@jitable
def cancel_moves(record, state, packed):  # type: ignore[no-untyped-def]
    """Cancels the moves that leave the grid, then those that robots cannot make together."""
    for robot in range(record.n_robots):
        action = joint.unpack(packed, robot)
        x = get_x(state, robot) + step_x(action)
        if not is_inside(record, x, get_y(state, robot) + step_y(action)):
            packed = joint.cancel(packed, robot)
    return joint.settle(record, state, record.n_robots, packed, joint.FIRST)


@jitable
def find_swaps(record, state, packed):  # type: ignore[no-untyped-def]
    """Returns, as bits, the robots that change places with another one."""
    swaps = 0
    for one in range(record.n_robots):
        for other in range(one + 1, record.n_robots):
            here = find_line_target(record, state, one, NONE)
            there = find_line_target(record, state, other, NONE)
            if (
                here != there
                and find_line_target(record, state, one, joint.unpack(packed, one)) == there
                and find_line_target(record, state, other, joint.unpack(packed, other)) == here
            ):
                swaps |= 1 << one | 1 << other
    return swaps


@jitable
def charge_cancelled(record, state, robot, action):  # type: ignore[no-untyped-def]
    """Returns the event for which a robot's move was cancelled, or would be."""
    x = get_x(state, robot) + step_x(action)
    inside = is_inside(record, x, get_y(state, robot) + step_y(action))
    return COLLISION if inside else OUT


@kernels.apply_joint.register(Line)
@inlined
def apply_joint_line(record, state, actions, charged):  # type: ignore[no-untyped-def]
    """Moves all robots at once; each one is charged with what it breaks itself."""
    if record.single_agent:
        charged[0] = apply_line(record, state, 0, actions[0])
        return charged[0]
    packed = joint.pack(actions)
    charged[:] = 0
    if record.cancelling:
        packed = cancel_moves(record, state, packed)
    swaps = find_swaps(record, state, packed)
    for robot in range(record.n_robots):
        if joint.unpack(packed, robot) == joint.CANCELLED:
            charged[robot] = charge_cancelled(record, state, robot, actions[robot])
        elif swaps >> robot & 1:
            charged[robot] = COLLISION
    for robot in range(record.n_robots):
        action = joint.unpack(packed, robot)
        put(
            state, robot, get_x(state, robot) + step_x(action), get_y(state, robot) + step_y(action)
        )
    events = 0
    for robot in range(record.n_robots):
        charged[robot] |= find_breaks(record, state, robot, joint.unpack(packed, robot) < NONE)
        events |= charged[robot]
    if not events:
        for robot in range(record.n_robots if record.own_goals else 1):
            charged[robot] = find_goals(record, state, robot)
            events |= charged[robot]
    end_joint(record, state)
    return events
