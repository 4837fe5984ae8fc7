from itertools import product

import numpy as np
import pytest
from reference_tasks.taxi import is_walled

from hose_mj.tasks.kernels import HEADER, STEPS, TURN


def put(pair, taxis, passengers):
    """Puts task and reference into a state: cells by number, passengers as compiled."""
    n = len(taxis)
    names = {0: "waiting", n + 1: "delivered", **{k + 1: k for k in range(n)}}
    pair.state[TURN], pair.state[STEPS] = 0, 0
    pair.state[HEADER:] = [*taxis, *passengers]
    pair.reference.begin()
    pair.reference.taxis = [divmod(cell, 5) for cell in taxis]
    pair.reference.passengers = [names[place] for place in passengers]


def list_states():
    """Every state of two taxis and two passengers: cells differ, a taxi carries one at most."""
    for taxis in product(range(25), repeat=2):
        for passengers in product(range(4), repeat=2):
            if taxis[0] != taxis[1] and passengers not in ((1, 1), (2, 2)):
                yield taxis, passengers


def test_there_are_as_many_states_as_there_should_be():
    assert len(list(list_states())) == 25 * 24 * (16 - 2)


def test_every_action_in_every_state(make_pair):
    pair = make_pair("taxi")
    for state in list_states():
        for agent in (0, 1):
            put(pair, *state)
            pair.observe(agent)
            for action in range(6):
                put(pair, *state)
                pair.move(agent, action)


@pytest.mark.slow
@pytest.mark.parametrize("id", ["taxi", "taxi-single-agent"])
def test_every_joint_action_in_every_state(make_pair, id):
    pair = make_pair(id)
    for state in list_states():
        for first, second in product(range(6), repeat=2):
            put(pair, *state)
            if pair.task.n_agents == 2:
                pair.move_jointly([first, second])
            else:
                pair.observe(0)
                pair.move(0, 6 * first + second)


@pytest.mark.parametrize("id", ["taxi", "taxi-single-agent"])
def test_a_sample_of_states(make_pair, id):
    pair = make_pair(id)
    choices = np.random.default_rng(3)
    for number, state in enumerate(list_states()):
        if number % 7 == 0:
            put(pair, *state)
            pair.observe(pair.task.n_agents - 1)
            for agent in range(pair.task.n_agents):
                pair.move(agent, int(choices.integers(pair.task.n_actions)))
            pair.move_jointly(choices.integers(pair.task.n_actions, size=pair.task.n_agents))


def test_one_taxi_and_three_passengers(make_pair):
    passengers = (("R", "B"), ("R", "G"), ("Y", "B"))
    pair = make_pair("taxi", starts=((0, 0),), passengers=passengers)
    choices = np.random.default_rng(5)
    pair.reset()
    for _ in range(2000):
        pair.observe(0)
        pair.move(0, int(choices.integers(6)))


def test_walls_of_the_map():
    closed = {
        (cell, action)
        for cell in product(range(5), repeat=2)
        for action in ("up", "right", "down", "left")
        if is_walled(cell, action)
    }
    # 20 sides on the rim, and 6 inner walls that close a side of two cells each
    assert len(closed) == 20 + 12
    assert ((0, 1), "right") in closed
    assert ((2, 1), "right") not in closed
    assert ((4, 3), "left") in closed
    assert ((3, 3), "left") in closed
