"""The line-segment hose task (thesis B.2), compiled: its record, variables, moves and starts.

Points 0 .. N - 1 are the robots, tip first, and point N is the source; segment j joins the points
j and j + 1, so robot i ends the segments i - 1 and i.
"""

from typing import Any, NamedTuple

import numpy as np

from hose_mj.jit import inlined, jitable
from hose_mj.tasks import joint, kernels
from hose_mj.tasks.kernels import HEADER, Floats, Integers, begin, end_joint, end_turn
from hose_mj.tasks.line.geometry import DOWN, LEFT, NONE, RIGHT, UP, Bytes, compute_covered
from hose_mj.tasks.stream import Stream, draw_below

OUT, STRETCH, COLLISION, GOAL, ALL_GOALS = 1, 2, 4, 8, 16
ENTERING, SWEEPING, ROBOTS = 0, 1, 2
"""Collision rules: entering a held or covered cell, any robot being on one, robots alone."""
FIXED, RANDOM, ABSENT = 0, 1, 2  # where the goal comes from


class Line(NamedTuple):
    """The rules; state: header, x and y of robots 0 .. N - 1, of the source, of the goals."""

    n_agents: int
    n_actions: int
    step_limit: int
    terminal: int
    violations: int
    success: int
    shared: int
    reward_table: Floats
    n_robots: int  # N
    single_agent: bool  # whether one agent moves all robots with actions 4 robot + direction
    own_goals: bool  # whether each robot has a goal of its own (non-cooperative task)
    cancelling: bool  # whether impossible moves are cancelled (the author's rule) before the events
    collision: int  # ENTERING, SWEEPING or ROBOTS
    half_width: int  # h; the grid is [-h, h]^2
    largest_square: int  # square of the longest segment, L_s^2 rounded down
    offsets: Integers  # offsets allowed between neighbours (k, 2)
    offset_table: Integers  # their numbers, see `geometry.make_offset_table`
    # cover_reach, cover_table: m and the table of `geometry.make_cover_table`.
    cover_reach: int
    cover_table: Bytes
    random_start: bool  # whether the robots' first cells are drawn from the feasible set
    starts: Integers  # their first cells otherwise (N, 2)
    goal_mode: int  # FIXED, RANDOM or ABSENT
    goals: Integers  # the goals where they are fixed (n_goals, 2)
    goal_cells: Integers  # cells that the tip can reach (m, 2)
    # distance_table, direction_table: d_g and theta_g by G - P, (0, 0) in the middle.
    distance_table: Integers
    direction_table: Integers


@jitable
def look_up(table: Any, i: int, j: int) -> int:
    """Returns table[i, j]; unsigned, the indices need no test for counting from the end."""
    return table[np.uint64(i), np.uint64(j)]


@jitable
def get_x(state: Integers, point: int) -> int:
    """Returns x of a robot or the source; for the unsigned index see `look_up`."""
    return state[np.uint64(HEADER + 2 * point)]


@jitable
def get_y(state: Integers, point: int) -> int:
    """Returns y of a robot or the source."""
    return state[np.uint64(HEADER + 2 * point + 1)]


@jitable
def put(state: Integers, point: int, x: int, y: int) -> None:
    """Puts a robot, or with point = N + 1 + k goal k, on a cell."""
    state[HEADER + 2 * point] = x
    state[HEADER + 2 * point + 1] = y


@jitable
def clip(value: int, bound: int) -> int:
    """Returns the nearest value in [-bound, bound]."""
    return min(max(value, -bound), bound)


@jitable
def step_x(action: int) -> int:
    """Returns by how much an action raises x."""
    return (action == RIGHT) - (action == LEFT)


@jitable
def step_y(action: int) -> int:
    """Returns by how much an action raises y."""
    return (action == UP) - (action == DOWN)


@jitable
def is_inside(record: Line, x: int, y: int) -> bool:
    """Whether a cell is on the grid."""
    return max(abs(x), abs(y)) <= record.half_width


@jitable
def is_held(record: Line, state: Integers, robot: int, x: int, y: int) -> bool:
    """Whether another robot stands on the cell."""
    for other in range(record.n_robots):
        if other != robot and get_x(state, other) == x and get_y(state, other) == y:
            return True
    return False


@jitable
def compute_covered_by(
    record: Line, state: Integers, start: int, end: int, x: int, y: int
) -> np.int64:
    """Returns `geometry.compute_covered` for the straight line from one point to another."""
    ax, ay, bx, by = get_x(state, start), get_y(state, start), get_x(state, end), get_y(state, end)
    dx, dy = bx - ax, by - ay
    m = record.cover_reach
    if max(abs(dx), abs(dy)) > m:
        return compute_covered(ax, ay, bx, by, x, y)
    to_x, to_y = clip(x - ax, m + 2), clip(y - ay, m + 2)
    segment = (dx + m) * (2 * m + 1) + dy + m
    cell = (to_x + m + 2) * (2 * m + 5) + to_y + m + 2
    return np.int64(look_up(record.cover_table, segment, cell))


