"""Errors a user can act on: each names the thing, the value received and the valid set."""

from __future__ import annotations

from collections.abc import Collection
from typing import Self


class HoseError(Exception):
    """Base of every error that hose_mj raises on purpose."""


class InputError(HoseError, ValueError):
    """A value outside its valid set.

    Args:
        thing: what was given, in the user's words (``"bending_stiffness"``).
        value: the value received.
        valid: the valid set, in words (``"a finite number above 0 (N m^2)"``).
    """

    def __init__(self, thing: str, value: object, valid: str) -> None:
        self.thing, self.value, self.valid = thing, value, valid
        super().__init__(f"{thing} is {value!r}; valid: {valid}")

    @classmethod
    def about(cls, sentence: str) -> Self:
        """Returns the error of an act that cannot be done now; the message is that sentence.

        ``InputError.about("cannot open a hose that is not closed")``: its subject is no value, so
        `thing`, `value` and `valid` are empty.
        """
        error = cls("", None, "")
        error.args = (sentence,)
        return error


class StepError(HoseError, RuntimeError):
    """A time step or a static solve that no fallback could finish; the state before it is kept."""


class HoseWarning(UserWarning):
    """A result that is computed as asked and may not be what is wanted; it says what to do.

    ``warnings.simplefilter("error", HoseWarning)`` makes an exception of it.
    """


def check_choice(name: str, value: object, valid: Collection[str]) -> None:
    """Raises `InputError` unless `value` is one of the valid words."""
    if value not in valid:
        raise InputError(name, value, "one of " + ", ".join(valid))
