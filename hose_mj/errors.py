"""Errors a user can act on: each names the thing, the value received and the valid set."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection
from typing import Self


class HoseError(Exception):
    """Base of every error that hose_mj raises on purpose."""


class InputError(HoseError, ValueError):
    """A value outside its valid set; the message suggests the valid word that a text comes near to.

    Args:
        thing: what was given, in the user's words (``"bending_stiffness"``).
        value: the value received.
        valid: the valid set, in words (``"a finite number above 0 (N m^2)"``).
    """

    def __init__(self, thing: str, value: object, valid: str) -> None:
        self.thing, self.value, self.valid = thing, value, valid
        super().__init__(f"{thing} is {_show(value)}; valid: {valid}{_suggest(value, valid)}")

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
    if not isinstance(value, str) or value not in valid:
        raise InputError(name, value, "one of " + ", ".join(valid))


def is_finite(value: object) -> bool:
    """Says whether a value is a number that a float holds; text, 1j and 10**400 are none."""
    try:
        return math.isfinite(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return False


def _show(value: object) -> str:
    """The value as Python writes it, if Python does: a whole number may have too many digits."""
    try:
        return repr(value)
    except Exception:
        return f"a value of type {type(value).__name__}"


def _suggest(value: object, valid: str) -> str:
    """What a misspelt word may have meant, out of those that are valid."""
    if not isinstance(value, str):
        return ""
    known = re.findall(r"[\w.-]+", valid.partition(" (")[0])  # there stands why
    near = difflib.get_close_matches(value, known, n=1, cutoff=0.7)
    return f" (did you mean {near[0]}?)" if near and near[0] != value else ""
