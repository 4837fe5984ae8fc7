"""The measures of chapter 6 on tasks where they are known."""

import pytest
from hose_learning.study.jobs import measure

from hose_mj.tasks.registry import make_task


def test_a_forced_way_is_measured_exactly(make_chain, make_training):
    """Five moves to the goal, from the first episode on, in training and test."""
    training = make_training(make_chain(moves=(1,)), "d-rr-ql", values="monolithic", vetoes="none")
    found = measure(training, max_steps=23, test_every=2, manner="turns")
    assert (found.n_g, found.n_f, found.s_f, found.s_b) == (5, 10, 5, 5)
    assert (found.steps, found.n_tests, found.n_valid) == (23, 3, 3)


def test_a_goal_that_is_never_found(make_chain, make_training):
    training = make_training(make_chain(moves=(-1,), start=2), "q-learning")
    found = measure(training, max_steps=10**4, max_episodes=3, test_every=2, manner="turns")
    assert (found.n_g, found.n_f, found.s_f, found.s_b) == (None, None, None, None)
    assert (found.steps, found.n_tests, found.n_valid) == (3000, 2, 0)


def test_steps_are_those_of_the_first_success(make_training):
    task = make_task("corridor", n_cells=7, goal=3, starts=(0, 6), step_limit=8)
    settings = {"values": "monolithic", "vetoes": "none", "epsilon": 0.5}
    training, other = (make_training(task, "d-rr-ql", seed=1, **settings) for _ in range(2))
    found = measure(training, max_steps=6000, test_every=10)
    ended = other.advance(moves=6000)
    first = int(ended.find_successes(task).argmax())
    assert found.n_g == ended.moves[: first + 1].sum()
    assert first > 0
    assert found.n_g <= found.n_f
    assert found.s_b == 3  # three joint steps, from cell 0 or 6 to 3
    assert found.s_b <= found.s_f
    assert 0 < found.n_valid <= found.n_tests == pytest.approx(len(ended) / 10, abs=1)
