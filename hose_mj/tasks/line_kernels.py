"""The line-segment hose task (thesis B.2), compiled: moves, events, variables, initial states.

Points 0 .. N - 1 are the robots, tip first, and point N is the source; segment j joins the points
j and j + 1, so robot i ends the segments i - 1 and i.
"""

from __future__ import annotations

from typing import NamedTuple

from hose_mj.compiled import inlined, jitable
from hose_mj.tasks import joint, kernels
from hose_mj.tasks.kernels import HEADER, Floats, Integers, begin, end_joint, end_turn
from hose_mj.tasks.line_geometry import covers
from hose_mj.tasks.stream import draw_below

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
def find_breaks(record, state, robot, moved):  # type: ignore[no-untyped-def]
    """Returns the constraints that the robot breaks, having moved to another cell or not."""
    events = 0
    if not is_inside(record, get_x(state, robot), get_y(state, robot)):
        events |= OUT
    if is_stretched(record, state, robot):
        events |= STRETCH
    if (moved or record.collision == SWEEPING) and is_in_the_way(record, state, robot):
        events |= COLLISION
    return events


@jitable
def is_at_goal(record, state, robot, goal):  # type: ignore[no-untyped-def]
    """Whether the robot stands on the goal of that number."""
    at = record.n_robots + 1 + goal
    return get_x(state, robot) == get_x(state, at) and get_y(state, robot) == get_y(state, at)


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
@inlined
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


@jitable
def fits(record, state, robot):  # type: ignore[no-untyped-def]
    """Whether the robot and its segment agree with the robots nearer to the source."""
    x, y = get_x(state, robot), get_y(state, robot)
    if not is_inside(record, x, y):
        return False
    for other in range(robot + 1, record.n_robots):
        ox, oy = get_x(state, other), get_y(state, other)
        if ox == x and oy == y:
            return False
        if record.collision != ROBOTS and (
            is_covered(state, other, x, y)
            or (other > robot + 1 and is_covered(state, robot, ox, oy))
        ):
            return False
    return True


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
