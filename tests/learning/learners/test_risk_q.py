"""Geibel's risk: the probability of breaking a constraint under the policy of least risk."""

import numpy as np
import pytest
from hose_learning.learners.risk_q import GOAL, RISK
from hose_learning.records import XI

from hose_mj.errors import InputError
from hose_mj.tasks.exact import enumerate_turns


def write_out(task):
    return enumerate_turns(task, [task.reset(np.array([3], np.uint64))])


def test_the_risk_is_the_probability_of_a_fall(make_chain, make_training, read_values, solve_cycle):
    """Beside a teammate that walks by chance even the safest steps may end in a fall."""
    task = make_chain(moves=(-2, 1), n_cells=7, start=3, cliff=True)
    training = make_training(
        task, "risk-q", options={"settle_episodes": 10**9}, learning_rate_decay=2e-3
    )
    training.advance(moves=60_000)
    model = write_out(task)
    learned = read_values(training, model, RISK)
    falls = (model.events >> 1 & 1).astype(float)
    uniform = np.full(falls.shape, 0.5)

    def choose(risks):
        return risks.min(axis=1)

    mine, expected = solve_cycle(model, 0, (1.0, 1.0, 1.0), uniform, falls, choose=choose)
    assert learned[mine] == pytest.approx(expected, abs=0.06)
    assert ((expected > 0.2) & (expected < 0.8)).any(axis=1).all()
    # The goal's values are those of the same policy, for which the discounts are gamma^k.
    safest = np.zeros(len(model.states), np.int64)
    safest[mine] = expected.argmin(axis=1)

    def follow(values):
        return np.take_along_axis(values, safest[:, None], axis=1)[:, 0]

    discounts = (1.0, 0.9, 0.81)
    mine, expected = solve_cycle(model, 0, discounts, uniform, choose=follow)
    assert read_values(training, model, GOAL)[mine] == pytest.approx(expected, abs=2.0)


def test_without_chance_a_risk_is_0_or_1(make_training, make_line, read_values):
    task = make_line(n_robots=1, hose_length=2)
    training = make_training(task, "risk-q", learning_rate=1.0)
    training.advance(moves=8000)
    model = write_out(task)
    breaks = (model.events & task.kernel.violations) != 0
    assert breaks.any()
    assert (read_values(training, model, RISK) == breaks).all()


def test_the_weight_of_the_goal_rises_once_the_risk_has_settled(make_chain, make_training):
    task = make_chain(n_agents=1, moves=(1,), n_cells=3)
    options = {"settle_episodes": 10, "xi_step": 0.25, "xi_most": 1.5}
    training = make_training(task, "risk-q", options=options)
    for episode in range(1, 25):
        training.advance(episodes=1)
        assert training.memory.numbers[XI] == min(0.25 * max(0, episode - 10), 1.5)


def test_the_weight_of_the_goal_falls_where_the_risk_is_above_its_bound(make_chain, make_training):
    """A forced fall: the measured risk is 0, 1, 1, .. and its mean 1 - 0.99^(n - 1)."""
    task = make_chain(n_agents=1, moves=(-1,), n_cells=3, start=1, cliff=True)
    options = {"settle_episodes": 0, "xi_step": 1.0, "xi_most": 1e6, "risk_bound": 0.1}
    training = make_training(task, "risk-q", options=options, learning_rate=1.0)
    xi = 0.0
    for episode in range(40):
        training.advance(episodes=1)
        mean = 1.0 - 0.99**episode
        assert training.memory.own.risk == pytest.approx([mean, float(episode > 0)])
        xi = max(xi + (1.0 if mean <= 0.1 else -1.0), 0.0)
        assert training.memory.numbers[XI] == xi
    assert xi == 0.0


def test_one_value_module_alone(make_training, make_line):
    with pytest.raises(InputError, match="one value module"):
        make_training(make_line(), "risk-q", vetoes="thresholds")
    with pytest.raises(InputError, match="risk_bound is 2"):
        make_training(make_line(), "risk-q", options={"risk_bound": 2})
