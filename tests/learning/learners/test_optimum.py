"""What converges to the optimum, by value iteration on tasks that are written out."""

import numpy as np
import pytest
from hose_learning.settings import Exploration

from hose_mj.tasks.exact import enumerate_turns, solve
from hose_mj.tasks.registry import make_task

GAMMA = 0.9
CORRIDORS = [
    {},
    {"goal_ends": "move"},
    {"n_cells": 6, "goal": 3, "starts": (0, 5)},
    {"n_cells": 7, "goal": 5, "starts": (1, 0), "step_limit": 21},
]


def write_out(task, n_starts=200):
    stream = np.array([3], np.uint64)
    return enumerate_turns(task, [task.reset(stream) for _ in range(n_starts)])


@pytest.mark.parametrize(("learning_rate", "moves"), [(1.0, 5000), (0.6, 15_000)])
def test_q_learning_solves_the_maze(make_training, read_values, learning_rate, moves):
    task = make_task("maze")
    training = make_training(task, "q-learning", learning_rate=learning_rate)
    training.advance(moves=moves)
    model = write_out(task)
    best = solve(model, model.rewards[:, :, 0], GAMMA)
    assert read_values(training, model) == pytest.approx(best, abs=1e-9)


def test_q_learning_of_one_agent_for_all_robots(make_training, make_line, read_values):
    task = make_line("line-single-agent", start=((1, -1), (0, -1)))
    training = make_training(task, "q-learning", learning_rate=1.0, discount=0.8)
    training.advance(moves=50_000)
    model = write_out(task, 1)
    best = solve(model, model.rewards[:, :, 0], 0.8)
    start = model.find(task.reset(np.array([1], np.uint64)))
    assert read_values(training, model)[start] == pytest.approx(best[start], abs=1e-9)


@pytest.mark.parametrize("settings", CORRIDORS)
@pytest.mark.parametrize("id", ["rr-q", "d-rr-ql-messages"])
def test_algorithms_6_1_and_6_2_solve_the_corridor(make_training, read_values, id, settings):
    task = make_task("corridor", **settings)
    training = make_training(task, id, learning_rate=1.0, compiled=True)
    training.advance(moves=200_000)
    model = write_out(task, 1)
    best = solve(model, model.rewards[:, :, 0], GAMMA)
    assert read_values(training, model) == pytest.approx(best, abs=1e-9)


@pytest.mark.parametrize("id", ["rr-q", "d-rr-ql-messages"])
def test_algorithms_6_1_and_6_2_solve_a_small_hose(make_training, make_line, read_values, id):
    # Only the mover is punished: that, not what the others get, is the r_t of both algorithms.
    task = make_line(half_width=1, hose_length=2, violation_reward=-50.0)
    training = make_training(task, id, learning_rate=1.0)
    training.advance(moves=25_000)
    model = write_out(task)
    movers = np.take_along_axis(model.rewards, model.turns[:, None, None], axis=2)[:, :, 0]
    assert (movers != model.rewards[:, :, 0]).any()
    assert read_values(training, model) == pytest.approx(solve(model, movers, GAMMA), abs=1e-9)


@pytest.mark.parametrize("settings", CORRIDORS[:3])
def test_6_3_reaches_the_optimum_as_epsilon_falls_to_0(make_training, read_values, settings):
    task = make_task("corridor", **settings)
    falls = Exploration(per_episode=1e-4)
    training = make_training(
        task, "d-rr-ql", values="monolithic", vetoes="none", exploration=falls, compiled=True
    )
    training.advance(episodes=20_000)
    model = write_out(task, 1)
    best = solve(model, model.rewards[:, :, 0], GAMMA)[0].max()
    assert training.epsilon == 0.0
    assert read_values(training, model)[0].max() == pytest.approx(best, abs=1e-9)
    # The goal's discounted 100 tells the number of moves: 100 gamma^(n - 1) where nobody collides.
    if settings != {}:
        moves = training.test().moves[0]
        assert 100.0 * GAMMA ** (moves - 1) == pytest.approx(best)


@pytest.mark.parametrize("settings", [{}, {"n_cells": 6, "goal": 3, "starts": (0, 5)}])
def test_algorithm_4_1_reaches_the_optimum_of_discounted_cycles(
    make_training, read_values, settings
):
    task = make_task("corridor", **settings)
    falls = Exploration(per_episode=1e-4)
    training = make_training(
        task, "safe-msav", values="monolithic", vetoes="none", exploration=falls, compiled=True
    )
    training.advance(episodes=20_000)
    model = write_out(task, 1)
    last = np.where(model.turns == 1, GAMMA, 1.0)  # within a cycle nothing is discounted
    best = solve(model, model.rewards[:, :, 0], last)[0].max()
    by_move = solve(model, model.rewards[:, :, 0], GAMMA)[0].max()
    assert read_values(training, model)[0].max() == pytest.approx(best, abs=1e-9)
    assert settings == {} or best > by_move
