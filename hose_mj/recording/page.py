"""Self-contained HTML pages: a report that opens from a file, without scripts or a network.

    page = Page("GEDS against MuJoCo", subtitle="...")
    case = page.section("Heavy cantilever")
    case.paragraph("A rod under its own weight, `gamma = 10`.")
    case.figure(png, alt="...", caption="...")
    page.write(path)

`page.html` beside this file is their frame and their style sheet, for screens, phones and print.

All text is escaped. In running text `code` and **strong** are marked as in Markdown.
"""

from __future__ import annotations

import base64
import re
import struct
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from hose_mj.checks import Check
from hose_mj.errors import InputError
from hose_mj.recording.files import write_atomically

_PNG = b"\x89PNG\r\n\x1a\n"
_MINUS, _TIMES, _DASH = "\u2212", "\u00d7", "\u2013"
_NUMBER = re.compile(
    rf"[-+{_MINUS}±<>≈~]?\s*(\d[\d\s.,]*|\.\d+|nan|inf)(e[-+{_MINUS}]?\d+)?\s*[%{_TIMES}]?",
    re.IGNORECASE,
)
_DENSITY = 1.5  # dots of a picture per CSS pixel
_BLANKS = {"", "-", _DASH}
_SIGNS = {"<=": "\u2264", ">=": "\u2265", "==": "=", "<": "<", ">": ">"}
_OTHERS = "Others"
_BAD = '<span class="badge failed">failed</span>'


@dataclass(frozen=True)
class Picture:
    """PNG bytes with the words for those who cannot see it and those below it."""

    png: bytes
    alt: str
    caption: str = ""


class Block:
    """A stretch of page that content is added to, in order."""

    def __init__(self) -> None:
        self._parts: list[str | Block] = []

    def paragraph(self, text: str) -> None:
        """Adds running text."""
        self._parts.append(f"<p>{format_text(text)}</p>")

    def link(self, text: str, target: str) -> None:
        """Adds a line with a link to a file beside the page, or to an anchor on it."""
        if re.match(r"\s*([A-Za-z][A-Za-z0-9+.-]*:|//|\\)", target):
            raise InputError("target of a link", target, "a relative path or #anchor")
        self._parts.append(f'<p><a href="{escape(target)}">{format_text(text)}</a></p>')

    def definitions(self, entries: Mapping[str, object]) -> None:
        """Adds names and their values, such as settings."""
        rows = (
            f"<dt>{escape(name)}</dt><dd>{format_text(format_value(value))}</dd>"
            for name, value in entries.items()
        )
        self._parts.append(f"<dl>{''.join(rows)}</dl>")

    def table(
        self, header: Sequence[str], rows: Sequence[Sequence[object]], caption: str = ""
    ) -> None:
        """Adds a table; columns of numbers are aligned right, None is left blank.

        Raises:
            InputError: a row that is not as long as the header.
        """
        for number, row in enumerate(rows):
            if len(row) != len(header):
                valid = f"{len(header)}, as the header"
                raise InputError(f"length of row {number}", len(row), valid)
        cells = [[format_value(value) for value in row] for row in rows]
        right = [is_numeric([row[column] for row in cells]) for column in range(len(header))]
        body = "".join(f"{_format_row('td', row, right)}\n" for row in cells)
        title = _wrap("<caption>", caption, "</caption>")
        self._parts.append(
            f'<div class="scroll"><table>{title}<thead>{_format_row("th", header, right)}</thead>\n'
            f"<tbody>{body}</tbody></table></div>"
        )

    def figure(self, png: bytes, alt: str, caption: str = "") -> None:
        """Adds one picture as wide as the text."""
        self._parts.append(format_picture(Picture(png, alt, caption)))

    def figures(self, pictures: Sequence[Picture]) -> None:
        """Adds pictures side by side where the screen is wide enough."""
        inner = "".join(format_picture(picture) for picture in pictures)
        self._parts.append(f'<div class="row">{inner}</div>')

    def checks(self, checks: Sequence[Check]) -> None:
        """Adds checks with badges: those that failed first, then all that hold, in groups."""
        self._parts.append(format_checks(checks))

    def equation(self, text: str, number: str = "") -> None:
        """Adds a displayed equation in Unicode, with its number at the right."""
        tail = f'<span class="number">({escape(number)})</span>' if number else ""
        self._parts.append(f'<div class="equation"><span>{escape(text)}</span>{tail}</div>')

    def code(self, text: str) -> None:
        """Adds preformatted text."""
        self._parts.append(f"<pre><code>{escape(text)}</code></pre>")

    def fold(self, summary: str) -> Block:
        """Adds a stretch that opens on a click, and returns it to be filled."""
        inner = Fold(summary)
        self._parts.append(inner)
        return inner

    def render(self) -> str:
        """Returns the HTML of all that was added."""
        return "\n".join(part if isinstance(part, str) else part.render() for part in self._parts)


