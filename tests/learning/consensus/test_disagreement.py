from itertools import product

import numpy as np
import pytest
from hose_learning.consensus import (
    ConsensusSettings,
    Messages,
    compute_clocks,
    compute_disagreement,
    compute_speed,
    draw_rates,
    run_clocks,
)


def compute_contraction(n_agents, loss):
    """What a round leaves of the mean squared disagreement, without delay.

    With q = 1 - p the share of messages that arrive and x_i the clocks about their mean, a round
    leaves E[x_i'] = p x_i, and adds to each the variance p q / N^2 sum_j (x_i - x_j)^2. Summed up,
    and less the variance of the mean, the sum of squares shrinks by this factor.
    """
    return loss**2 + 2.0 * loss * (1.0 - loss) * (n_agents - 1) / n_agents**2


@pytest.mark.parametrize("loss", [0.0, 0.2, 0.5])
def test_the_contraction_is_the_mean_over_all_patterns_of_loss(loss):
    n = 3
    clocks = np.array([[0.0, 1.0, 5.0]])
    pairs = [(i, j) for i in range(n) for j in range(n) if i != j]
    mean = 0.0
    for pattern in product((False, True), repeat=len(pairs)):
        heard = np.zeros((n, n), bool)
        for pair, arrives in zip(pairs, pattern, strict=True):
            heard[pair] = arrives
        following = compute_clocks(clocks, Messages(heard, np.zeros((n, n), int)), np.zeros(n))
        mean += (
            loss ** (~heard[tuple(zip(*pairs, strict=True))]).sum()
            * (1 - loss) ** heard.sum()
            * following.var()
        )
    assert mean / clocks.var() == pytest.approx(compute_contraction(n, loss), abs=1e-14)


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.5, 0.8])
@pytest.mark.parametrize("n_agents", [2, 5])
def test_without_delay_the_disagreement_is_the_closed_form(n_agents, loss):
    settings = ConsensusSettings(n_agents=n_agents, loss=loss, delay=0)
    rates = draw_rates(settings, np.random.default_rng(2))
    shrinks = compute_contraction(n_agents, loss)
    closed = np.sqrt((1 + loss) / ((1 - loss) * (1 - shrinks))) * 0.02 * rates.std()
    assert compute_disagreement(settings, rates) == pytest.approx(closed, rel=1e-4)


@pytest.mark.parametrize(("loss", "delay"), [(0.0, 0), (0.5, 0), (0.1, 1), (0.5, 3)])
def test_the_simulated_clocks_have_these_moments(loss, delay):
    settings = ConsensusSettings(loss=loss, delay=delay, offset=0.0)
    record = run_clocks(settings, np.random.default_rng(1), 8000)
    settled = record.clocks[200:]
    exact = compute_disagreement(settings, record.rates)
    assert np.sqrt(settled.var(axis=1).mean()) == pytest.approx(exact, rel=0.03)
    speed = np.diff(settled.mean(axis=1)[[0, -1]])[0] / (len(settled) - 1) / 0.02
    assert speed == pytest.approx(compute_speed(settings), rel=settings.drift)


def test_two_rounds_by_hand():
    # From equal clocks a round adds what the rates differ by; no chance is in it yet.
    settings = ConsensusSettings(n_agents=2, loss=0.5, delay=0)
    rates = np.array([1.01, 0.99])
    assert compute_disagreement(settings, rates, n_rounds=1) == pytest.approx(0.02 * 0.01)
    # Then x = +-2e-4, and each clock hears the other or not: the four cases of the second round.
    x, u = 2e-4, 2e-4
    cases = [(x, -x), (0.0, -x), (x, 0.0), (0.0, 0.0)]
    squares = [((a + u) - (b - u)) ** 2 / 4 for a, b in cases]
    assert compute_disagreement(settings, rates, n_rounds=2) == pytest.approx(
        np.sqrt(np.mean(squares)), rel=1e-6
    )


def test_what_is_late_slows_the_common_clock():
    assert compute_speed(ConsensusSettings(delay=0)) == 1.0
    settings = ConsensusSettings(n_agents=2, loss=0.0, delay=2)
    assert compute_speed(settings) == pytest.approx(1 / 1.5)
