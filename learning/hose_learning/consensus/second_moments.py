"""How far clocks in consensus are apart in the end: the exact second moments of equation 6.7.

Messages are lost and delayed independently, so mean and second moments of all clocks follow linear
recursions. No random number is drawn here.
"""

from __future__ import annotations

import numpy as np

from hose_learning.consensus.clocks import ConsensusSettings, Floats


def compute_contraction(n_agents: int, loss: float) -> float:
    """Returns the factor by which a round shrinks the mean squared disagreement, without delay.

    With q = 1 - p the share of messages that arrive and x_i the clocks about their mean, a round
    leaves E[x_i'] = p x_i, and adds to each the variance p q / N^2 sum_j (x_i - x_j)^2. Summed up,
    and less the variance of the mean, the sum of squares shrinks by

        lambda = p^2 + 2 p q (N - 1) / N^2.
    """
    return loss**2 + 2.0 * loss * (1.0 - loss) * (n_agents - 1) / n_agents**2


def compute_speed(settings: ConsensusSettings) -> float:
    """Returns how fast the agreed clock runs without drift, in turns per unit of time.

    A message of age d shows a clock d steps ago, and so holds its reader back:
    v' h = v h - q (N - 1) / N (delay / 2) v' h.
    """
    held = (1.0 - settings.loss) * (settings.n_agents - 1) / settings.n_agents
    return 1.0 / (1.0 + held * settings.delay / 2.0)


def compute_disagreement(settings: ConsensusSettings, rates: Floats, n_rounds: int = 400) -> float:
    """Returns the standard deviation of the clocks about their common mean, in turns.

    It is the square root of E[sum_i (xi_i - mean)^2] / N after `n_rounds` rounds from equal clocks,
    agents that act left aside; it settles within some tens of rounds. Without delay the value is

        sqrt((1 + p) / ((1 - p) (1 - lambda))) h std(v_i).

    Args:
        settings: the network.
        rates: v_i of the clocks (N,).
        n_rounds: number of rounds.
    """
    n, kept = settings.n_agents, settings.delay + 1
    arrive = 1.0 - settings.loss
    # Clock j of age d stands at place d N + j of the vector of all kept clocks.
    step = np.eye(n * kept, k=-n)
    step[:n, :n] = np.eye(n) * (1.0 - arrive * (n - 1) / n)
    others = (np.ones((n, n)) - np.eye(n)) * arrive / (n * kept)
    for age in range(kept):
        step[:n, age * n : (age + 1) * n] += others
    push = np.zeros(n * kept)
    push[:n] = rates * settings.round_time
    mean, second = np.zeros(n * kept), np.zeros((n * kept, n * kept))
    for _ in range(n_rounds):
        moved = step @ mean
        noise = _compute_noise(settings, second)
        second = step @ second @ step.T + np.outer(moved, push) + np.outer(push, moved)
        second += np.outer(push, push)
        second[np.arange(n), np.arange(n)] += noise
        mean = moved + push
    newest = second[:n, :n]
    return float(np.sqrt(max((np.trace(newest) - newest.sum() / n) / n, 0.0)))


def _compute_noise(settings: ConsensusSettings, second: Floats) -> Floats:
    """Returns the variance that chance adds to each clock in a round (N,).

    Agent i adds up b (xi_j[age] - xi_i) / N over the others, with b = 1 where a message arrived;
    the variance of one term, given the clocks, is q E_age[D^2] - q^2 E_age[D]^2.
    """
    n, kept = settings.n_agents, settings.delay + 1
    arrive = 1.0 - settings.loss
    own = np.diag(second)[:n]
    told = np.diag(second).reshape(kept, n).mean(axis=0)
    cross = second[:n].reshape(n, kept, n).mean(axis=1)
    square = own[:, None] - 2.0 * cross + told[None, :]
    blocks = second.reshape(kept, n, kept, n).mean(axis=(0, 2))
    mean_square = own[:, None] - 2.0 * cross + np.diag(blocks)[None, :]
    terms = arrive * square - arrive**2 * mean_square
    np.fill_diagonal(terms, 0.0)
    return np.asarray(terms.sum(axis=1) / n**2)
