from itertools import product

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import (
    OVER,
    enumerate_joint,
    enumerate_turns,
    solve,
)
from hose_mj.tasks.kernels import HEADER, TURN
from hose_mj.tasks.registry import make_task

LEFT, RIGHT, NONE = 0, 1, 2
GAMMA = 0.9


@pytest.fixture
def stream():
    return np.array([11], np.uint64)


# Thesis Table 6.1: reward and cells of the two robots after each joint action.
TABLE_61 = {
    (LEFT, LEFT): (90, (0, 1)),
    (LEFT, RIGHT): (-20, (0, 2)),
    (LEFT, NONE): (-10, (0, 2)),
    (RIGHT, RIGHT): (90, (1, 2)),
    (RIGHT, NONE): (100, (1, 2)),
    (NONE, LEFT): (100, (0, 1)),
    (NONE, RIGHT): (-10, (0, 2)),
    (NONE, NONE): (0, (0, 2)),
}


@pytest.mark.parametrize(
    ("winner", "contest"),
    [("first", (90, (1, 2))), ("second", (90, (0, 1))), ("neither", (-20, (0, 2)))],
)
def test_table_6_1(stream, winner, contest):
    task = make_task("corridor", winner=winner)
    model = enumerate_joint(task, [task.reset(stream)])
    caused_events = np.zeros(2, np.int64)
    for number, actions in enumerate(product(range(3), repeat=2)):
        reward, cells = {**TABLE_61, (RIGHT, LEFT): contest}[actions]
        assert model.rewards[0, number].tolist() == [reward, reward]
        state = task.reset(stream)
        kernels.apply_joint(task.kernel, state, np.array(actions), caused_events)
        assert tuple(state[task.layout["robots"]]) == cells
        assert (model.successors[0, number] == OVER) == (1 in cells)


# Thesis Table 6.2, with {none, left} as its own text has it: gamma 100.
TABLE_62 = {
    (LEFT, LEFT): ((-10, 100), (0, 1)),
    (LEFT, RIGHT): ((-10, -10), (0, 2)),
    (LEFT, NONE): ((-10, 0), (0, 2)),
    (RIGHT, LEFT): ((100, -10), (1, 2)),
    (RIGHT, RIGHT): ((100, -10), (1, 2)),
    (RIGHT, NONE): ((100, 0), (1, 2)),
    (NONE, LEFT): ((0, 100), (0, 1)),
    (NONE, RIGHT): ((0, -10), (0, 2)),
    (NONE, NONE): ((0, 0), (0, 2)),
}


@pytest.mark.parametrize("actions", TABLE_62)
def test_table_6_2(stream, actions):
    task = make_task("corridor")
    model = enumerate_turns(task, [task.reset(stream)])
    (first, second), cells = TABLE_62[actions]
    between = model.successors[0, actions[0]]
    assert model.rewards[0, actions[0]].tolist() == [first, first]
    assert model.rewards[between, actions[1]].tolist() == [second, second]
    state = task.reset(stream)
    for agent, action in enumerate(actions):
        events = kernels.apply(task.kernel, state, agent, action)
    assert tuple(state[task.layout["robots"]]) == cells
    assert kernels.is_over(task.kernel, events) == (1 in cells)


def test_the_best_of_the_corridor_is_what_example_1_says(stream):
    task = make_task("corridor")
    start = task.reset(stream)
    joint = enumerate_joint(task, [start])
    best = solve(joint, joint.rewards[:, :, 0], GAMMA)[0]
    pairs = list(product(range(3), repeat=2))
    assert {pairs[k] for k in np.flatnonzero(best == best.max())} == {(RIGHT, NONE), (NONE, LEFT)}
    assert best.max() == 100.0
    turns = enumerate_turns(task, [start])
    by_move = solve(turns, turns.rewards[:, :, 0], GAMMA)[0]
    assert by_move == pytest.approx([-10 + 0.9 * 100, 100, 0.9 * 100])
    by_turn = np.where(turns.turns == 1, GAMMA, 1.0)  # whole cycles are discounted
    by_cycle = solve(turns, turns.rewards[:, :, 0], by_turn)[0]
    assert by_cycle == pytest.approx([90, 100, 100])


