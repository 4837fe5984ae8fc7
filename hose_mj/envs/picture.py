"""`Picture`: what a moment of a task looks like, as data, in characters and as an image.

Coordinates are cells: x to the right, y upwards, the centre of a cell at whole numbers.
"""

import functools
from dataclasses import dataclass
from math import ceil, dist, floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float]
Rgb = tuple[int, int, int]

SOURCE, GOAL, STATION, ROBOT, TAXI, PASSENGER = (
    *("source", "goal", "station", "robot", "taxi", "passenger"),
)
"""The kinds of marks."""

AGENT_COLORS: tuple[Rgb, ...] = (
    *((0, 114, 178), (213, 94, 0), (0, 138, 99), (160, 80, 140)),
    *((47, 132, 168), (176, 124, 0), (90, 80, 170), (96, 96, 96)),
)
"""One colour per agent, in the order of their numbers; told apart with any colour blindness."""


@dataclass(frozen=True)
class Mark:
    """Something that stands on a cell: its kind, place, label of at most two characters, colour."""

    kind: str
    at: Point
    label: str = ""
    color: Rgb = (90, 90, 90)


@dataclass(frozen=True)
class Picture:
    """A grid and what is on it."""

    corner: tuple[int, int]  # cell in the lower left corner
    # columns, rows: size of the grid in cells.
    columns: int
    rows: int
    marks: tuple[Mark, ...]  # drawn in this order
    # Corners of its centre line, from one end to the other; empty without a hose.
    hose: tuple[Point, ...] = ()
    # Segments between cells, each two points (on half-integers).
    walls: tuple[tuple[Point, Point], ...] = ()
    # Sides of cells that a flag marks as blocked: a point on the side and the cell's centre.
    flags: tuple[tuple[Point, Point], ...] = ()
    caption: str = ""  # a line of text below the grid


# In characters

_LETTERS = {GOAL: "G", SOURCE: "S", STATION: "", ROBOT: "", TAXI: "", PASSENGER: "p"}


def write_picture(picture: Picture) -> str:
    """Returns the picture as lines of text, the caption last.

    A robot is its number, the goal G, the source S, the hose ``*``, an empty cell a dot; walls are
    bars and dashes. Of marks that share a cell the last one shows, a passenger behind what carries
    him.
    """
    cells: dict[tuple[int, int], str] = {}
    for start, end in zip(picture.hose, picture.hose[1:], strict=False):
        for point in _walk(start, end):
            cells[point] = "*"
    for mark in picture.marks:
        cell = _round_to_cell(mark.at)
        before = cells.get(cell, "")
        letter = _LETTERS[mark.kind] + mark.label
        cells[cell] = before[:1] + letter[:1] if mark.kind == PASSENGER else letter
    lines = []
    left, bottom = picture.corner
    columns = range(left, left + picture.columns)
    for row in reversed(range(bottom, bottom + picture.rows)):
        texts = [cells.get((column, row), ".").ljust(2) for column in columns]
        if picture.walls:
            lines.append(_write_walls(picture, row + 0.5, columns))
            ends = [_has_wall(picture, (column + 0.5, row)) for column in columns]
            texts = [text + ("|" if end else " ") for text, end in zip(texts, ends, strict=True)]
            texts.insert(0, "|" if _has_wall(picture, (left - 0.5, row)) else " ")
        lines.append(" ".join(texts).rstrip() if picture.walls else "".join(texts).rstrip())
    if picture.walls:
        lines.append(_write_walls(picture, bottom - 0.5, columns))
    return "\n".join([*lines, picture.caption])


def _write_walls(picture: Picture, height: float, columns: range) -> str:
    """A line between two rows: dashes where a wall lies."""
    sides = ["+---" if _has_wall(picture, (column, height)) else "+   " for column in columns]
    return "".join(sides) + "+"


def _has_wall(picture: Picture, middle: Point) -> bool:
    """Whether a wall runs through the middle of a side."""
    return any(
        min(a[0], b[0]) <= middle[0] <= max(a[0], b[0])
        and min(a[1], b[1]) <= middle[1] <= max(a[1], b[1])
        for a, b in picture.walls
    )


def _round_to_cell(point: Point) -> tuple[int, int]:
    return floor(point[0] + 0.5), floor(point[1] + 0.5)


def _walk(start: Point, end: Point) -> list[tuple[int, int]]:
    """Cells along a segment, sampled four times a cell."""
    steps = max(1, ceil(4 * dist(start, end)))
    shares = [k / steps for k in range(steps + 1)]
    return [_round_to_cell(tuple(a + t * (b - a) for a, b in zip(start, end))) for t in shares]  # type: ignore[arg-type]  # noqa: B905


# As an image: drawn twice as large with Pillow, loaded at the first one, and then averaged

_PAPER, _FLOOR, _GRID = (255, 255, 255), (247, 248, 250), (224, 227, 232)
_INK, _HOSE, _HOSE_RIM, _FLAG = (40, 44, 52), (196, 165, 92), (110, 88, 38), (214, 39, 40)
_WIDTH = 510
_FINE = 2  # drawn so many times larger


