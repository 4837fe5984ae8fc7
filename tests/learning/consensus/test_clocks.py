import numpy as np
import pytest
from hose_learning.consensus import (
    ConsensusSettings,
    Messages,
    compute_clocks,
    compute_turns,
    count_disorder,
    count_overlaps,
    draw_messages,
    draw_rates,
    run_clocks,
    simulate,
)

from hose_mj.errors import InputError

STEP = 0.02


def hear_all(n_agents, age=0):
    return Messages(~np.eye(n_agents, dtype=bool), np.full((n_agents, n_agents), age))


def test_who_hears_all_takes_the_mean():
    clocks = np.array([[0.0, 1.0, 5.0]])
    following = compute_clocks(clocks, hear_all(3), np.full(3, STEP))
    assert following == pytest.approx([2.0 + STEP] * 3)


def test_who_hears_nobody_counts_alone():
    clocks = np.array([[0.0, 1.0, 5.0]])
    deaf = Messages(np.zeros((3, 3), bool), np.zeros((3, 3), int))
    increments = np.array([0.1, 0.2, 0.3])
    assert compute_clocks(clocks, deaf, increments) == pytest.approx([0.1, 1.2, 5.3])


def test_equation_6_7_for_one_late_message():
    history = np.array([[3.0, 4.0, 5.0], [2.9, 3.8, 4.7]])
    heard, ages = np.zeros((3, 3), bool), np.zeros((3, 3), int)
    heard[0, 2], ages[0, 2] = True, 1  # agent 0 hears what agent 2 said a round ago
    following = compute_clocks(history, Messages(heard, ages), np.full(3, STEP))
    assert following == pytest.approx([3.0 - (3.0 - 4.7) / 3 + STEP, 4.0 + STEP, 5.0 + STEP])


def test_equation_6_8():
    assert compute_turns(np.array([0.0, 0.99, 1.0, 7.5])).tolist() == [0, 0, 1, 7]


def test_no_message_is_lost_without_loss_and_half_of_them_with_half():
    random = np.random.default_rng(0)
    messages = draw_messages(ConsensusSettings(loss=0.0, delay=2), random)
    assert (messages.heard == ~np.eye(4, dtype=bool)).all()
    assert messages.ages.min() >= 0
    assert messages.ages.max() <= 2
    settings = ConsensusSettings(loss=0.5)
    heard = np.mean([draw_messages(settings, random).heard.sum() / 12 for _ in range(2000)])
    assert heard == pytest.approx(0.5, abs=0.015)  # five times sqrt(1/4 / 24,000)


@pytest.mark.parametrize("drift", [0.0, 0.03])
def test_without_loss_the_spread_is_what_a_round_of_drift_makes(drift):
    settings = ConsensusSettings(loss=0.0, delay=0, drift=drift)
    record = run_clocks(settings, np.random.default_rng(3), 50)
    assert record.spreads[1:] == pytest.approx(np.ptp(record.rates) * STEP, abs=1e-12)
    assert np.abs(record.rates - 1.0).max() <= drift


@pytest.mark.parametrize("loss", [0.1, 0.5, 0.9])
def test_equal_clocks_agree_whatever_is_lost(loss):
    settings = ConsensusSettings(loss=loss, delay=0, drift=0.0)
    spreads = run_clocks(settings, np.random.default_rng(4), 600).spreads
    assert spreads[0] > 0.5
    assert (np.diff(spreads) <= 1e-12).all()  # a mean with others never leaves their range
    assert spreads[-1] < 1e-9


@pytest.mark.parametrize("early_finish", [True, False])
@pytest.mark.parametrize("loss", [0.0, 0.1, 0.5])
@pytest.mark.parametrize(("n_agents", "delay", "drift"), [(2, 0, 0.0), (4, 1, 0.02), (7, 3, 0.1)])
def test_turns_are_taken_in_order_and_one_at_a_time(n_agents, delay, drift, loss, early_finish):
    settings = ConsensusSettings(
        n_agents=n_agents, delay=delay, drift=drift, loss=loss, early_finish=early_finish
    )
    for seed in range(3):
        record = simulate(settings, np.random.default_rng(seed))
        turns = [action.turn for action in record.actions]
        assert turns == list(range(settings.first_turn, settings.first_turn + settings.n_turns))
        assert [action.agent for action in record.actions] == [t % n_agents for t in turns]
        ends = [action.end for action in record.actions]
        assert all(a.begin >= b for a, b in zip(record.actions[1:], ends, strict=False))
        assert count_disorder(record.actions, settings) == count_overlaps(record.actions) == 0


def test_giving_the_turn_at_once_saves_time_unless_the_mean_takes_it_back():
    ends = []
    for changed in ({}, {"falls_back": True}, {"early_finish": False}):
        settings = ConsensusSettings(delay=0, **changed)
        record = simulate(settings, np.random.default_rng(1))
        assert count_disorder(record.actions, settings) == count_overlaps(record.actions) == 0
        ends.append(record.times[-1])
    assert ends[0] < 0.7 * ends[1]
    assert ends[1] < 0.95 * ends[2]


def test_a_given_turn_is_kept_or_lost_by_the_mean():
    # Two agents, equal clocks, actions of no length: agent 0 gives turn 2 in the round it begins.
    settings = {"n_agents": 2, "loss": 0.0, "delay": 0, "drift": 0.0, "offset": 0.0, "rounds": 10}
    clocks = []
    for falls_back in (False, True):
        made = ConsensusSettings(
            **settings, action_time=0.0, first_turn=2, n_turns=1, falls_back=falls_back
        )
        record = simulate(made, np.random.default_rng(0))
        begun = round(record.actions[0].begin * 10)
        clocks.append(record.clocks[begun + 1 : begun + 3])
    for (given, waiting), _ in clocks:
        assert (given, waiting) == (3.0, pytest.approx(2.1, abs=1e-9))
    mean = (3.0 + 2.1) / 2 + 0.1
    assert clocks[0][1] == pytest.approx([3.0, mean])
    assert clocks[1][1] == pytest.approx([mean, mean])


def test_the_same_seed_gives_the_same_run():
    one, other, third = (
        simulate(ConsensusSettings(), np.random.default_rng(seed)) for seed in (5, 5, 6)
    )
    assert one.actions == other.actions
    assert (one.clocks == other.clocks).all()
    assert one.actions != third.actions


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("n_agents", 1), ("n_agents", 2.5), ("loss", 1.0), ("loss", float("nan")), ("delay", -1)),
        *(("drift", 0.6), ("rounds", 0), ("action_time", 1.5), ("n_turns", 0), ("first_turn", 2)),
    ],
)
def test_wrong_settings_are_named(name, value):
    with pytest.raises(InputError, match=name):
        ConsensusSettings(**{name: value})


def test_rates_differ_by_the_drift_at_most():
    rates = draw_rates(ConsensusSettings(n_agents=20, drift=0.05), np.random.default_rng(0))
    assert rates.shape == (20,)
    assert 0.02 < np.abs(rates - 1.0).max() <= 0.05
