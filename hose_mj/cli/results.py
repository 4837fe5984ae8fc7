"""What commands share: arguments in their valid sets, tables, and how a command ends."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hose_mj.checks import Check
from hose_mj.errors import InputError
from hose_mj.recording.document import make_document, print_document


def check_counts(args: Any, **least: int) -> None:
    """Raises `InputError` for one of these arguments that is below its least whole number."""
    for name, bound in least.items():
        value = getattr(args, name)
        if value is not None and value < bound:
            raise InputError(name, value, f"a whole number, at least {bound}")


def make_folder(out: Path) -> None:
    """Makes the folder `out` unless it is there.

    Raises:
        InputError: it cannot be made or written to.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        valid = f"a folder, or a place where one can be made ({error.strerror})"
        raise InputError("out", str(out), valid) from error
    if not os.access(out, os.W_OK):
        raise InputError("out", str(out), "a folder that you may write to")


def print_table(
    title: str, columns: Sequence[str], rows: Iterable[Iterable[str]], **style: Any
) -> None:
    """Prints a table; columns whose names begin with ">" are aligned right."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, **style)
    for name in columns:
        table.add_column(name.removeprefix(">"), justify="right" if name[:1] == ">" else "left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def print_checks(checks: Sequence[Check]) -> None:
    """Prints checks, one in a row; nothing where there is none."""
    marks = {True: "[green]ok[/]", False: "[red]failed[/]"}
    rows = [
        (marks[c.ok], c.name, f"{c.value:,.4g}", f"{c.comparison} {c.limit:,.4g}") for c in checks
    ]
    if rows:
        print_table("Checks", ("", "what", ">value", ">limit"), rows)


def finish(
    command: str,
    args: Any,
    checks: Sequence[Check],
    results: Mapping[str, Any],
    show: Callable[[], None],
    *,
    begun: float | None = None,
    ending: str = "",
) -> int:
    """Prints the document, or a text and the checks; returns 1 if a check failed, else 0.

    Args:
        command: name of the sub-command.
        args: its arguments; `json` of them asks for the document.
        checks: what was checked.
        results: the document's own entries.
        show: prints the text.
        begun: reading of `time.perf_counter` when the work began; None to leave the time out.
        ending: last line, instead of how many checks are ok; on stderr beside a document.
    """
    if args.json:
        print_document(make_document(command, args, checks=checks, results=results))
    else:
        show()
        print_checks(checks)
    passed = sum(check.ok for check in checks)
    took = "" if begun is None else f", {time.perf_counter() - begun:.1f} s"
    counted = f"{passed} of {len(checks)} checks ok{took}"
    print(ending or counted, file=sys.stderr if args.json else sys.stdout)
    return 0 if passed == len(checks) else 1