class Fold(Block):
    """A block behind a line that opens it."""

    def __init__(self, summary: str) -> None:
        super().__init__()
        self._summary = summary

    def render(self) -> str:
        """Returns the HTML."""
        return (
            f"<details><summary>{format_text(self._summary)}</summary>\n{super().render()}\n"
            "</details>"
        )


class Section(Block):
    """A block under a heading with an anchor; sections of sections stop there."""

    def __init__(self, heading: str, anchor: str, page: Page, level: int = 2) -> None:
        super().__init__()
        self.heading, self.anchor, self.level = heading, anchor, level
        self.subsections: list[Section] = []
        self._page = page

    def subsection(self, heading: str, anchor: str | None = None) -> Section:
        """Adds a section inside this one and returns it."""
        if self.level >= 3:
            raise InputError("level of a section", self.level + 1, "2 or 3")
        inner = Section(heading, self._page.take_anchor(anchor or heading), self._page, 3)
        self.subsections.append(inner)
        self._parts.append(inner)
        return inner

    def render(self) -> str:
        """Returns the HTML."""
        here = f'<a class="here" href="#{self.anchor}" aria-label="link to this section">#</a>'
        tag = f"h{self.level}"
        title = f'<{tag} id="{self.anchor}">{format_text(self.heading)}{here}</{tag}>'
        return f"<section>\n{title}\n{super().render()}\n</section>"

    def render_entry(self) -> str:
        """Returns this section's line in the table of contents, with those of its subsections."""
        inner = "".join(section.render_entry() for section in self.subsections)
        below = f"<ol>{inner}</ol>" if inner else ""
        return f'<li><a href="#{self.anchor}">{format_text(self.heading)}</a>{below}</li>'


class Page(Block):
    """A page: title, what is added to it directly, table of contents, sections, footer."""

    def __init__(self, title: str, subtitle: str = "", footer: str = "") -> None:
        super().__init__()
        self.title, self.subtitle, self.footer = title, subtitle, footer
        self.sections: list[Section] = []
        self._anchors: set[str] = set()

    def section(self, heading: str, anchor: str | None = None) -> Section:
        """Adds a section and returns it to be filled; `anchor` defaults to the heading's words."""
        inner = Section(heading, self.take_anchor(anchor or heading), self)
        self.sections.append(inner)
        return inner

    def take_anchor(self, text: str) -> str:
        """Returns an anchor made of a text's words that no other section has."""
        base = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "section"
        anchor, count = base, 1
        while anchor in self._anchors:
            count += 1
            anchor = f"{base}-{count}"
        self._anchors.add(anchor)
        return anchor

    def render(self) -> str:
        """Returns the whole document."""
        entries = "".join(section.render_entry() for section in self.sections)
        frame = Template(Path(__file__).with_name("page.html").read_text(encoding="utf-8"))
        return frame.substitute(
            title=escape(self.title),
            heading=format_text(self.title),
            subtitle=_wrap('<p class="subtitle">', self.subtitle, "</p>"),
            intro=super().render(),
            contents=f'<nav aria-label="Contents"><ol>{entries}</ol></nav>' if entries else "",
            sections="\n".join(section.render() for section in self.sections),
            footer=_wrap("<footer>", self.footer, "</footer>"),
        )

    def write(self, path: Path) -> None:
        """Writes the page; a reader sees the old file or the whole new one."""
        write_atomically(Path(path), self.render().encode("utf-8"))


