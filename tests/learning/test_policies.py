"""Choices among allowed actions: exhaustively where they are certain, by frequency elsewhere."""

from itertools import product

import numpy as np
import pytest
from hose_learning.policies import (
    compute_best,
    count_allowed,
    draw_allowed,
    draw_soft_max,
    find_allowed,
    find_lowest_bit,
)
from scipy.stats import chisquare

N = 4
SETS = range(1, 2**N)
LEAST_P = 1e-3
DRAWS = 4000


def list_bits(bits):
    return [k for k in range(62) if bits >> k & 1]


def make_stream(seed=7):
    return np.array([seed], np.uint64)


@pytest.mark.parametrize("allowed", [*SETS, 1 << 61, (1 << 62) - 1, 0b1010 << 40])
def test_the_allowed_actions_are_numbered(allowed):
    actions = list_bits(allowed)
    assert count_allowed(allowed) == len(actions)
    assert [find_allowed(allowed, k) for k in range(len(actions))] == actions
    assert find_lowest_bit(allowed) == actions[0]


def test_nothing_is_counted_as_none():
    assert count_allowed(0) == 0


@pytest.mark.parametrize("allowed", SETS)
def test_the_best_of_every_small_table(allowed):
    for scores in product((-np.inf, -1.0, 0.0, 2.5), repeat=N):
        best = max(scores[k] for k in list_bits(allowed))
        expected = [k for k in list_bits(allowed) if scores[k] == best]
        assert list_bits(compute_best(np.array(scores), allowed)) == expected


@pytest.mark.parametrize("allowed", SETS)
def test_all_allowed_actions_are_equally_likely(allowed):
    stream = make_stream()
    drawn = np.bincount([draw_allowed(allowed, stream) for _ in range(DRAWS)], minlength=N)
    actions = list_bits(allowed)
    assert drawn[actions].sum() == DRAWS
    if len(actions) > 1:
        assert chisquare(drawn[actions]).pvalue > LEAST_P


def test_a_choice_of_one_draws_nothing():
    stream = make_stream()
    assert draw_allowed(0b0100, stream) == 2
    assert stream == make_stream()


@pytest.mark.parametrize("temperature", [0.5, 2.0, 50.0])
@pytest.mark.parametrize("allowed", [0b1111, 0b1011, 0b0110, 0b1000])
def test_soft_max_draws_by_equation_3_5(allowed, temperature):
    scores, stream = np.array([1.0, -0.5, 2.0, 1.5]), make_stream()
    drawn = np.zeros(N, int)
    for _ in range(DRAWS):
        drawn[draw_soft_max(scores.copy(), allowed, temperature, stream)] += 1
    actions = list_bits(allowed)
    assert drawn[actions].sum() == DRAWS
    weights = np.exp(scores[actions] / temperature)
    if len(actions) > 1:
        assert chisquare(drawn[actions], DRAWS * weights / weights.sum()).pvalue > LEAST_P


@pytest.mark.parametrize("scores", [[1e9, -1e9, 1e9 - 1, 0.0], [-1e300, -2e300, -3e300, -1e301]])
def test_soft_max_of_scores_far_apart_is_the_best(scores):
    stream = make_stream()
    for _ in range(50):
        assert draw_soft_max(np.array(scores), 0b1111, 1e-3, stream) == 0
        assert draw_soft_max(np.array(scores), 0b1110, 1e-3, stream) == np.argmax(scores[1:]) + 1
