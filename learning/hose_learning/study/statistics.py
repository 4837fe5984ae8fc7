"""Intervals that stand beside every reported rate and mean."""

import numpy as np
import numpy.typing as npt

CONFIDENCE = 0.95


def compute_rate_interval(successes: int, trials: int) -> tuple[float, float]:
    """Returns Wilson's 95 % interval of a rate; (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    from scipy.stats import binomtest

    interval = binomtest(successes, trials).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def compute_mean_interval(values: npt.ArrayLike) -> tuple[float, float]:
    """Returns Student's 95 % interval of the mean of some runs; the mean itself for one run."""
    values = np.asarray(values, float)
    mean = float(values.mean())
    if len(values) < 2 or np.ptp(values) == 0.0:
        return mean, mean
    from scipy.stats import t

    half = t.ppf(0.5 + CONFIDENCE / 2, len(values) - 1) * values.std(ddof=1) / len(values) ** 0.5
    return mean - float(half), mean + float(half)
