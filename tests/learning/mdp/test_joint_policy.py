"""Composed joint moves against Example 1, brute force over eqs 6.5-6.6, and a stochastic task."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
import pytest
from hose_learning.learners import catalog
from hose_learning.mdp.joint_policy import (
    NOBODY,
    Estimates,
    choose,
    compose,
    count_fewest_moves,
    estimate,
    find_idle,
    make_evaluate,
    make_key,
    play_composed,
)
from hose_learning.settings import Exploration
from hose_learning.study.training import Training

from hose_mj.tasks import kernels
from hose_mj.tasks.exact import OVER, enumerate_joint, enumerate_turns, solve
from hose_mj.tasks.kernels import HEADER, TURN, begin, end_turn
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import draw_unit, make_stream
from hose_mj.tasks.task import Task
from hose_mj.tasks.variables import Variable

GAMMA = 0.9
LEFT, RIGHT, NONE = 0, 1, 2
GOAL_EVENT = 8
"""Of the line task."""


class Exact:
    """A deterministic task written out: exact Q-values, and estimates as all moves would leave."""

    def __init__(self, task, start):
        self.task = task
        self.model = enumerate_turns(task, [start])
        movers = self.model.turns
        self.rewards = self.model.rewards[np.arange(len(movers)), :, movers]
        self.q = solve(self.model, self.rewards, GAMMA)
        self.keys = [make_key(state) for state in self.model.states]
        self.numbers = {key: number for number, key in enumerate(self.keys)}
        self.estimates = [Estimates() for _ in task.agents]
        for number, action in product(range(len(self.keys)), range(task.n_actions)):
            self.estimates[movers[number]].note(
                self.keys[number],
                action,
                self.rewards[number, action],
                self.follow(number, action),
            )

    def follow(self, number, action):
        following = self.model.successors[number, action]
        if following != OVER:
            return self.keys[following]
        state = self.model.states[number].copy()
        kernels.apply(self.task.kernel, state, int(state[TURN]), action)
        return make_key(state, is_over=True)

    def evaluate(self, agent, key):
        assert key[TURN] == agent
        return dict(enumerate(self.q[self.numbers[key]].tolist()))

    def sum_up(self, number, actions):
        """Eqs 6.5 and 6.6 for a joint action, all rewards counted."""
        total = 0.0
        for place, action in enumerate(actions):
            total += GAMMA**place * self.rewards[number, action]
            number = self.model.successors[number, action]
            if number == OVER:
                return total
        return total + GAMMA ** len(actions) * self.q[number].max()

    def sum_penalties(self, number, actions):
        """The part of eq. 6.6 that is negative rewards of the cycle."""
        total = 0.0
        for place, action in enumerate(actions):
            if number != OVER:
                total += GAMMA**place * min(0.0, self.rewards[number, action])
                number = self.model.successors[number, action]
        return total


def make_start(task, seed=3):
    return task.reset(make_stream(np.random.default_rng(seed)))


@pytest.mark.parametrize(
    ("id", "settings", "least"),
    [
        ("corridor", {}, 1),
        ("corridor", {"goal_ends": "move"}, 1),
        ("corridor", {"n_cells": 6, "goal": 3, "starts": (0, 1)}, 3),
        ("line", {"n_robots": 2, "half_width": 2, "hose_length": 4, "goal": (1, 2)}, 30),
        ("line", {"n_robots": 3, "half_width": 1, "hose_length": 6, "goal": (1, 1)}, 50),
    ],
)
def test_the_chain_is_the_maximum_of_6_5_and_6_6(id, settings, least):
    task = make_task(id, **settings)
    exact = Exact(task, make_start(task))
    starts = [number for number, key in enumerate(exact.keys) if key[TURN] == 0]
    assert len(starts) >= least
    for number in starts:
        composed = compose(exact.keys[number], exact.estimates, exact.evaluate, GAMMA, NONE)
        every = product(range(task.n_actions), repeat=task.n_agents)
        best = max(exact.sum_up(number, actions) for actions in every)
        assert exact.sum_up(number, composed.actions) == pytest.approx(best, abs=1e-9)
        missing = exact.sum_penalties(number, composed.actions)  # R^ holds what is positive
        assert composed.value + missing == pytest.approx(best, abs=1e-9)


# Thesis Table 6.2: the cells that follow (a_1, a_2) in turns, and the positive part of the reward,
# discounted within the cycle; {none, left} is gamma 100.
TABLE_62 = {
    (LEFT, LEFT): ((0, 1), GAMMA * 100),
    (LEFT, RIGHT): ((0, 2), 0),
    (LEFT, NONE): ((0, 2), 0),
    (RIGHT, LEFT): ((1, 2), 100),
    (RIGHT, RIGHT): ((1, 2), 100),
    (RIGHT, NONE): ((1, 2), 100),
    (NONE, LEFT): ((0, 1), GAMMA * 100),
    (NONE, RIGHT): ((0, 2), 0),
    (NONE, NONE): ((0, 2), 0),
}


@pytest.mark.parametrize("actions", TABLE_62)
def test_messages_predict_table_6_2(actions):
    """Agents that can do nothing else send on what Table 6.2 says."""
    task = make_task("corridor")
    exact = Exact(task, make_start(task))
    cells, reward = TABLE_62[actions]
    composed = compose(
        exact.keys[0], exact.estimates, lambda agent, key: {actions[agent]: 0.0}, GAMMA, NONE
    )
    assert composed.actions == actions
    ((last, probability),) = composed.messages[-1].items()
    assert (last[HEADER:], probability) == (cells, 1.0)
    assert (last[TURN] == NOBODY) == (1 in cells)
    assert composed.value == pytest.approx(reward)


def test_example_1():
    """{right, none} has the highest return of Table 6.2, and of Table 6.1 when played at once."""
    task = make_task("corridor")
    start = make_start(task)
    exact = Exact(task, start)
    (move,) = play_composed(task, start, exact.estimates, exact.evaluate, GAMMA, 5)
    assert move.composition.actions == (RIGHT, NONE)
    assert tuple(move.state[task.layout["robots"]]) == (1, 2)
    assert task.name_events(move.events) == ("goal", "done")
    joint = enumerate_joint(task, [start])
    assert joint.rewards[0, :, 0].max() == joint.rewards[0, 3 * RIGHT + NONE, 0] == 100


def test_it_goes_on_over_several_joint_moves():
    task = make_task("corridor", n_cells=7, goal=6, starts=(0, 1), goal_ends="move")
    start = make_start(task)
    exact = Exact(task, start)
    moves = play_composed(task, start, exact.estimates, exact.evaluate, GAMMA, 20)
    model = enumerate_joint(task, [start])
    assert len(moves) == count_fewest_moves(model, task.kernel.success) == 5
    assert moves[-1].events & task.kernel.success
    assert len(play_composed(task, start, exact.estimates, exact.evaluate, GAMMA, 2)) == 2


def test_learned_tables_compose():
    task = make_task("corridor")
    settings = catalog.make_settings("d-rr-ql", task, exploration=Exploration(per_episode=0.005))
    training = Training(task, "d-rr-ql", settings, np.random.default_rng(0), compiled=False)
    training.advance(episodes=400)
    evaluate = make_evaluate(training)
    start = make_start(task)
    assert RIGHT in evaluate(0, make_key(start))
    assert RIGHT not in evaluate(1, (1, 0, 0, 2))  # a wall: vetoed
    estimates = estimate(task, evaluate, 500, np.random.default_rng(1))
    (move,) = play_composed(task, start, estimates, evaluate, settings.discount, 5)
    assert move.composition.actions in ((RIGHT, NONE), (NONE, LEFT))
    assert move.events & task.kernel.success


# A task with chance in it: each move from a place leads to one of several, everything else stays.
START, FORK, LEFT_DOOR, RIGHT_DOOR, BRIDGE, GOAL, PIT = range(7)
MOVES = {
    (START, LEFT): {LEFT_DOOR: 0.6, RIGHT_DOOR: 0.4},
    (LEFT_DOOR, LEFT): {GOAL: 1.0},
    (LEFT_DOOR, RIGHT): {GOAL: 0.9, PIT: 0.1},
    (RIGHT_DOOR, LEFT): {PIT: 1.0},
    (RIGHT_DOOR, RIGHT): {GOAL: 1.0},
    (FORK, LEFT): {GOAL: 0.5, RIGHT_DOOR: 0.5},
}
EVENTS = {GOAL: 1, PIT: 2}


@dataclass(eq=False)
class Doors:
    """The record of the task, in plain Python."""

    moves: dict[Any, Any]
    n_agents: int = 2
    n_actions: int = 3
    step_limit: int = 50
    terminal: int = 3
    violations: int = 2
    success: int = 1
    shared: int = 3
    reward_table: Any = field(default_factory=lambda: np.array([[0.0], [100.0], [-10.0], [90.0]]))
    stream: Any = field(default_factory=lambda: np.array([7], np.uint64))


@kernels.reset.register(Doors)
def reset_doors(record, state, stream):
    begin(state)
    state[HEADER] = int(draw_unit(stream) * GOAL)


@kernels.apply.register(Doors)
def apply_doors(record, state, agent, action):
    end_turn(record, state, agent)
    chance = draw_unit(record.stream)
    for place, share in record.moves.get((int(state[HEADER]), action), {}).items():
        chance -= share
        if chance < 0.0:
            state[HEADER] = place
            return EVENTS.get(place, 0)
    return 0


@kernels.observe.register(Doors)
def observe_doors(record, state, agent, values):
    values[0] = state[HEADER]


def make_doors(bridge):
    moves = {**MOVES, (START, RIGHT): {BRIDGE: 1.0}}
    moves |= {(BRIDGE, action): {GOAL: bridge, PIT: 1.0 - bridge} for action in (LEFT, RIGHT)}
    return Task(
        id="doors",
        agents=("one", "two"),
        action_names=("left", "right", "none"),
        variables=(Variable("place", 7, "where both are"),),
        rewards=("goal",),
        events=("goal", "pit"),
        schedule="turns",
        settings=None,
        kernel=Doors(moves),
        layout={"place": slice(HEADER, HEADER + 1)},
        state_size=HEADER + 1,
    )


class ExactDoors:
    """The same written out, as `Exact` does for tasks without chance."""

    def __init__(self, task):
        self.moves = task.kernel.moves
        self.q = np.zeros((GOAL, 3))
        for _ in range(500):
            self.q = np.array([[self.look(x, a) for a in range(3)] for x in range(GOAL)])
        self.estimates = [Estimates(), Estimates()]
        for agent, x, action in product(range(2), range(GOAL), range(3)):
            for y, share in self.moves.get((x, action), {x: 1.0}).items():
                turn = NOBODY if y in EVENTS else 1 - agent
                for _ in range(round(1000 * share)):
                    reward = 100.0 * (y == GOAL)
                    self.estimates[agent].note((agent, 0, x), action, reward, (turn, 0, y))

    def look(self, x, action):
        following = self.moves.get((x, action), {x: 1.0})
        gains = {GOAL: 100.0, PIT: -10.0}
        return sum(
            share * (gains[y] if y in gains else GAMMA * self.q[y].max())
            for y, share in following.items()
        )

    def evaluate(self, agent, key):
        return dict(enumerate(self.q[key[HEADER]].tolist()))

    def sum_up(self, x, actions):
        """Eqs 6.5 and 6.6 with all rewards."""
        if x in EVENTS or not actions:
            return 0.0 if x in EVENTS else self.q[x].max()
        return sum(
            share * ({GOAL: 100.0, PIT: -10.0}.get(y, 0.0) + GAMMA * self.sum_up(y, actions[1:]))
            for y, share in self.moves.get((x, actions[0]), {x: 1.0}).items()
        )

    def compute_best(self, x):
        return max(product(range(3), repeat=2), key=lambda actions: self.sum_up(x, actions))


def test_an_agent_weighs_all_states_it_may_be_in():
    """The left door is likelier, and left is best there; but right is better on the whole."""
    exact = ExactDoors(make_doors(bridge=0.5))
    composed = compose((0, 0, START), exact.estimates, exact.evaluate, GAMMA, NONE)
    assert composed.messages[1] == pytest.approx({(1, 0, LEFT_DOOR): 0.6, (1, 0, RIGHT_DOOR): 0.4})
    assert exact.q[LEFT_DOOR].argmax() == LEFT
    assert composed.actions == (LEFT, RIGHT) == exact.compute_best(START)
    expected = {(NOBODY, 0, GOAL): 0.6 * 0.9 + 0.4, (NOBODY, 0, PIT): 0.06}
    assert composed.messages[2] == pytest.approx(expected)
    assert composed.value == pytest.approx(GAMMA * 94.0)


def test_where_the_chain_is_not_the_maximum():
    """The first agent relies on what the second would do if it saw the outcome: 90 against 87.

    Eq. 6.5 commits both at once, where the bridge is worth more; the message goes round only once.
    """
    exact = ExactDoors(make_doors(bridge=0.97))
    composed = compose((0, 0, START), exact.estimates, exact.evaluate, GAMMA, NONE)
    assert composed.actions == (LEFT, RIGHT)
    best = exact.compute_best(START)
    assert best[0] == RIGHT
    assert exact.sum_up(START, composed.actions) < exact.sum_up(START, best) < exact.q[START].max()


def test_terminal_entries_stay_and_are_rewarded_once():
    exact = ExactDoors(make_doors(bridge=0.5))
    composed = compose((0, 0, FORK), exact.estimates, exact.evaluate, GAMMA, NONE)
    over = (NOBODY, 0, GOAL)
    assert composed.messages[1] == {over: 0.5, (1, 0, RIGHT_DOOR): 0.5}
    assert composed.actions == (LEFT, RIGHT)  # right for the half that goes on
    assert composed.messages[2] == {over: 1.0}
    assert composed.value == pytest.approx(50.0 + GAMMA * 50.0)


@pytest.mark.parametrize("idle", [NONE, LEFT])
def test_nobody_acts_after_the_end(idle):
    exact = ExactDoors(make_doors(bridge=0.5))
    composed = compose((0, 0, LEFT_DOOR), exact.estimates, exact.evaluate, GAMMA, idle)
    assert composed.actions == (LEFT, idle)
    assert composed.messages[2] == composed.messages[1] == {(NOBODY, 0, GOAL): 1.0}
    assert composed.value == pytest.approx(100.0)


def test_only_what_is_allowed_everywhere_is_chosen():
    known = Estimates()
    for state in ((1, 0, 1), (1, 0, 2)):
        known.note(state, 0, 0.0, state)
    values = {(1, 0, 1): {0: 5.0, 1: 1.0}, (1, 0, 2): {1: 0.0, 2: 9.0}}
    message = {(1, 0, 1): 0.5, (1, 0, 2): 0.5}
    assert choose(1, message, known, lambda agent, s: values[s], idle=2) == 1
    del values[1, 0, 1][1]
    assert choose(1, message, known, lambda agent, s: values[s], idle=2) == 2


def test_estimates_are_shares_of_what_was_seen():
    known = Estimates()
    for following, reward in (((1,), 0.0), ((2,), 3.0), ((2,), 3.0), ((3,), -1.0)):
        known.note((0,), 5, reward, following)
    assert known.predict((0,), 5) == {(1,): 0.25, (2,): 0.5, (3,): 0.25}
    assert [known.reward((k,)) for k in range(4)] == [0.0, 0.0, 3.0, 0.0]
    assert known.predict((0,), 4) == {}
    assert known.knows((0,))
    assert not known.knows((1,))


def test_play_in_turns_estimates_the_chances():
    task = make_doors(bridge=0.5)
    uniform = dict.fromkeys(range(3), 0.0)
    estimates = estimate(task, lambda agent, s: uniform, 8000, np.random.default_rng(2))
    for agent, known in enumerate(estimates):
        for (x, action), shares in task.kernel.moves.items():
            state = (agent, 0, x)
            n = known.counts[state, action].total()
            assert n > 50
            predicted = known.predict(state, action)
            for y, share in shares.items():
                turn = NOBODY if y in EVENTS else 1 - agent
                spread = 4.5 * np.sqrt(share * (1 - share) / n)
                assert abs(predicted[turn, 0, y] - share) <= spread
        assert known.rewards == {(NOBODY, 0, GOAL): 100.0}
    exact = ExactDoors(task)
    composed = compose((0, 0, START), estimates, exact.evaluate, GAMMA, NONE)
    assert composed.actions == (LEFT, RIGHT)


def test_what_only_a_violation_ends_is_told_from_passing_through():
    """The same configuration, once passed through and once the end: two different states."""
    state = np.array([1, 7, 4])
    assert make_key(state) == (1, 0, 4)
    assert make_key(state, is_over=True) == (NOBODY, 0, 4)


def test_fewest_moves():
    nowhere = make_task("line", n_robots=1, half_width=1, hose_length=2, goal="none")
    assert count_fewest_moves(enumerate_joint(nowhere, [make_start(nowhere)]), GOAL_EVENT) is None
    corridor = make_task("corridor", n_cells=9, goal=0, starts=(8, 3))
    model = enumerate_joint(corridor, [make_start(corridor)])
    assert count_fewest_moves(model, corridor.kernel.success) == 3


def test_idle():
    assert find_idle(make_task("corridor")) == NONE
    assert find_idle(make_task("taxi")) == 0
