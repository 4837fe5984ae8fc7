import dataclasses

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import OVER, enumerate_turns, find_shortest
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream


def start(task, seed=0):
    return task.reset(make_stream(np.random.default_rng(seed)))


def count_moves(task, state):
    """Moves to the goal by relaxing over the whole graph, state by state."""
    model = enumerate_turns(task, [state])
    reaches = (model.events & task.kernel.success) != 0
    moves = np.full(len(model.states), np.inf)
    for _ in range(len(model.states)):
        following = np.where(model.successors == OVER, np.inf, moves[model.successors])
        better = np.where(reaches, 1.0, 1.0 + following).min(axis=1)
        if (better == moves).all():
            break
        moves = better
    return moves[model.find(state)]


@pytest.mark.parametrize(
    ("id", "options"),
    [
        ("corridor", {}),
        ("corridor", {"n_cells": 7, "starts": (0, 6), "goal": 2}),
        ("maze", {}),
        ("taxi", {"starts": ((2, 2),), "passengers": (("R", "B"),)}),
        ("line", {"n_robots": 2, "half_width": 2, "hose_length": 4}),
        ("line-single-agent", {"n_robots": 2, "half_width": 2, "hose_length": 4}),
    ],
)
def test_it_finds_the_fewest_moves(id, options):
    task = make_task(id, **options)
    for seed in range(3):
        state = start(task, seed)
        found = find_shortest(task, state)
        assert (np.inf if found is None else found) == count_moves(task, state)


def test_the_turn_of_the_start_counts():
    task = make_task("corridor", n_cells=5, starts=(0, 4), goal=3)
    state = start(task)
    late = state.copy()
    late[kernels.TURN] = 1
    assert find_shortest(task, state) != find_shortest(task, late)


def test_the_start_stays_as_it_is():
    task = make_task("maze")
    state = start(task)
    before = state.copy()
    find_shortest(task, state)
    assert (state == before).all()


def test_none_where_nothing_counts_as_success():
    task = make_task("maze")
    hopeless = dataclasses.replace(task, kernel=task.kernel._replace(success=0))
    assert find_shortest(hopeless, start(task)) is None


def test_too_many_states_are_an_error():
    task = make_task("line", n_robots=3)
    with pytest.raises(InputError, match="10 states"):
        find_shortest(task, start(task), limit=10)
