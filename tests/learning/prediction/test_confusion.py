"""Measures by hand, and the scores of folds by closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hose_learning.prediction.cross_validation import (
    MEASURES,
    Confusion,
    compute_score,
    count_confusion,
    cross_validate,
    make_splits,
)
from hypothesis import given
from hypothesis import strategies as st

from hose_mj.errors import InputError


def measure(undesired, predicted):
    return dict(zip(MEASURES, count_confusion(undesired, predicted).measure(), strict=True))


def test_measures_by_hand():
    """12 safe instances, of which 9 are taken for safe; 8 undesired ones, of which 6 are found."""
    confusion = Confusion(9, 6, 2, 3)
    expected = {
        "accuracy": 15 / 20,
        "sensitivity": 9 / 12,
        "specificity": 6 / 8,
        "npv": 6 / 9,
        "ppv": 9 / 11,
    }
    assert dict(zip(MEASURES, confusion.measure(), strict=True)) == expected


def test_a_positive_is_a_safe_move():
    undesired = np.array([False, False, False, True, True, True, True])
    predicted = np.array([False, True, False, True, True, False, True])
    assert count_confusion(undesired, predicted) == Confusion(2, 3, 1, 1)


def test_what_nothing_was_taken_for_has_no_predictive_value():
    always_safe = measure(np.array([False, True]), np.array([False, False]))
    assert math.isnan(always_safe["npv"])
    assert (always_safe["sensitivity"], always_safe["specificity"]) == (1.0, 0.0)
    assert math.isnan(measure(np.array([True]), np.array([True]))["sensitivity"])


def test_lengths_must_agree():
    with pytest.raises(InputError, match="as long as the truth"):
        count_confusion(np.array([True]), np.array([True, False]))


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1))
def test_accuracy_lies_between_sensitivity_and_specificity(pairs):
    """What five rows of Table 8.2 break."""
    undesired, predicted = np.array(pairs).T
    found = measure(undesired, predicted)
    assert found["accuracy"] == pytest.approx(np.mean(undesired == predicted))
    ends = sorted(x for x in (found["sensitivity"], found["specificity"]) if not math.isnan(x))
    assert ends[0] - 1e-12 <= found["accuracy"] <= ends[-1] + 1e-12


def test_the_interval_is_nadeau_and_bengios():
    """Values 1, 2, 3: deviation 1; t of 0.975 with 2 degrees of freedom is 4.302653."""
    score = compute_score(np.array([1.0, math.nan, 2.0, 3.0]), 1 / 9)
    assert (score.mean, score.deviation) == (2.0, 1.0)
    assert score.interval == pytest.approx(4.302653 * math.sqrt(1 / 3 + 1 / 9), rel=1e-6)


def test_scores_without_enough_folds():
    alone = compute_score(np.array([0.5]), 1.0)
    assert alone.mean == 0.5
    assert math.isnan(alone.interval)
    assert math.isnan(compute_score(np.array([math.nan]), 1.0).mean)


def make_classes(safe, undesired):
    return np.arange(safe + undesired) >= safe


def test_folds_are_a_stratified_partition_in_every_repeat():
    classes = make_classes(60, 20)
    splits = make_splits(classes, 3, 10, np.random.default_rng(0))
    assert len(splits) == 30
    assert len({split.seed for split in splits}) == 30
    for k in range(0, 30, 10):
        tests = np.concatenate([split.test for split in splits[k : k + 10]])
        assert sorted(tests) == list(range(80))
    for split in splits:
        assert sorted([*split.training, *split.test]) == list(range(80))
        assert (len(split.test), classes[split.test].sum()) == (8, 2)
    assert not np.array_equal(splits[0].test, splits[10].test)


@pytest.mark.parametrize(
    ("classes", "repeats", "folds", "message"),
    [
        (make_classes(5, 5), 0, 2, "repeats is 0"),
        (make_classes(5, 5), 1, 1, "folds is 1"),
        (make_classes(50, 4), 1, 5, "from 2 to 4"),
        (make_classes(50, 1), 1, 2, "log more moves"),
    ],
)
def test_impossible_folds_are_refused(classes, repeats, folds, message):
    with pytest.raises(InputError, match=message):
        make_splits(classes, repeats, folds, np.random.default_rng(0))


class Threshold:
    """Learns nothing but its seed; calls everything above one half undesired."""

    def __init__(self, seed, made):
        made.append(self)
        self.seed, self.fitted = seed, None

    def fit(self, attributes, undesired):
        self.fitted = (attributes[:, 0].copy(), undesired.copy())

    def predict(self, attributes):
        return attributes[:, 0] > 0.5


def test_each_fold_trains_a_new_classifier_on_the_rest_and_tests_on_the_fold():
    """A tenth of each class is on the wrong side, in every fold alike."""
    classes = make_classes(50, 50)
    attributes = np.where(classes, 1.0, 0.0)
    attributes[[*range(0, 50, 10), *range(50, 100, 10)]] -= 1.0
    attributes[:50:10] = 1.0  # five safe ones above, five undesired ones below one half
    made, folds = [], []
    splits = make_splits(classes, 2, 5, np.random.default_rng(1))
    scores = cross_validate(
        lambda seed: Threshold(seed, made),
        attributes[:, None],
        classes,
        splits,
        lambda: folds.append(1),
    )
    assert [c.seed for c in made] == [split.seed for split in splits]
    for classifier, split in zip(made, splits, strict=True):
        assert np.array_equal(classifier.fitted[0], attributes[split.training])
        assert np.array_equal(classifier.fitted[1], classes[split.training])
    assert len(folds) == 10
    for name in ("accuracy", "sensitivity", "specificity"):
        assert scores[name].mean == pytest.approx(0.9)
