"""The multi-agent taxi problem (thesis B.3), compiled."""

from typing import NamedTuple

from hose_mj.jit import inlined, jitable
from hose_mj.tasks import joint, kernels
from hose_mj.tasks.kernels import HEADER, Floats, Integers, begin, end_joint, end_turn
from hose_mj.tasks.stream import Stream

COLLISION, MISPLACED, GOAL = 1, 2, 4
UP, RIGHT, DOWN, LEFT, PICK, DROP = range(6)
WIDTH = 5
STATIONS = {"R": (0, 0), "G": (0, 4), "Y": (4, 0), "B": (4, 3)}
"""Cells (row, column), row 0 at the top (Dietterich 2000)."""
WAITING = 0


class Taxi(NamedTuple):
    """The rules; state: header, the taxis' cells, what became of the passengers.

    A cell is WIDTH row + column. A passenger is WAITING, in taxi k (k + 1), or delivered
    (n_taxis + 1). Where a single agent chooses for all taxis, its action has the last taxi's in the
    lowest digit of base 6, and the events of taxi k are shifted by 2 k bits, the goal by as many as
    the last taxi's.
    """

    n_agents: int
    n_actions: int
    step_limit: int
    terminal: int
    violations: int
    success: int
    shared: int
    reward_table: Floats
    n_taxis: int  # number of taxis
    single_agent: bool  # whether one agent chooses for all taxis
    walls: Integers  # 1 where a step from a cell up, right, down, left meets a wall (WIDTH^2, 4)
    starts: Integers  # the taxis' first cells (n_taxis,)
    origins: Integers  # where the passengers wait (n_passengers,)
    destinations: Integers  # where they want to go (n_passengers,)


@kernels.reset.register(Taxi)
@inlined
def reset_taxi(record: Taxi, state: Integers, stream: Stream) -> None:
    """Puts the taxis on their first cells; all passengers wait."""
    begin(state)
    for taxi in range(record.n_taxis):
        state[HEADER + taxi] = record.starts[taxi]
    for passenger in range(record.origins.shape[0]):
        state[HEADER + record.n_taxis + passenger] = WAITING


@joint.compute_target.register(Taxi)
@jitable
def compute_taxi_target(record: Taxi, state: Integers, taxi: int, action: int) -> int:
    """Returns the cell that an action leads to if no wall is in its way."""
    down = (action == DOWN) - (action == UP)
    return state[HEADER + taxi] + WIDTH * down + (action == RIGHT) - (action == LEFT)


@jitable
def is_walled(record: Taxi, state: Integers, taxi: int, action: int) -> bool:
    """Whether a wall is in the way of an action."""
    return action < PICK and record.walls[state[HEADER + taxi], action] == 1


@jitable
def is_held(record: Taxi, state: Integers, taxi: int, cell: int) -> bool:
    """Whether another taxi stands on the cell."""
    held = False
    for other in range(record.n_taxis):
        held = held or (other != taxi and state[HEADER + other] == cell)
    return held


@jitable
def is_blocked(record: Taxi, state: Integers, taxi: int, action: int) -> bool:
    """Whether a wall or another taxi is in the way of an action."""
    return is_walled(record, state, taxi, action) or is_held(
        record, state, taxi, compute_taxi_target(record, state, taxi, action)
    )


@jitable
def is_delivered(record: Taxi, state: Integers) -> bool:
    """Whether all passengers are where they want to go."""
    for passenger in range(record.origins.shape[0]):
        if state[HEADER + record.n_taxis + passenger] != record.n_taxis + 1:
            return False
    return True


@jitable
def pick(record: Taxi, state: Integers, taxi: int) -> int:
    """Takes in a passenger who waits here, if the taxi is empty; returns the events."""
    waiting = -1
    for passenger in range(record.origins.shape[0]):
        place = HEADER + record.n_taxis + passenger
        if state[place] == taxi + 1:
            return MISPLACED
        here = record.origins[passenger] == state[HEADER + taxi]
        if here and state[place] == WAITING and waiting < 0:
            waiting = place
    if waiting < 0:
        return MISPLACED
    state[waiting] = taxi + 1
    return 0


