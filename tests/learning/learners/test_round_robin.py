"""Algorithms 4.1 and 6.3: their fixed points at a fixed epsilon, and what a cycle teaches."""

import numpy as np
import pytest

from hose_mj.tasks.exact import enumerate_turns
from hose_mj.tasks.registry import make_task

GAMMA = 0.9
PLAIN = {"values": "monolithic", "vetoes": "none"}


def write_out(task):
    return enumerate_turns(task, [task.reset(np.array([3], np.uint64))])


def act_epsilon_greedily(values, epsilon):
    """Probabilities of the actions (n_states, n_actions)."""
    best = values == values.max(axis=1, keepdims=True)
    return epsilon / values.shape[1] + (1.0 - epsilon) * best / best.sum(axis=1, keepdims=True)


@pytest.mark.parametrize("epsilon", [1.0, 0.5])
@pytest.mark.parametrize(
    ("id", "discounts"),
    [("d-rr-ql", (1.0, GAMMA, GAMMA**2)), ("safe-msav", (1.0, 1.0, GAMMA))],
)
def test_the_fixed_point_belongs_to_the_teammates_behaviour(
    make_training, read_values, solve_cycle, id, discounts, epsilon
):
    task = make_task("corridor", n_cells=4, goal=2, starts=(0, 3))
    training = make_training(
        task, id, **PLAIN, epsilon=epsilon, compiled=True, learning_rate_decay=1e-3
    )
    training.advance(moves=4_000_000)
    model = write_out(task)
    learned = read_values(training, model)
    policies = act_epsilon_greedily(learned, epsilon)
    for agent in (0, 1):
        mine, expected = solve_cycle(model, agent, discounts, policies)
        assert learned[mine] == pytest.approx(expected, abs=0.5)


def test_beside_a_teammate_that_moves_by_chance_a_goal_is_worth_less(
    make_chain, make_training, read_values, solve_cycle
):
    # Five steps lead to the goal: 100 gamma^4 with a teammate that helps.
    task = make_chain()
    training = make_training(task, "d-rr-ql", **PLAIN, learning_rate_decay=2e-3)
    training.advance(moves=60_000)
    model = write_out(task)
    uniform = np.full((len(model.states), 2), 0.5)
    mine, expected = solve_cycle(model, 0, (1.0, GAMMA, GAMMA**2), uniform)
    assert expected[0].max() < 50.0 < 100.0 * GAMMA**4
    assert read_values(training, model)[mine] == pytest.approx(expected, abs=2.5)


@pytest.mark.parametrize(
    ("step_limit", "first", "second"),
    [(1, 0.0, 0.0), (2, -10.0 - 10.0 * GAMMA, 0.0), (3, -10.0 - 10.0 * GAMMA, -10 - 10 * GAMMA)],
)
def test_a_cycle_that_is_cut_off_teaches_nothing(make_training, step_limit, first, second):
    # The only action runs both robots against their walls, for -10 a move.
    task = make_task("corridor", step_limit=step_limit)
    training = make_training(task, "d-rr-ql", **PLAIN, learning_rate=1.0, discount=GAMMA)
    wall = {0: 0, 1: 1}
    for agent, action in wall.items():
        # All other actions look worse and epsilon is 0.
        rows = training.memory.table.rows
        rows[agent * 9 : (agent + 1) * 9] = -1e6
        rows[agent * 9 : (agent + 1) * 9, action] = 0.0
    training.memory.numbers[0] = 0.0
    ended = training.advance(episodes=1)
    assert ended.moves.tolist() == [step_limit]
    here = 0 * 3 + 2
    assert training.memory.table.rows[here, 0] == pytest.approx(first)
    assert training.memory.table.rows[9 + here, 1] == pytest.approx(second)


def test_the_rate_falls_with_the_moves(make_chain, make_training):
    # One agent, one step: the n-th move is worth alpha_n (100 - Q) more.
    task = make_chain(n_agents=1, moves=(1,), n_cells=2)
    training = make_training(task, "q-learning", learning_rate=0.5, learning_rate_decay=0.25)
    expected = 0.0
    for n in range(1, 9):
        training.advance(moves=1)
        expected += 0.5 / (1 + 0.25 * n) * (100.0 - expected)
        assert training.memory.table.rows[0, 0] == pytest.approx(expected, rel=1e-12)


def test_rewards_of_modules_are_learned_apart(make_training):
    task = make_task("corridor")
    modular = make_training(task, "modular-q", seed=4)
    modular.advance(moves=3000)
    goal, collisions = np.split(modular.memory.table.rows[:-1], 2)
    assert (goal >= 0.0).all()
    assert goal.max() > 50.0
    assert (collisions <= 0.0).all()
    assert collisions.min() < -5.0
