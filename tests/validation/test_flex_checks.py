"""The measured softness of the flex rod's edges."""

import pytest

from hose_mj.validation.cases import find_cases
from hose_mj.validation.numerics import check_flex_stretch, measure_stretch


def test_the_released_rods_edges_give_little_and_less_with_smaller_steps():
    size, order = check_flex_stretch()
    assert 0.0 < size.value < 1e-3
    assert size.ok
    # Constraints with a time constant of two steps open by the square of the step.
    assert order.value == pytest.approx(2.0, abs=0.15)
    assert order.ok


def test_a_slow_case_stretches_less_than_a_fast_one():
    slow, fast = (find_cases((name,))[0] for name in ("taut-pull-hose", "released-rod"))
    assert measure_stretch(slow, 0.004) < 0.2 * measure_stretch(fast, 0.004)
