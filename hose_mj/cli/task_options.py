"""Options of tasks on the command line: words such as `goal=(3, 0)` or `source.n_robots=2`."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from typing import Any

from hose_mj.errors import InputError


def read_options(words: Iterable[str], groups: Iterable[str] = ()) -> dict[str, dict[str, Any]]:
    """Returns the options by group; those without a group are in the group "".

    Args:
        words: each `name=value` or `group.name=value`; a value that Python does not read as a
            number, tuple or the like is a word.
        groups: the groups that there are.

    Raises:
        InputError: no "=", an unknown group, or an option given twice.
    """
    options: dict[str, dict[str, Any]] = {group: {} for group in ("", *groups)}
    for word in words:
        key, equals, text = word.partition("=")
        group, dot, name = key.rpartition(".")
        if not equals or not name:
            raise InputError("option", word, "name=value")
        if group not in options or (dot and not group):
            valid = " or ".join(f"{known}.{name}" for known in options if known)
            raise InputError("option", key, f"{name}{' or ' * bool(valid)}{valid}")
        if name in options[group]:
            raise InputError("option", key, "each option only once")
        options[group][name] = _read_value(text)
    return options


def parse_options(words: Iterable[str]) -> dict[str, Any]:
    """Returns the options of the only group that there is; see `read_options`."""
    return read_options(words)[""]


def _read_value(text: str) -> Any:
    try:
        value = ast.literal_eval(text)
    except (ValueError, TypeError, SyntaxError):
        return text
    return tuple(value) if isinstance(value, list) else value
