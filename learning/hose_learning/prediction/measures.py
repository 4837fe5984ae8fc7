"""How well two classes are told apart, counted as in section 8.1: a positive is a safe pair c_0."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hose_learning.experience import Bools
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Floats

MEASURES = ("accuracy", "sensitivity", "specificity", "npv", "ppv")
"""Names of the measures; npv and ppv are the negative and positive predictive value."""


@dataclass(frozen=True)
class Confusion:
    """How many instances of each class were taken for which.

    Attributes:
        true_positives: safe and taken for safe.
        true_negatives: undesired and taken for undesired.
        false_positives: undesired and taken for safe.
        false_negatives: safe and taken for undesired.
    """

    true_positives: int
    true_negatives: int
    false_positives: int
    false_negatives: int

    @property
    def accuracy(self) -> float:
        """Share of all instances that are taken for what they are."""
        right = self.true_positives + self.true_negatives
        return _divide(right, right + self.false_positives + self.false_negatives)

    @property
    def sensitivity(self) -> float:
        """Share of the safe instances that are taken for safe."""
        return _divide(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def specificity(self) -> float:
        """Share of the undesired instances that are taken for undesired."""
        return _divide(self.true_negatives, self.true_negatives + self.false_positives)

    @property
    def npv(self) -> float:
        """Share of those taken for undesired that are; NaN where none is."""
        return _divide(self.true_negatives, self.true_negatives + self.false_negatives)

    @property
    def ppv(self) -> float:
        """Share of those taken for safe that are; NaN where none is."""
        return _divide(self.true_positives, self.true_positives + self.false_positives)

    def measure(self) -> Floats:
        """Returns all measures in the order of `MEASURES` (5,)."""
        return np.array([getattr(self, name) for name in MEASURES])


def _divide(part: int, whole: int) -> float:
    return part / whole if whole else math.nan


def count_confusion(undesired: Bools, predicted: Bools) -> Confusion:
    """Counts what was taken for what.

    Args:
        undesired: the truth (n,).
        predicted: what was taken for undesired (n,).

    Raises:
        InputError: different lengths.
    """
    if undesired.shape != predicted.shape:
        valid = f"as long as the truth, {undesired.shape}"
        raise InputError("shape of the predictions", predicted.shape, valid)
    return Confusion(
        int((~undesired & ~predicted).sum()),
        int((undesired & predicted).sum()),
        int((undesired & ~predicted).sum()),
        int((~undesired & predicted).sum()),
    )