@jitable
def compute_blocked(record: Line, state: Integers, robot: int) -> int:
    """Returns which of the cells that the actions lead to are blocked for the robot.

    Bit a is the cell of action a. Another robot blocks its cell, and so does the segment behind it
    those it covers, unless the robot itself is at the segment's end or no segment ever blocks.
    """
    x, y = get_x(state, robot), get_y(state, robot)
    blocked = 0
    for k in range(record.n_robots - 1):
        other = k + (k >= robot)
        end = other + ((record.collision != ROBOTS) & (other + 1 != robot))
        blocked |= compute_covered_by(record, state, other, end, x, y)
    return blocked


@jitable
def is_too_long(record: Line, state: Integers, segment: int) -> bool:
    """Whether a segment is longer than L_s."""
    dx = get_x(state, segment + 1) - get_x(state, segment)
    dy = get_y(state, segment + 1) - get_y(state, segment)
    return dx * dx + dy * dy > record.largest_square


@jitable
def is_stretched(record: Line, state: Integers, robot: int) -> bool:
    """Whether a segment that the robot ends is longer than L_s."""
    return is_too_long(record, state, robot) | is_too_long(record, state, max(robot - 1, 0))


@jitable
def is_in_the_way(record: Line, state: Integers, robot: int) -> bool:
    """Whether the robot stands where it should not: with another one, or on the hose."""
    return (compute_blocked(record, state, robot) >> NONE & 1) == 1


@jitable
def is_at_goal(record: Line, state: Integers, robot: int, goal: int) -> bool:
    """Whether the robot stands on the goal of that number."""
    at = record.n_robots + 1 + goal
    return get_x(state, robot) == get_x(state, at) and get_y(state, robot) == get_y(state, at)


# Variables (B.2.2)


@jitable
def number_offset(record: Line, state: Integers, point: int, behind: int) -> int:
    """Returns the number of the point's place relative to the one behind it, or to itself."""
    m = record.offset_table.shape[0] // 2
    dx = clip(get_x(state, point) - get_x(state, behind), m)
    dy = clip(get_y(state, point) - get_y(state, behind), m)
    return look_up(record.offset_table, dx + m, dy + m)


@jitable
def number_cell(record: Line, x: int, y: int) -> int:
    """Returns the number of a cell of the grid."""
    return (x + record.half_width) * (2 * record.half_width + 1) + y + record.half_width


@jitable
def observe_robot(
    record: Line, state: Integers, robot: int, ahead: int, behind: int, values: Integers, at: int
) -> None:
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
    blocked = compute_blocked(record, state, robot)
    x, y = get_x(state, robot), get_y(state, robot)
    for action in range(NONE):
        inside = is_inside(record, x + step_x(action), y + step_y(action))
        values[at + 6 + action] = inside & (blocked >> action & 1)


@kernels.observe.register(Line)
@inlined
def observe_line(record: Line, state: Integers, agent: int, values: Integers) -> None:
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


# Moves and the events they cause (B.2.1, B.2.3)


@jitable
def compute_breaks(record: Line, state: Integers, robot: int, moved: bool) -> int:
    """Returns the constraints that the robot breaks, having moved to another cell or not."""
    inside = is_inside(record, get_x(state, robot), get_y(state, robot))
    looks = moved | (record.collision == SWEEPING)
    return (
        OUT * (not inside)
        | STRETCH * is_stretched(record, state, robot)
        | COLLISION * (looks & is_in_the_way(record, state, robot))
    )


@jitable
def compute_goal_events(record: Line, state: Integers, robot: int) -> int:
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
def move(record: Line, state: Integers, robot: int, direction: int) -> int:
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
    events |= compute_breaks(record, state, robot, moved)
    if record.collision == SWEEPING:
        for other in range(record.n_robots):
            if is_in_the_way(record, state, other):
                events |= COLLISION
    return events if events else compute_goal_events(record, state, robot)


@kernels.apply.register(Line)
@inlined
def apply_line(record: Line, state: Integers, agent: int, action: int) -> int:
    """Moves the agent's robot, or the one that a single agent names."""
    end_turn(record, state, agent)
    if record.single_agent:
        return move(record, state, action >> 2, action & 3)
    return move(record, state, agent, action)


@joint.compute_target.register(Line)
@jitable
def compute_line_target(record: Line, state: Integers, robot: int, action: int) -> int:
    """Returns the number of the cell an action leads to, of a grid with a rim of one cell."""
    x = get_x(state, robot) + step_x(action) + record.half_width + 1
    y = get_y(state, robot) + step_y(action) + record.half_width + 1
    return x * (2 * record.half_width + 3) + y


