"""Pieces of HTML pages: text, values, cells, pictures; all escaped."""

from __future__ import annotations

import base64
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from hose_mj.errors import InputError

_PNG = b"\x89PNG\r\n\x1a\n"
_MINUS, _TIMES, _DASH = "\u2212", "\u00d7", "\u2013"
_NUMBER = re.compile(
    rf"[-+{_MINUS}±<>≈~]?\s*(\d[\d\s.,]*|\.\d+|nan|inf)(e[-+{_MINUS}]?\d+)?\s*[%{_TIMES}]?",
    re.IGNORECASE,
)
_DENSITY = 1.5  # dots of a picture per CSS pixel
_BLANKS = {"", "-", _DASH}


@dataclass(frozen=True)
class Picture:
    """PNG bytes with the words for those who cannot see it and those below it."""

    png: bytes
    alt: str
    caption: str = ""


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
    """Whether a column has numbers and, but for blanks, nothing else."""
    filled = [cell.strip() for cell in cells if cell.strip() not in _BLANKS]
    return bool(filled) and all(_NUMBER.fullmatch(cell) for cell in filled)


def format_picture(picture: Picture) -> str:
    """Returns a figure with its PNG inside."""
    if not picture.png.startswith(_PNG):
        raise InputError("png", picture.png[:8], "the bytes of a PNG picture")
    width, height = (round(side / _DENSITY) for side in struct.unpack(">II", picture.png[16:24]))
    caption = f"<figcaption>{format_text(picture.caption)}</figcaption>" if picture.caption else ""
    data = base64.b64encode(picture.png).decode("ascii")
    return (
        f'<figure><div class="card"><img alt="{escape(picture.alt)}" width="{width}" '
        f'height="{height}" src="data:image/png;base64,{data}"/></div>{caption}</figure>'
    )


def format_cell(tag: str, text: str, right: bool) -> str:
    """Returns a table cell."""
    kind = ' class="number"' if right else ""
    return f"<{tag}{kind}>{format_text(text)}</{tag}>"