def draw_picture(picture: Picture, cell: int | None = None) -> NDArray[np.uint8]:
    """Returns the image of a picture, (height, width, 3); by default about 500 pixels wide.

    `cell` is the side of a cell (pixels).
    """
    if cell is None:
        cell = min(max(_WIDTH // picture.columns, 8), 96)
    sheet = _Sheet(picture, _FINE * cell)
    sheet.draw_floor()
    flat = [mark for mark in picture.marks if mark.kind in (GOAL, STATION)]
    for mark in flat:
        sheet.draw_mark(mark)
    sheet.draw_walls()
    sheet.draw_hose()
    for flag in picture.flags:
        sheet.draw_flag(*flag)
    for mark in picture.marks:
        if mark not in flat:
            sheet.draw_mark(mark)
    return sheet.finish()


class _Sheet:
    """The paper that a picture is drawn on, with its scale: `cell` pixels to a cell."""

    def __init__(self, picture: Picture, cell: int) -> None:
        from PIL import Image, ImageDraw

        self.picture, self.cell = picture, cell
        self.margin = max(_FINE * 6, cell // 8) if picture.walls else _FINE * 6
        self.caption_height = _FINE * 30
        self.width, self.height = picture.columns * cell, picture.rows * cell
        size = (self.width + 2 * self.margin, self.height + 2 * self.margin + self.caption_height)
        self.image = Image.new("RGB", size, _PAPER)
        self.pen = ImageDraw.Draw(self.image)

    def place(self, point: Point) -> Point:
        """Returns the pixel of a point given in cells."""
        left, bottom = self.picture.corner
        x = self.margin + (point[0] - left + 0.5) * self.cell
        return x, self.margin + self.height - (point[1] - bottom + 0.5) * self.cell

    def box(self, at: Point, half: float) -> tuple[float, float, float, float]:
        """Returns the square around a point, `half` cells to each side, in pixels."""
        (x, y), reach = self.place(at), half * self.cell
        return x - reach, y - reach, x + reach, y + reach

    def write(self, at: Point, text: str, size: float, color: Rgb) -> None:
        """Writes a label centred on a point, `size` cells high."""
        font = _load_font(int(size * self.cell))
        self.pen.text(self.place(at), text, fill=color, font=font, anchor="mm")

    def draw_floor(self) -> None:
        """Draws the grid and its frame."""
        m, right, bottom = self.margin, self.margin + self.width, self.margin + self.height
        self.pen.rectangle((m, m, right, bottom), fill=_FLOOR)
        for x in range(m, right + 1, self.cell):
            self.pen.line((x, m, x, bottom), fill=_GRID, width=_FINE)
        for y in range(m, bottom + 1, self.cell):
            self.pen.line((m, y, right, y), fill=_GRID, width=_FINE)
        self.pen.rectangle((m, m, right, bottom), outline=_INK, width=_FINE)

    def draw_walls(self) -> None:
        """Draws the walls as thick bars."""
        half = max(_FINE, self.cell // 24)
        for ends in self.picture.walls:
            (x0, y0), (x1, y1) = sorted(map(self.place, ends))
            box = (x0 - half, min(y0, y1) - half, x1 + half, max(y0, y1) + half)
            self.pen.rectangle(box, fill=_INK)

    def draw_hose(self) -> None:
        """Draws the hose with a darker rim."""
        points = [self.place(point) for point in self.picture.hose]
        for color, width in ((_HOSE_RIM, 0.30), (_HOSE, 0.18)) if len(points) > 1 else ():
            self.pen.line(points, fill=color, width=int(width * self.cell), joint="curve")

    def draw_flag(self, side: Point, centre: Point) -> None:
        """Draws a bar along the side of a cell, a little inside it."""
        across = (side[0] - centre[0], side[1] - centre[1])
        along = (0.6 * across[1], 0.6 * across[0])
        inset = 0.87 if self.picture.walls else 0.94  # a wall is thick
        inside = (centre[0] + inset * across[0], centre[1] + inset * across[1])
        ends = [self.place((inside[0] + s * along[0], inside[1] + s * along[1])) for s in (-1, 1)]
        self.pen.line([*ends[0], *ends[1]], fill=_FLAG, width=max(_FINE * 2, self.cell // 11))

    def draw_mark(self, mark: Mark) -> None:
        """Draws a mark and its label."""
        pen, at, color, thin = self.pen, mark.at, mark.color, max(_FINE, self.cell // 20)
        label_at, label_size, label_color = at, 0.5, _PAPER
        if mark.kind in (STATION, GOAL):
            pale = tuple(round(0.72 * 255 + 0.28 * part) for part in color)
            pen.rectangle(self.box(at, 0.46), fill=pale)
            label_color = color
        if mark.kind == STATION:
            label_at, label_size = (at[0] - 0.28, at[1] + 0.25), 0.3
        elif mark.kind == GOAL:
            for half in (0.44,) if mark.label else (0.34, 0.16):
                pen.ellipse(self.box(at, half), outline=color, width=2 * thin)
        elif mark.kind == SOURCE:
            pen.rectangle(self.box(at, 0.36), fill=_INK)
        elif mark.kind == TAXI:
            box = self.box(at, 0.34)
            pen.rounded_rectangle(box, 0.12 * self.cell, fill=color, outline=_INK, width=thin)
            label_at, label_size = (at[0], at[1] + 0.14), 0.3
        else:
            half, label_size = (0.13, 0.18) if mark.kind == PASSENGER else (0.40, 0.56)
            pen.ellipse(self.box(at, half), fill=color, outline=_PAPER, width=thin)
        self.write(label_at, mark.label, label_size, label_color)

    def finish(self) -> NDArray[np.uint8]:
        """Writes the caption and returns the image, its pixels averaged."""
        below = self.image.height - self.caption_height / 2 - _FINE * 2
        font, caption = _load_font(_FINE * 14), self.picture.caption
        self.pen.text((self.margin, below), caption, fill=_INK, font=font, anchor="lm")
        return np.array(self.image.reduce(_FINE))


@functools.cache
def _load_font(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size)
