import math

import numpy as np
import pytest

from hose_mj.checks import Check
from hose_mj.errors import HoseError, InputError, check_choice, is_finite
from hose_mj.tasks import checks


def test_a_value_is_refused_with_its_name_and_the_valid_set():
    error = InputError("length", -1.0, "a number above 0 (m)")
    assert str(error) == "length is -1.0; valid: a number above 0 (m)"
    assert isinstance(error, HoseError)
    assert isinstance(error, ValueError)


def test_an_act_is_refused_with_one_sentence():
    sentence = "cannot open a hose that is not closed"
    with pytest.raises(InputError) as caught:
        raise InputError.about(sentence)
    assert str(caught.value) == sentence
    assert (caught.value.thing, caught.value.value, caught.value.valid) == ("", None, "")


def test_a_choice_is_one_of_the_known_words_and_the_nearest_is_suggested():
    check_choice("model", "geds", {"geds": 1, "flex": 2})
    with pytest.raises(InputError, match=r"valid: one of geds, flex \(did you mean geds\?\)$"):
        check_choice("model", "gedz", {"geds": 1, "flex": 2})
    for odd in (None, {}, [], np.zeros(3), 10**5000):
        with pytest.raises(InputError, match=r"valid: one of geds, flex$"):
            check_choice("model", odd, {"geds": 1, "flex": 2})


ODD = [10**400, 10**5000, 1j, {}, set(), "1", "", None, np.zeros(3), np.array(["a"]), math.inf]


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: type(odd).__name__)
def test_what_is_no_finite_number_is_refused_everywhere(odd):
    assert not is_finite(odd)
    with pytest.raises(InputError, match="limit of error"):
        Check("error", 1.0, odd)
    assert not Check("error", odd, 1.0).ok
    assert Check("error", odd, 1.0).as_record()["value"] is None
    for check, rest in (
        (checks.check_finite, ()),
        (checks.check_integer, (0, 3)),
        (checks.check_choice, ((1, "a"),)),
        (checks.check_cell, ((0, 3), (0, 3))),
        (checks.check_cells, (2, 0, 3)),
    ):
        for value in (odd, (odd, odd)):
            with pytest.raises(InputError, match=r"^goal is "):
                check("goal", value, *rest)
