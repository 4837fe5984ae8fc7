"""The table of checks that commands print."""

from __future__ import annotations

from collections.abc import Sequence

from hose_mj.checks import Check


def print_checks(checks: Sequence[Check]) -> None:
    """Prints checks, one in a row; nothing where there is none."""
    from rich.console import Console
    from rich.table import Table

    if not checks:
        return
    table = Table(title="Checks")
    for name in ("", "what", "value", "limit"):
        table.add_column(name, justify="left" if name in ("", "what") else "right")
    for check in checks:
        mark = "[green]ok[/]" if check.ok else "[red]failed[/]"
        limit = f"{check.comparison} {check.limit:,.4g}"
        table.add_row(mark, check.name, f"{check.value:,.4g}", limit)
    Console().print(table)
