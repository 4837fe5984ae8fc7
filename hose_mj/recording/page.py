"""Self-contained HTML pages: a report that opens from a file, without scripts or a network.

    page = Page("GEDS against MuJoCo", subtitle="...")
    case = page.section("Heavy cantilever")
    case.paragraph("A rod under its own weight, `gamma = 10`.")
    case.figure(png, alt="...", caption="...")
    page.write(path)

All text is escaped. In running text `code` and **strong** are marked as in Markdown.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from hose_mj.checks import Check
from hose_mj.errors import InputError
from hose_mj.recording.files import write_atomically
from hose_mj.recording.page_checks import format_checks
from hose_mj.recording.page_parts import (
    Picture,
    format_cell,
    format_picture,
    format_text,
    format_value,
    is_numeric,
)
from hose_mj.recording.page_style import CSS

__all__ = ["Block", "Fold", "Page", "Picture", "Section"]


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
                raise InputError(
                    f"length of row {number}", len(row), f"{len(header)}, as the header"
                )
        cells = [[format_value(value) for value in row] for row in rows]
        right = [is_numeric([row[column] for row in cells]) for column in range(len(header))]
        head = "".join(format_cell("th", text, r) for text, r in zip(header, right, strict=True))
        rows_of_cells = [
            "".join(format_cell("td", text, r) for text, r in zip(row, right, strict=True))
            for row in cells
        ]
        body = "".join(f"<tr>{row}</tr>\n" for row in rows_of_cells)
        title = f"<caption>{format_text(caption)}</caption>" if caption else ""
        self._parts.append(
            f'<div class="scroll"><table>{title}<thead><tr>{head}</tr></thead>\n'
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
        contents = f'<nav aria-label="Contents"><ol>{entries}</ol></nav>' if entries else ""
        subtitle = f'<p class="subtitle">{format_text(self.subtitle)}</p>' if self.subtitle else ""
        footer = f"<footer>{format_text(self.footer)}</footer>" if self.footer else ""
        return "\n".join(
            [
                '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8"/>',
                '<meta name="viewport" content="width=device-width, initial-scale=1"/>',
                f"<title>{escape(self.title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n<main>",
                f"<header><h1>{format_text(self.title)}</h1>{subtitle}</header>",
                super().render(),
                contents,
                *(section.render() for section in self.sections),
                f"{footer}\n</main>\n</body>\n</html>\n",
            ]
        )

    def write(self, path: Path) -> None:
        """Writes the page; a reader sees the old file or the whole new one."""
        write_atomically(Path(path), self.render().encode("utf-8"))
