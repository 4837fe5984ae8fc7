"""The JSON documents of the commands: what all share, and how they are printed.

The top level of each has `command`, `version`, `revision`, `machine`, `seed` and `settings`;
`checks` in a command that checks something; and the command's own results beside them.
"""

import json
import math
import os
import platform
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Protocol

from hose_mj import version
from hose_mj.errors import InputError

_SHARED_ARGUMENTS = {"json", "seed"}


class CheckRecord(Protocol):
    """Anything that can stand under `checks`."""

    def as_record(self) -> dict[str, Any]:
        """Returns at least `name`, `value`, `limit` and `ok`."""
        ...


def make_document(
    command: str,
    settings: Any,
    *,
    seed: int | None = None,
    checks: Sequence[CheckRecord] | None = None,
    results: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Returns the document of one run of a command.

    Args:
        command: name of the sub-command.
        settings: its `Args`, or a mapping; `json` and `seed` are left out of the settings.
        seed: the seed used; None takes it from `settings`, null if there is none.
        checks: what was checked; None if the command checks nothing.
        results: the command's own entries of the top level.

    Raises:
        InputError: an entry of `results` that would replace a shared one.
    """
    values = dict(asdict(settings) if is_dataclass(settings) else settings)  # type: ignore[arg-type]
    document: dict[str, Any] = {
        "command": command,
        "version": version.__version__,
        "revision": find_revision(),
        "machine": describe_machine(),
        "seed": values.get("seed") if seed is None else seed,
        "settings": {k: v for k, v in values.items() if k not in _SHARED_ARGUMENTS},
    }
    if checks is not None:
        document["checks"] = [check.as_record() for check in checks]
    for name, value in (results or {}).items():
        if name in document:
            raise InputError("name of a result", name, f"none of {', '.join(document)}")
        document[name] = value
    return document


def print_document(document: Mapping[str, Any]) -> None:
    """Prints a document on stdout; see `format_document`."""
    sys.stdout.write(f"{format_document(document)}\n")
    sys.stdout.flush()


def format_document(document: Mapping[str, Any]) -> str:
    """Returns a document as JSON text, with numpy scalars and arrays as plain numbers and lists.

    Raises:
        InputError: a number that JSON cannot hold (NaN or infinite), with its place.
        TypeError: a value with no JSON form.
    """
    return json.dumps(make_plain(document), indent=2, ensure_ascii=False, allow_nan=False)


def make_plain(value: Any, place: str = "document") -> Any:
    """Returns a value made of dicts, lists, strings, finite numbers, booleans and None alone."""
    if hasattr(value, "tolist"):  # numpy scalars and arrays, without importing numpy
        value = value.tolist()
    if isinstance(value, Enum):
        value = value.value
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise InputError(place, value, "a finite number, or null")
        return value
    if isinstance(value, Path):
        return str(value)
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(k): make_plain(v, f"{place}.{k}") for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [make_plain(v, f"{place}[{i}]") for i, v in enumerate(value)]
    raise TypeError(f"{place} is a {type(value).__name__}, which has no JSON form")


def find_revision() -> str | None:
    """Returns the git commit of the checkout that hose_mj runs from, ``+dirty`` if it differs.

    None for an installed copy, even one in a virtual environment inside another repository.
    """
    root = Path(version.__file__).resolve().parent.parent
    top = _ask_git(root, "rev-parse", "--show-toplevel")
    commit = _ask_git(root, "rev-parse", "--verify", "HEAD")
    if top is None or commit is None or Path(top).resolve() != root:
        return None
    return commit + ("+dirty" if _ask_git(root, "status", "--porcelain") else "")


def _ask_git(folder: Path, *words: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=10
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def describe_machine() -> dict[str, Any]:
    """Returns `cpu` (model), `cores` (that this process may use), `os` and `python`."""
    affinity = getattr(os, "sched_getaffinity", None)  # not on macOS and Windows
    return {
        "cpu": _find_cpu_model(),
        "cores": len(affinity(0)) if affinity else os.cpu_count(),
        "os": platform.platform(),
        "python": platform.python_version(),
    }


def _find_cpu_model() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
