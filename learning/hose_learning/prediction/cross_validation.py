"""Repeated stratified cross-validation of two-class classifiers (section 8.3.1)."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.stats import t as student
from sklearn.model_selection import StratifiedKFold
from threadpoolctl import threadpool_limits

from hose_learning.experience import Bools
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Floats, Integers

MEASURES = ("accuracy", "sensitivity", "specificity", "npv", "ppv")
"""Names of the measures; npv and ppv are the negative and positive predictive value."""


class Confusion(NamedTuple):
    """How many instances of each class were taken for which; safe is positive."""

    true_positives: int
    true_negatives: int
    false_positives: int
    false_negatives: int

    def measure(self) -> Floats:
        """Returns all measures in the order of `MEASURES` (5,), NaN where nothing is counted.

        They are shares: of all instances, those taken for what they are; of the safe and of the
        undesired, those taken for it; of those taken for undesired and for safe, those that are.
        """
        safe, undesired, missed, false_alarms = self
        shares = (
            (safe + undesired, sum(self)),
            (safe, safe + false_alarms),
            (undesired, undesired + missed),
            (undesired, undesired + false_alarms),
            (safe, safe + missed),
        )
        return np.array([part / whole if whole else math.nan for part, whole in shares])


def count_confusion(undesired: Bools, predicted: Bools) -> Confusion:
    """Counts what of the truth (n,) was predicted as what (n,); `InputError` for other lengths."""
    if undesired.shape != predicted.shape:
        valid = f"as long as the truth, {undesired.shape}"
        raise InputError("shape of the predictions", predicted.shape, valid)
    return Confusion(
        int((~undesired & ~predicted).sum()),
        int((undesired & predicted).sum()),
        int((undesired & ~predicted).sum()),
        int((~undesired & predicted).sum()),
    )


CONFIDENCE = 0.95


class Classifier(Protocol):
    """What learns two classes; scikit-learn's classifiers do."""

    def fit(self, attributes: Floats, undesired: Bools) -> Any:
        """Learns from instances (n, n_attributes) of known class (n,)."""
        ...

    def predict(self, attributes: Floats) -> Bools:
        """Returns which of the instances (n, n_attributes) are undesired (n,)."""
        ...


MakeClassifier = Callable[[int], Classifier]
"""Makes a classifier that has learned nothing, from the seed of its random choices."""


@dataclass(frozen=True, eq=False)
class Split:
    """One fold: what is learned from, what is tested on, and the seed of what is random in it."""

    training: Integers
    test: Integers
    seed: int


@dataclass(frozen=True)
class Score:
    """One measure over all folds."""

    mean: float  # over the folds in which the measure exists; NaN where it exists in none
    deviation: float  # standard deviation over these folds
    # Half width of the 95 % confidence interval of the mean, with the variance of Nadeau and Bengio
    # (2003): training sets of one log overlap, so that the folds are not independent and the plain
    # standard error is too small.
    interval: float


def make_splits(
    undesired: Bools, repeats: int, folds: int, generator: np.random.Generator
) -> list[Split]:
    """Makes the folds of all repeats; each holds the same share of either class.

    Raises:
        InputError: no repeat, fewer than two folds, or a class with fewer instances than folds.
    """
    rarest = int(min(undesired.sum(), (~undesired).sum()))
    if repeats < 1:
        raise InputError("repeats", repeats, "a whole number, at least 1")
    if not 2 <= folds <= rarest:
        valid = f"a whole number from 2 to {rarest}, the instances of the rarer class"
        if rarest < 2:
            valid = "none: a class has fewer than 2 instances; log more moves"
        raise InputError("folds", folds, valid)
    splits = []
    for _ in range(repeats):
        shuffle, *seeds = generator.integers(0, 2**31, folds + 1).tolist()
        partition = StratifiedKFold(folds, shuffle=True, random_state=shuffle)
        pairs = partition.split(np.zeros(len(undesired)), undesired)
        for (training, test), seed in zip(pairs, seeds, strict=True):
            splits.append(Split(training, test, seed))
    return splits


def cross_validate(
    make: MakeClassifier,
    attributes: Floats,
    undesired: Bools,
    splits: Sequence[Split],
    on_fold: Callable[[], object] = lambda: None,
) -> dict[str, Score]:
    """Learns and tests on every split of `make_splits`; returns the scores by `MEASURES`.

    The classifier is made anew for every split; attributes are (n, n_attributes), their classes
    (n,). `on_fold` is called after each split.
    """
    measured = []
    # One thread: for so few instances more of them only wait for each other, and the order of sums,
    # hence the last bits, would depend on the machine.
    with threadpool_limits(1):
        for split in splits:
            classifier = make(split.seed)
            classifier.fit(attributes[split.training], undesired[split.training])
            predicted = np.asarray(classifier.predict(attributes[split.test]), np.bool_)
            measured.append(count_confusion(undesired[split.test], predicted).measure())
            on_fold()
    ratio = float(np.mean([len(split.test) / len(split.training) for split in splits]))
    table = np.array(measured)
    return {name: compute_score(table[:, k], ratio) for k, name in enumerate(MEASURES)}


def compute_score(values: Floats, ratio: float) -> Score:
    """Returns the score of a measure from its values (n_folds,), NaN where it does not exist.

    `ratio` is the number of instances in a test set over that in a training set.
    """
    values = values[np.isfinite(values)]
    n = len(values)
    if n < 2:
        return Score(float(values[0]) if n else math.nan, math.nan, math.nan)
    deviation = float(values.std(ddof=1))
    quantile = float(student.ppf(0.5 + CONFIDENCE / 2.0, n - 1))
    return Score(float(values.mean()), deviation, quantile * deviation * math.sqrt(1 / n + ratio))