@jitable
def cancel_moves(record: Line, state: Integers, packed: int) -> int:
    """Cancels the moves that leave the grid, then those that robots cannot make together."""
    for robot in range(record.n_robots):
        action = joint.unpack(packed, robot)
        x = get_x(state, robot) + step_x(action)
        if not is_inside(record, x, get_y(state, robot) + step_y(action)):
            packed = joint.cancel(packed, robot)
    return joint.settle(record, state, record.n_robots, packed, joint.FIRST)


@jitable
def compute_swaps(record: Line, state: Integers, packed: int) -> int:
    """Returns, as bits, the robots that change places with another one."""
    swaps = 0
    for one in range(record.n_robots):
        for other in range(one + 1, record.n_robots):
            here = compute_line_target(record, state, one, NONE)
            there = compute_line_target(record, state, other, NONE)
            if (
                here != there
                and compute_line_target(record, state, one, joint.unpack(packed, one)) == there
                and compute_line_target(record, state, other, joint.unpack(packed, other)) == here
            ):
                swaps |= 1 << one | 1 << other
    return swaps


@jitable
def compute_cancelled_event(record: Line, state: Integers, robot: int, action: int) -> int:
    """Returns the event for which a robot's move was cancelled, or would be."""
    x = get_x(state, robot) + step_x(action)
    inside = is_inside(record, x, get_y(state, robot) + step_y(action))
    return COLLISION if inside else OUT


@kernels.apply_joint.register(Line)
@inlined
def apply_joint_line(
    record: Line, state: Integers, actions: Integers, caused_events: Integers
) -> int:
    """Moves all robots at once; each one is charged with what it breaks itself."""
    if record.single_agent:
        caused_events[0] = apply_line(record, state, 0, actions[0])
        return caused_events[0]
    packed = joint.pack(actions)
    caused_events[:] = 0
    if record.cancelling:
        packed = cancel_moves(record, state, packed)
    swaps = compute_swaps(record, state, packed)
    for robot in range(record.n_robots):
        if joint.unpack(packed, robot) == joint.CANCELLED:
            caused_events[robot] = compute_cancelled_event(record, state, robot, actions[robot])
        elif swaps >> robot & 1:
            caused_events[robot] = COLLISION
    for robot in range(record.n_robots):
        action = joint.unpack(packed, robot)
        put(
            state, robot, get_x(state, robot) + step_x(action), get_y(state, robot) + step_y(action)
        )
    events = 0
    for robot in range(record.n_robots):
        caused_events[robot] |= compute_breaks(
            record, state, robot, joint.unpack(packed, robot) < NONE
        )
        events |= caused_events[robot]
    if not events:
        for robot in range(record.n_robots if record.own_goals else 1):
            caused_events[robot] = compute_goal_events(record, state, robot)
            events |= caused_events[robot]
    end_joint(record, state)
    return events


# Initial states: uniform over the feasible ones


@jitable
def fits(record: Line, state: Integers, robot: int) -> bool:
    """Whether the robot and its segment agree with the robots nearer to the source."""
    x, y = get_x(state, robot), get_y(state, robot)
    if not is_inside(record, x, y):
        return False
    hose_blocks = record.collision != ROBOTS
    covered = 0
    for other in range(robot + 1, record.n_robots):
        covered |= compute_covered_by(record, state, other, other + hose_blocks, x, y)
    for other in range(robot + 2, record.n_robots if hose_blocks else 0):
        ox, oy = get_x(state, other), get_y(state, other)
        covered |= compute_covered_by(record, state, robot, robot + 1, ox, oy)
    return (covered >> NONE & 1) == 0


@jitable
def draw_chain(record: Line, state: Integers, stream: Stream) -> None:
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
def place_goals(record: Line, state: Integers, stream: Stream) -> None:
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
def place_robots(record: Line, state: Integers, stream: Stream) -> None:
    """Puts the robots on their first cells, fixed or drawn."""
    if record.random_start:
        draw_chain(record, state, stream)
    else:
        for robot in range(record.n_robots):
            put(state, robot, record.starts[robot, 0], record.starts[robot, 1])


@jitable
def is_solved(record: Line, state: Integers) -> bool:
    """Whether the tip, or with own goals every robot, stands on its goal."""
    for robot in range(record.n_robots if record.own_goals else 1):
        if not is_at_goal(record, state, robot, robot):
            return False
    return record.goal_mode != ABSENT


@kernels.reset.register(Line)
@inlined
def reset_line(record: Line, state: Integers, stream: Stream) -> None:
    """Places goals and robots, again and again until the task is not solved at the start."""
    begin(state)
    put(state, record.n_robots, 0, 0)
    solved = True
    while solved:
        place_goals(record, state, stream)
        place_robots(record, state, stream)
        solved = is_solved(record, state)
