"""Checks on HTML pages: failed ones first and in full, the others in compact groups."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from hose_mj.checks import Check
from hose_mj.recording.page_parts import format_text, format_value

_SIGNS = {"<=": "\u2264", ">=": "\u2265", "==": "=", "<": "<", ">": ">"}
_OTHERS = "Others"


def format_checks(checks: Sequence[Check]) -> str:
    """Returns the failed checks as a list, and all of them as small tables side by side."""
    failed = [check for check in checks if not check.ok]
    above = f'<ul class="checks">{"".join(map(_format_failed, failed))}</ul>' if failed else ""
    groups = [_format_group(heading, some) for heading, some in group_checks(checks).items()]
    kind = "groups one" if len(groups) == 1 else "groups"
    return f'{above}<div class="{kind}">{"".join(groups)}</div>'


def group_checks(checks: Sequence[Check]) -> dict[str, list[tuple[str, Check]]]:
    """Groups checks whose names share what is before or behind ": ", or before the last ", ".

    Returns:
        Heading to the rest of each name with its check. Checks that share nothing come last.
    """
    splits = [_split(check.name) for check in checks]
    counts = Counter(part for split in splits for part in split if part)
    groups: dict[str, list[tuple[str, Check]]] = {}
    for (head, tail), check in zip(splits, checks, strict=True):
        heading, rest = _OTHERS, check.name
        if tail and counts[head] > 1:
            heading, rest = head, tail
        elif ": " in check.name and counts[tail] > 1:
            heading, rest = tail, head
        groups.setdefault(heading, []).append((rest, check))
    if _OTHERS in groups:
        groups[_OTHERS] = groups.pop(_OTHERS)
    return groups


def _split(name: str) -> tuple[str, str]:
    head, colon, tail = name.partition(": ")
    if not colon:
        head, _, tail = name.rpartition(", ")
        head, tail = (head, tail) if head else (tail, "")
    return head, tail


def _format_failed(check: Check) -> str:
    """Returns one line with everything about a check."""
    detail = f"{format_value(check.value)}, limit {_format_limit(check)}"
    return (
        f'<li><span class="badge failed">failed</span><span>{format_text(check.name)}</span>'
        f'<span class="detail">{format_text(detail)}</span></li>\n'
    )


def _format_group(heading: str, members: Sequence[tuple[str, Check]]) -> str:
    """Returns a small table; a limit that all share stands in its caption."""
    limits = {_format_limit(check) for _, check in members}
    shared = limits.pop() if len(limits) == 1 else ""
    rows = "".join(_format_row(rest, check, not shared) for rest, check in members)
    title = f"{heading[:1].upper()}{heading[1:]}"
    above = f"<span>{format_text(shared)}</span>" if shared else ""
    return f"<table><caption>{format_text(title)} {above}</caption><tbody>{rows}</tbody></table>\n"


def _format_row(rest: str, check: Check, with_limit: bool) -> str:
    badge = '<span class="badge ok">ok</span>' if check.ok else _BAD
    limit = f'<td class="number soft">{format_text(_format_limit(check))}</td>'
    return (
        f"<tr><td>{badge}</td><td>{format_text(rest)}</td>"
        f'<td class="number">{format_text(format_value(_round(check.value)))}</td>'
        f"{limit if with_limit else ''}</tr>\n"
    )


_BAD = '<span class="badge failed">failed</span>'


def _round(value: float) -> float:
    """Three digits are enough beside a limit."""
    return float(f"{value:.3g}")


def _format_limit(check: Check) -> str:
    return f"{_SIGNS[check.comparison]} {format_value(check.limit)}"
