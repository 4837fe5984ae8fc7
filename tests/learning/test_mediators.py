"""Mediators and thresholds against numpy's brute force."""

from collections import namedtuple

import numpy as np
import pytest
from hose_learning.mediators import MEDIATORS, compute_above_thresholds, compute_highest, mediate
from hose_learning.tables import make_table

N_AGENTS, N_MODULES, N_STATES, N_ACTIONS = 2, 3, 5, 6
FakeLearner = namedtuple("FakeLearner", "bases mediator thresholds")
FakeMemory = namedtuple("FakeMemory", "table keys scores")


def compute_scores(mediator, values):
    """Scores of the actions by the values of all modules (n_modules, n_actions)."""
    if mediator == "best-happiness":
        return values.max(axis=0)
    if mediator == "worst-unhappiness":
        return -(values.max(axis=1, keepdims=True) - values).max(axis=0)
    return values.sum(axis=0)


@pytest.fixture(params=range(20))
def parts(request):
    """Values of all modules in all states, and what each agent sees."""
    rng = np.random.default_rng(request.param)
    values = rng.integers(-4, 5, (N_MODULES, N_STATES, N_ACTIONS)).astype(float)
    seen = rng.integers(0, N_STATES, (N_AGENTS, N_MODULES))
    table = make_table(N_MODULES * N_STATES, N_ACTIONS, float)
    table.rows[:-1] = values.reshape(-1, N_ACTIONS)
    memory = FakeMemory(table, seen + N_STATES * np.arange(N_MODULES), np.full(N_ACTIONS, np.nan))
    return values, seen, memory


@pytest.mark.parametrize("mediator", MEDIATORS)
def test_a_mediator_scores_as_its_formula(parts, mediator):
    values, seen, memory = parts
    learner = FakeLearner(np.zeros((N_MODULES, N_AGENTS)), MEDIATORS[mediator], None)
    for agent in range(N_AGENTS):
        mediate(learner, memory, agent)
        expected = compute_scores(mediator, values[np.arange(N_MODULES), seen[agent]])
        assert memory.scores.tolist() == expected.tolist()


def test_mediators_differ():
    """Each of three actions is what one mediator prefers."""
    values = np.array([[9.0, 4.0, 6.0], [-6.0, 0.0, -1.0], [0.0, 3.0, 0.0]])
    names = ("greatest-mass", "best-happiness", "worst-unhappiness")
    scores = [compute_scores(name, values) for name in names]
    assert [int(np.argmax(s)) for s in scores] == [1, 0, 2]
    table = make_table(3, 3, float)
    table.rows[:-1] = values
    memory = FakeMemory(table, np.array([[0, 1, 2]]), np.zeros(3))
    for name, expected in zip(names, scores, strict=True):
        mediate(FakeLearner(np.zeros((3, 1)), MEDIATORS[name], None), memory, 0)
        assert memory.scores.tolist() == expected.tolist()


def test_thresholds_are_definition_4(parts):
    values, seen, memory = parts
    thresholds = np.array([-1.0, -np.inf, 0.0])
    learner = FakeLearner(np.zeros((N_MODULES, N_AGENTS)), 0, thresholds)
    for agent in range(N_AGENTS):
        above = compute_above_thresholds(learner, memory, agent, N_ACTIONS)
        own = values[np.arange(N_MODULES), seen[agent]]
        safe = (own >= thresholds[:, None]).all(axis=0)
        assert [above >> a & 1 for a in range(N_ACTIONS)] == safe.tolist()


def test_the_highest_of_a_row():
    assert compute_highest(np.array([[5.0, 9.0, -1.0], [-3.0, -2.0, -4.0]]), 1) == -2.0
