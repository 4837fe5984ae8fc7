"""Optimistic replacing traces: by hand, against a list, and without traces."""

from typing import NamedTuple

import numpy as np
import pytest
from hose_learning import rules
from hose_learning.learners import round_robin, traces
from hose_learning.records import Memory
from hypothesis import given
from hypothesis import strategies as st

from hose_mj.errors import InputError
from hose_mj.tasks.registry import make_task

GAMMA, ALPHA, LAMBDA = 0.9, 0.5, 0.8
PLAIN = {"values": "monolithic", "vetoes": "none"}


class Optimistic(NamedTuple):
    """The rule of Algorithm 6.3, but it learns from good surprises alone."""

    discounts: np.ndarray


def learn_if_better(learner, memory, agent, following):
    old = memory.table.rows[memory.last_keys[agent, 0], memory.actions[agent]]
    if memory.rewards[agent, 0] + following - old > 0.0:
        round_robin.learn(learner, memory, agent, 0, following)


@rules.on_observe.register(Optimistic)
def on_observe(rule, learner, memory, agent):
    if memory.steps_since_action[agent] >= 0:
        highest = memory.table.rows[memory.keys[agent, 0]].max()
        learn_if_better(learner, memory, agent, rule.discounts[-1] * highest)


@rules.accumulate.register(Optimistic)
def accumulate(rule, learner, memory, agent, action, events):
    round_robin.add_rewards(rule, learner, memory, agent, events)


@rules.end_episode.register(Optimistic)
def end_episode(rule, learner, memory, is_over):
    for agent in range(len(memory.steps_since_action)):
        if is_over and memory.steps_since_action[agent] >= 0:
            learn_if_better(learner, memory, agent, 0.0)
    memory.steps_since_action[:] = -1


@pytest.mark.parametrize("settings", [{}, {"n_cells": 5, "goal": 3, "starts": (0, 4)}])
def test_without_traces_it_is_6_3_that_only_learns_when_it_is_better(make_training, settings):
    task = make_task("corridor", **settings)
    common = {**PLAIN, "seed": 2, "epsilon": 0.5, "learning_rate": ALPHA}
    plain = make_training(task, "d-rr-ql", **common)
    plain.learner = plain.learner._replace(rule=Optimistic(plain.learner.rule.discounts))
    traced = make_training(task, "d-rr-ql-traces", **common, options={"trace_decay": 0.0})
    for _ in range(30):
        plain.advance(moves=100)
        traced.advance(moves=100)
        assert (plain.memory.table.rows == traced.memory.table.rows).all()
        assert (plain.memory.state == traced.memory.state).all()
    assert plain.memory.table.rows.max() > 40.0


def test_the_first_success_by_hand(make_chain, make_training):
    """Five forced steps, agent 0's first; each values what it did d own moves before the end.

    Agent 0 is surprised by 100 after its own last step, agent 1 by gamma 100 in its last cycle.
    """
    task = make_chain(moves=(1,))
    options = {"trace_decay": LAMBDA}
    training = make_training(task, "d-rr-ql-traces", **PLAIN, learning_rate=ALPHA, options=options)
    training.advance(episodes=1)
    first, second = training.memory.table.rows[:12, 0].reshape(2, 6)
    share = GAMMA**2 * LAMBDA
    assert first == pytest.approx([50 * share**2, 0, 50 * share, 0, 50, 0])
    assert second == pytest.approx([0, 45 * share, 0, 45, 0, 0])
    assert training.memory.own.lengths.tolist() == [0, 0]


def test_only_the_last_moves_are_kept(make_chain, make_training):
    task = make_chain(moves=(1,))
    options = {"trace_decay": LAMBDA, "n_kept": 2}
    training = make_training(task, "d-rr-ql-traces", **PLAIN, learning_rate=ALPHA, options=options)
    training.advance(episodes=1)
    first = training.memory.table.rows[:6, 0]
    assert first == pytest.approx([0, 0, 50 * GAMMA**2 * LAMBDA, 0, 50, 0])


def test_a_bad_surprise_teaches_nothing(make_training):
    task = make_task("corridor", goal_reward=0.0)
    training = make_training(task, "d-rr-ql-traces", **PLAIN)
    training.advance(moves=500)
    assert training.memory.event_counts[0] > 50
    assert not training.memory.table.rows.any()


moves = st.lists(st.tuples(st.integers(0, 2), st.integers(0, 1)), max_size=20)


@given(moves=moves, n_kept=st.integers(1, 5))
def test_a_trail_is_the_list_of_different_moves_the_latest_first(moves, n_kept):
    trail = traces.EligibilityTrace(
        keys=np.zeros((1, n_kept, 1), np.int64),
        actions=np.zeros((1, n_kept), np.int64),
        ages=np.zeros((1, n_kept), np.int64),
        lengths=np.zeros(1, np.int64),
    )
    blank = dict.fromkeys(Memory._fields)
    expected = []
    for time, (key, action) in enumerate(moves):
        last = {"last_keys": np.array([[key]]), "actions": np.array([action])}
        traces.remember(Memory(**{**blank, **last, "own": trail}), 0)
        expected = [(key, action, time), *(m for m in expected if m[:2] != (key, action))]
        expected = expected[:n_kept]
        n = trail.lengths[0]
        found = zip(
            trail.keys[0, :n, 0], trail.actions[0, :n], time - trail.ages[0, :n], strict=True
        )
        assert list(found) == expected


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"trace_decay": 1.5}, "trace_decay is 1.5"),
        ({"n_kept": 0}, "n_kept is 0"),
        ({"n_kept": 10**6}, "n_kept is 1000000"),
        ({"n_kept": "many"}, "a number"),
        ({"lambda": 0.9}, "one of trace_decay, n_kept"),
    ],
)
def test_wrong_options(make_training, options, message):
    with pytest.raises(InputError, match=message):
        make_training(make_task("corridor"), "d-rr-ql-traces", options=options)
