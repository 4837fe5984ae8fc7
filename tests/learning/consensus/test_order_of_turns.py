import numpy as np
import pytest
from hose_learning.consensus import (
    Action,
    ConsensusSettings,
    Record,
    compute_leads,
    compute_longest_action,
    count_disorder,
    count_overlaps,
    simulate,
)


def test_an_action_within_the_bound_never_meets_another_and_a_longer_one_does():
    settings = ConsensusSettings(loss=0.3, delay=2, drift=0.1, early_finish=False)
    record = simulate(settings, np.random.default_rng(6))
    longest = compute_longest_action(compute_leads(record).max(), settings.drift)
    begins = np.array([action.begin for action in record.actions])
    assert 0.5 < longest <= np.diff(begins).min()

    def stretch(length):
        return tuple(Action(*action[:3], action.begin + length) for action in record.actions)

    assert count_overlaps(stretch(longest)) == 0
    assert count_overlaps(stretch(1.1 * np.diff(begins).max())) == settings.n_turns - 1


def test_leads_remember_the_furthest_clock():
    clocks = np.array([[1.0, 1.5], [1.9, 2.3], [2.0, 2.1], [2.4, 2.4], [3.1, 3.0]])
    actions = (Action(2, 0, 0.2, 0.3), Action(3, 1, 0.4, 0.5))
    record = Record(np.ones(2), clocks, actions, 0.1)
    assert compute_leads(record) == pytest.approx([0.3, 0.1])
    assert compute_longest_action(0.3, 0.0) == pytest.approx(0.7)
    assert compute_longest_action(0.3, 0.4) == pytest.approx(0.5)


def test_the_counts_see_what_is_wrong():
    settings = ConsensusSettings(first_turn=6, n_turns=3)
    right = (Action(6, 2, 0.0, 0.5), Action(7, 3, 0.5, 0.9), Action(8, 0, 1.0, 1.1))
    assert count_overlaps(right) == count_disorder(right, settings) == 0
    assert count_overlaps((right[0]._replace(end=1.05), *right[1:])) == 2
    assert count_disorder((right[0], right[2], right[1]), settings) == 2
    assert count_disorder(right[:2], settings) == 1