def test_a_lone_tip_walks_the_shortest_way():
    task = make_task("line", n_robots=1, half_width=3, start=((0, 0),), goal=(2, -1))
    start = task.reset(np.array([1], np.uint64))
    model = enumerate_turns(task, [start])
    assert len(model.states) == 49 - 1  # on the goal, the episode is over
    values = solve(model, model.rewards[:, :, 0], GAMMA).max(axis=1)
    x, y = model.states[:, task.layout["robots"]].T
    distance = abs(x - 2) + abs(y + 1)
    assert values == pytest.approx(100 * GAMMA ** (distance - 1.0))


def test_a_short_hose_keeps_the_tip_within_its_circle():
    task = make_task("line", n_robots=1, hose_length=3, start=((0, 0),), goal="none")
    model = enumerate_turns(task, [task.reset(np.array([1], np.uint64))])
    span = range(-3, 4)
    assert len(model.states) == sum(x * x + y * y <= 9 for x in span for y in span)


def test_one_taxi_takes_its_passenger_the_shortest_way(stream):
    # From (2, 2): 4 steps to R at (0, 0), pick, 7 steps to B at (4, 3), drop: 13 actions.
    task = make_task("taxi", starts=((2, 2),), passengers=(("R", "B"),))
    model = enumerate_turns(task, [task.reset(stream)])
    assert len(model.states) == 25 + 25  # waiting, and on board
    values = solve(model, model.rewards[:, :, 0], GAMMA)
    assert values[0].max() == pytest.approx(100 * GAMMA**12)


def test_two_taxis_reach_every_legal_state(stream):
    task = make_task("taxi")
    model = enumerate_turns(task, [task.reset(stream)])
    assert np.bincount(model.turns).tolist() == [600 * 13, 600 * 13]


def test_table_5_1():
    task = make_task("maze", actions="up", collision_reward=-7.0)
    state = task.make_state()
    rows = [(0, 0, 1), (1, 0, 0), (2, 0, 1), (3, 0, 0), (2, 1, 1), (3, 1, 1)]
    rewards = np.zeros(2)
    for x, y, wall_above in rows:
        state[HEADER:] = x, y
        assert task.observe(state, 0).tolist() == [x, y, wall_above]
        events = kernels.apply(task.kernel, state, 0, 0)
        kernels.compute_rewards(task.kernel, events, 0, 0, rewards)
        assert rewards.tolist() == [0.0, -7.0 * wall_above]
        assert tuple(state[HEADER:]) == (x, y + 1 - wall_above)


def test_a_joint_move_of_one_agent_is_that_agents_move():
    # Definition 10: a joint action with one action that is not null does what the action does.
    task = make_task("line", n_robots=3, half_width=3, hose_length=6)
    stream = np.array([5], np.uint64)
    caused_events = np.zeros(3, np.int64)
    for _ in range(300):
        state = task.reset(stream)
        for agent, action in product(range(3), range(5)):
            alone, jointly = state.copy(), state.copy()
            actions = np.full(3, 4)
            actions[agent] = action
            events = kernels.apply(task.kernel, alone, agent, action)
            assert kernels.apply_joint(task.kernel, jointly, actions, caused_events) == events
            assert (alone[HEADER:] == jointly[HEADER:]).all()


def test_unknown_states_and_endless_tasks_are_refused(stream):
    task = make_task("corridor")
    model = enumerate_turns(task, [task.reset(stream)])
    assert model.find(model.states[2]) == 2
    with pytest.raises(InputError, match="can be reached"):
        model.find(np.array([0, 0, 1, 1]))
    with pytest.raises(InputError, match="at most 2 states"):
        enumerate_turns(task, [task.reset(stream)], limit=2)
    assert set(model.states[:, TURN]) == {0, 1}
