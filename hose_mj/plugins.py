"""What other packages add to hose_mj by entry points: found by group, imported when asked for.

A package names what it adds in its pyproject.toml, here a hose model:

    [project.entry-points."hose_mj.hoses"]
    my-chain = "my_package.hoses:MY_CHAIN"

Groups: `hose_mj.hoses`, `hose_mj.tasks`, `hose_mj.scenes`, `hose_mj.cases`,
`hose_learning.learners`. Registries ask for plug-ins only after their own names, which so win.
"""

import re
import warnings
from collections.abc import Callable, Collection, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from hose_mj.errors import InputError

Entry = TypeVar("Entry")


def find_plugins(group: str, own: Collection[str] = ()) -> dict[str, EntryPoint]:
    """Returns the entry points of a group by name, sorted; imports none of them.

    Args:
        group: such as "hose_mj.hoses".
        own: the registry's own names, which no package may take.

    Raises:
        InputError: a name that is the registry's own, that two packages take, or that would be no
            word in a shell or in the id of an environment.
    """
    found: dict[str, EntryPoint] = {}
    spelling = "with a name of letters, digits, dots and dashes, a letter or digit first"
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        if not re.fullmatch(r"[A-Za-z0-9][\w.-]*", entry.name, re.ASCII):
            raise InputError(_describe(entry), entry.value, spelling)
        if entry.name in own:
            taken = f"a name other than hose_mj's own: {', '.join(own)}"
            raise InputError(_describe(entry), entry.value, taken)
        other = found.setdefault(entry.name, entry)
        if (other.value, _find_package(other)) != (entry.value, _find_package(entry)):
            taken = f"a name that no other package takes ({_find_package(other)} has it)"
            raise InputError(_describe(entry), entry.value, taken)
    return found


def load_plugin(entry: EntryPoint, kind: type | tuple[type, ...] = object) -> Any:
    """Imports what an entry point names.

    Args:
        entry: one of `find_plugins`.
        kind: what it must be an instance of; `type` for a class.

    Raises:
        InputError: it cannot be imported, for whatever reason, or is of another kind; the message
            names the package.
    """
    try:
        loaded = entry.load()
    except (Exception, SystemExit) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        valid = f"importable ({reason})"
        raise InputError(_describe(entry), entry.value, valid) from error
    if not isinstance(loaded, kind):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        wanted = " or ".join(f"a {each.__name__}" for each in kinds)
        raise InputError(_describe(entry), loaded, wanted)
    return loaded


def load_plugins(found: Mapping[str, Entry], load: Callable[[Entry], Any]) -> dict[str, Any]:
    """Returns what `load` makes of each entry point, by name, for lists of all there is.

    One that `load` refuses is left out, with a RuntimeWarning that says which and why.
    """
    loaded = {}
    for name, entry in found.items():
        try:
            loaded[name] = load(entry)
        except InputError as error:
            warnings.warn(f"{name} is left out: {error}", RuntimeWarning, stacklevel=3)
    return loaded


def _find_package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unknown package"


def _describe(entry: EntryPoint) -> str:
    return f"entry point {entry.name!r} in {entry.group} of package {_find_package(entry)}"
