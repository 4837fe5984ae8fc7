"""Intervals against their formulas."""

import numpy as np
import pytest
from hose_learning.study.statistics import compute_mean_interval, compute_rate_interval

Z = 1.959963984540054


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (3, 10), (10, 10), (950, 1000)])
def test_wilsons_interval_is_where_its_score_test_is_indifferent(successes, trials):
    for bound in compute_rate_interval(successes, trials):
        if 0.0 < bound < 1.0:
            score = abs(successes / trials - bound) / np.sqrt(bound * (1.0 - bound) / trials)
            assert score == pytest.approx(Z)
    low, high = compute_rate_interval(successes, trials)
    assert low <= successes / trials <= high
    assert high - low > 0.0


def test_nothing_is_known_without_trials():
    assert compute_rate_interval(0, 0) == (0.0, 1.0)


def test_students_interval():
    # t of 0.975 with 4 degrees of freedom is 2.776445; the standard error of 1 .. 5 is 1 / sqrt 2.
    low, high = compute_mean_interval([1, 2, 3, 4, 5])
    half = 2.7764451051977987 / np.sqrt(2.0)
    assert (low, high) == pytest.approx((3.0 - half, 3.0 + half))


@pytest.mark.parametrize("values", [[4.0], [2.0, 2.0, 2.0]])
def test_without_spread_it_is_the_mean(values):
    assert compute_mean_interval(values) == (values[0], values[0])
