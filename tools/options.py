"""Options of a task or learner as words of a command line, `name=value`."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from hose_mj.errors import InputError


def parse_options(words: Sequence[str]) -> dict[str, Any]:
    """Returns the options that words like `n_robots=3` or `goal=(2,1)` give.

    A value is a Python literal, or else the text itself; lists become tuples.

    Raises:
        InputError: a word without "=", or a name given twice.
    """
    options: dict[str, Any] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or not name:
            raise InputError("option", word, "name=value, as n_robots=3")
        if name in options:
            raise InputError("option", word, f"{name} only once")
        try:
            value = ast.literal_eval(text)
        except (ValueError, SyntaxError):
            value = text
        options[name] = tuple(value) if isinstance(value, list) else value
    return options
