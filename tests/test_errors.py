import pytest

from hose_mj.errors import HoseError, InputError


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
