"""The corridor of Example 1 (thesis section 6.4) and the maze of Table 5.1, compiled."""

from typing import NamedTuple

from hose_mj.jit import inlined, jitable
from hose_mj.tasks import joint, kernels
from hose_mj.tasks.kernels import HEADER, TURN, Floats, Integers, begin, end_joint, end_turn
from hose_mj.tasks.stream import Stream, draw_below

COLLISION, GOAL, DONE = 1, 2, 4
LEFT, RIGHT = 0, 1


class Corridor(NamedTuple):
    """The corridor's rules; state: header, then the robots' cells."""

    n_agents: int
    n_actions: int
    step_limit: int
    terminal: int
    violations: int
    success: int
    shared: int
    reward_table: Floats
    n_cells: int  # length of the corridor
    goal: int  # the goal's cell
    starts: Integers  # the robots' first cells (n_agents,)
    goal_ends_move: bool  # whether reaching the goal ends the episode at once, not the cycle
    winner: int  # who gets a cell that both enter at once, as in `joint`


@kernels.reset.register(Corridor)
@inlined
def reset_corridor(record: Corridor, state: Integers, stream: Stream) -> None:
    """Puts the robots on their first cells."""
    begin(state)
    for robot in range(record.n_agents):
        state[HEADER + robot] = record.starts[robot]


@joint.compute_target.register(Corridor)
@jitable
def compute_corridor_target(record: Corridor, state: Integers, robot: int, action: int) -> int:
    """Returns the cell an action leads to; -1 and n_cells are walls."""
    return state[HEADER + robot] + (action == RIGHT) - (action == LEFT)


@jitable
def is_goal_held(record: Corridor, state: Integers) -> bool:
    """Whether a robot stands on the goal."""
    held = False
    for robot in range(record.n_agents):
        held = held or state[HEADER + robot] == record.goal
    return held


@kernels.apply.register(Corridor)
@inlined
def apply_corridor(record: Corridor, state: Integers, agent: int, action: int) -> int:
    """Moves one robot; a wall or the other robot stops it."""
    here = state[HEADER + agent]
    target = compute_corridor_target(record, state, agent, action)
    events = 0
    if target != here:
        free = 0 <= target < record.n_cells
        for robot in range(record.n_agents):
            free = free and state[HEADER + robot] != target
        if free:
            state[HEADER + agent] = target
        events = (GOAL if target == record.goal else 0) if free else COLLISION
    end_turn(record, state, agent)
    if (state[TURN] == 0 or record.goal_ends_move) and is_goal_held(record, state):
        events |= DONE
    return events


@kernels.apply_joint.register(Corridor)
@inlined
def apply_joint_corridor(
    record: Corridor, state: Integers, actions: Integers, caused_events: Integers
) -> int:
    """Moves both robots at once; a wall, or the other robot, stops one."""
    packed = joint.pack(actions)
    for robot in range(record.n_agents):
        if not 0 <= compute_corridor_target(record, state, robot, actions[robot]) < record.n_cells:
            packed = joint.cancel(packed, robot)
    packed = joint.settle(record, state, record.n_agents, packed, record.winner)
    events = 0
    for robot in range(record.n_agents):
        action = joint.unpack(packed, robot)
        target = compute_corridor_target(record, state, robot, action)
        entered = target != state[HEADER + robot]
        state[HEADER + robot] = target
        caused_events[robot] = COLLISION * (action == joint.CANCELLED)
        caused_events[robot] |= GOAL * (entered and target == record.goal)
        events |= caused_events[robot]
    if is_goal_held(record, state):
        caused_events[0] |= DONE
        events |= DONE
    end_joint(record, state)
    return events


@kernels.observe.register(Corridor)
@inlined
def observe_corridor(record: Corridor, state: Integers, agent: int, values: Integers) -> None:
    """Writes the robots' cells, which both agents see."""
    for robot in range(record.n_agents):
        values[robot] = state[HEADER + robot]


class Maze(NamedTuple):
    """The maze's rules; state: header, then the robot's x and y.

    Attributes:
        width, height: number of columns and rows.
        goal_x, goal_y: the goal's cell.
        start_x, start_y: the first cell; -1 for any but the goal's, drawn uniformly.
        walls: 1 where a step from (x, y) in direction up, down, left, right meets a wall
            (width, height, 4).
    """

    n_agents: int
    n_actions: int
    step_limit: int
    terminal: int
    violations: int
    success: int
    shared: int
    reward_table: Floats
    width: int
    height: int
    goal_x: int
    goal_y: int
    start_x: int
    start_y: int
    walls: Integers


@kernels.reset.register(Maze)
@inlined
def reset_maze(record: Maze, state: Integers, stream: Stream) -> None:
    """Puts the robot on its first cell, or on any but the goal's."""
    begin(state)
    if record.start_x < 0:
        place = draw_below(stream, record.width * record.height - 1)
        place += place >= record.goal_y * record.width + record.goal_x
        state[HEADER] = place % record.width
        state[HEADER + 1] = place // record.width
    else:
        state[HEADER] = record.start_x
        state[HEADER + 1] = record.start_y


@kernels.apply.register(Maze)
@inlined
def apply_maze(record: Maze, state: Integers, agent: int, action: int) -> int:
    """Moves the robot up, down, left or right; a wall stops it."""
    end_turn(record, state, agent)
    x, y = state[HEADER], state[HEADER + 1]
    if record.walls[x, y, action]:
        return COLLISION
    x += (action == 3) - (action == 2)
    y += (action == 0) - (action == 1)
    state[HEADER], state[HEADER + 1] = x, y
    return GOAL if x == record.goal_x and y == record.goal_y else 0


@kernels.apply_joint.register(Maze)
@inlined
def apply_joint_maze(
    record: Maze, state: Integers, actions: Integers, caused_events: Integers
) -> int:
    """Moves the robot; there is only one."""
    caused_events[0] = apply_maze(record, state, 0, actions[0])
    return caused_events[0]


@kernels.observe.register(Maze)
@inlined
def observe_maze(record: Maze, state: Integers, agent: int, values: Integers) -> None:
    """Writes x, y and for each action whether a wall is in its way."""
    values[0], values[1] = state[HEADER], state[HEADER + 1]
    for action in range(record.n_actions):
        values[2 + action] = record.walls[state[HEADER], state[HEADER + 1], action]