@jitable
def drop(record: Taxi, state: Integers, taxi: int) -> int:
    """Lets the taxi's passenger out where he wants to go; returns the events."""
    for passenger in range(record.origins.shape[0]):
        place = HEADER + record.n_taxis + passenger
        here = record.destinations[passenger] == state[HEADER + taxi]
        if here and state[place] == taxi + 1:
            state[place] = record.n_taxis + 1
            return 0
    return MISPLACED


@jitable
def act(record: Taxi, state: Integers, taxi: int, action: int) -> int:
    """Carries out an action that nothing prevents and returns the events."""
    if action == PICK:
        return pick(record, state, taxi)
    if action == DROP:
        return drop(record, state, taxi)
    state[HEADER + taxi] = compute_taxi_target(record, state, taxi, action)
    return 0


@jitable
def act_jointly(record: Taxi, state: Integers, packed: int) -> int:
    """Carries out one action of every taxi; returns taxi k's events shifted by 2 k bits."""
    for taxi in range(record.n_taxis):
        if is_walled(record, state, taxi, joint.unpack(packed, taxi)):
            packed = joint.cancel(packed, taxi)
    packed = joint.settle(record, state, record.n_taxis, packed, joint.NEITHER)
    events = 0
    for taxi in range(record.n_taxis):
        action = joint.unpack(packed, taxi)
        if action == joint.CANCELLED:
            events |= COLLISION << 2 * taxi
        else:
            events |= act(record, state, taxi, action) << 2 * taxi
    if is_delivered(record, state):
        events |= GOAL << 2 * (record.n_taxis - 1)
    return events


@kernels.apply.register(Taxi)
@inlined
def apply_taxi(record: Taxi, state: Integers, agent: int, action: int) -> int:
    """Carries out the action of the agent's taxi, or a single agent's for all taxis."""
    end_turn(record, state, agent)
    if record.single_agent:
        packed = 0
        for taxi in range(record.n_taxis - 1, -1, -1):
            packed |= action % 6 << 3 * taxi
            action //= 6
        return act_jointly(record, state, packed)
    if action < PICK and is_blocked(record, state, agent, action):
        return COLLISION
    events = act(record, state, agent, action)
    return events | GOAL if is_delivered(record, state) else events


@kernels.apply_joint.register(Taxi)
@inlined
def apply_joint_taxi(
    record: Taxi, state: Integers, actions: Integers, caused_events: Integers
) -> int:
    """Carries out the actions of all taxis at once; the goal is charged to agent 0."""
    if record.single_agent:
        caused_events[0] = apply_taxi(record, state, 0, actions[0])
        return caused_events[0]
    act_events = act_jointly(record, state, joint.pack(actions))
    events = 0
    for taxi in range(record.n_taxis):
        caused_events[taxi] = act_events >> 2 * taxi & (COLLISION | MISPLACED)
        events |= caused_events[taxi]
    if is_delivered(record, state):
        caused_events[0] |= GOAL
        events |= GOAL
    end_joint(record, state)
    return events


@jitable
def observe_flags(record: Taxi, state: Integers, taxi: int, values: Integers, at: int) -> None:
    """Writes whether something is in a taxi's way up, down, left and right, from `at` on."""
    values[at] = is_blocked(record, state, taxi, UP)
    values[at + 1] = is_blocked(record, state, taxi, DOWN)
    values[at + 2] = is_blocked(record, state, taxi, LEFT)
    values[at + 3] = is_blocked(record, state, taxi, RIGHT)


@kernels.observe.register(Taxi)
@inlined
def observe_taxi(record: Taxi, state: Integers, agent: int, values: Integers) -> None:
    """Writes the taxis' cells, the passengers, and the flags of the agent's taxi or of each."""
    at = record.n_taxis + record.origins.shape[0]
    for k in range(at):
        values[k] = state[HEADER + k]
    if not record.single_agent:
        observe_flags(record, state, agent, values, at)
        return
    for taxi in range(record.n_taxis):
        observe_flags(record, state, taxi, values, at + 4 * taxi)