def format_text(text: str) -> str:
    """Escapes a text and marks its `code` and **strong** words."""
    pieces = re.split(r"`([^`]+)`", str(text))
    return "".join(
        f"<code>{escape(piece)}</code>"
        if position % 2
        else re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", escape(piece))
        for position, piece in enumerate(pieces)
    )


def format_value(value: Any) -> str:
    """Returns a table cell's text: four digits of a float, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}".replace("-", _MINUS)
    return str(value)


def is_numeric(cells: Sequence[str]) -> bool:
    """Says whether a column has numbers and, but for blanks, nothing else."""
    filled = [cell.strip() for cell in cells if cell.strip() not in _BLANKS]
    return bool(filled) and all(_NUMBER.fullmatch(cell) for cell in filled)


def format_picture(picture: Picture) -> str:
    """Returns a figure with its PNG inside."""
    if not picture.png.startswith(_PNG):
        raise InputError("png", picture.png[:8], "the bytes of a PNG picture")
    width, height = (round(side / _DENSITY) for side in struct.unpack(">II", picture.png[16:24]))
    caption = _wrap("<figcaption>", picture.caption, "</figcaption>")
    data = base64.b64encode(picture.png).decode("ascii")
    return (
        f'<figure><div class="card"><img alt="{escape(picture.alt)}" width="{width}" '
        f'height="{height}" src="data:image/png;base64,{data}"/></div>{caption}</figure>'
    )


def _wrap(start: str, text: str, end: str) -> str:
    """Returns an element around a text, nothing around none."""
    return f"{start}{format_text(text)}{end}" if text else ""


def _format_row(tag: str, cells: Sequence[str], right: Sequence[bool]) -> str:
    """Returns a row of a table, cells of columns of numbers marked as such."""
    kinds = [' class="number"' if number else "" for number in right]
    inner = (f"<{tag}{k}>{format_text(c)}</{tag}>" for c, k in zip(cells, kinds, strict=True))
    return f"<tr>{''.join(inner)}</tr>"


def format_checks(checks: Sequence[Check]) -> str:
    """Returns the failed checks as a list, and all of them as small tables side by side."""
    failed = "".join(
        f'<li>{_BAD}<span>{format_text(check.name)}</span><span class="detail">'
        f"{format_text(f'{format_value(check.value)}, limit {_format_limit(check)}')}</span></li>\n"
        for check in checks
        if not check.ok
    )
    above = f'<ul class="checks">{failed}</ul>' if failed else ""
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


def _format_group(heading: str, members: Sequence[tuple[str, Check]]) -> str:
    """Returns a small table; a limit that all share stands in its caption."""
    limits = {_format_limit(check) for _, check in members}
    shared = limits.pop() if len(limits) == 1 else ""
    rows = "".join(_format_check(rest, check, not shared) for rest, check in members)
    title = f"{heading[:1].upper()}{heading[1:]}"
    above = _wrap("<span>", shared, "</span>")
    return f"<table><caption>{format_text(title)} {above}</caption><tbody>{rows}</tbody></table>\n"


def _format_check(rest: str, check: Check, with_limit: bool) -> str:
    badge = '<span class="badge ok">ok</span>' if check.ok else _BAD
    limit = f'<td class="number soft">{format_text(_format_limit(check))}</td>'
    return (
        f"<tr><td>{badge}</td><td>{format_text(rest)}</td>"
        f'<td class="number">{format_text(format_value(float(f"{check.value:.3g}")))}</td>'
        f"{limit if with_limit else ''}</tr>\n"
    )


def _format_limit(check: Check) -> str:
    return f"{_SIGNS[check.comparison]} {format_value(check.limit)}"
