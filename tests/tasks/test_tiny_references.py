from itertools import product

import pytest

from hose_mj.tasks.kernels import HEADER, STEPS, TURN


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"winner": "second", "goal_ends": "move"},
        {"winner": "neither", "n_cells": 6, "goal": 3, "starts": (5, 0)},
    ],
)
def test_every_action_in_every_state_of_the_corridor(make_pair, settings):
    pair = make_pair("corridor", **settings)

    def put(cells):
        pair.state[TURN], pair.state[STEPS] = 0, 0
        pair.state[HEADER:] = cells
        pair.reference.begin()
        pair.reference.robots = list(cells)

    pair.reset()
    for cells in product(range(pair.task.settings.n_cells), repeat=2):
        if cells[0] == cells[1]:
            continue
        put(cells)
        pair.observe(0)
        for actions in product(range(3), repeat=2):
            put(cells)
            pair.move_jointly(actions)
            put(cells)
            pair.move(0, actions[0])
            pair.move(1, actions[1])


@pytest.mark.parametrize("settings", [{}, {"actions": "up", "goal": (1, 1), "start": (3, 0)}])
def test_every_action_in_every_state_of_the_maze(make_pair, settings):
    pair = make_pair("maze", **settings)
    pair.reset()
    for cell in product(range(4), range(2)):
        for action in range(pair.task.n_actions):
            pair.state[TURN], pair.state[STEPS] = 0, 0
            pair.state[HEADER:] = cell
            pair.reference.begin()
            pair.reference.at = cell
            pair.observe(0)
            pair.move_jointly([action])
