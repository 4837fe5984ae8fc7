"""Draws a `Picture` as an RGB image: plain shapes, drawn twice as large and then averaged."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from hose_mj.envs.picture import (
    GOAL,
    PASSENGER,
    ROBOT,
    SOURCE,
    STATION,
    TAXI,
    Mark,
    Picture,
    Point,
    Rgb,
)

_PAPER, _FLOOR, _GRID = (255, 255, 255), (247, 248, 250), (224, 227, 232)
_INK, _HOSE, _HOSE_RIM, _FLAG = (40, 44, 52), (196, 165, 92), (110, 88, 38), (214, 39, 40)
_WIDTH = 510
_FINE = 2  # drawn so many times larger


class Raster:
    """A sheet of paper with the scale of one picture.

    Args:
        picture: what is to be drawn.
        cell: side of a cell in the finished image (pixels).
    """

    def __init__(self, picture: Picture, cell: int) -> None:
        self.cell = _FINE * cell
        self.margin = max(_FINE * 6, self.cell // 8) if picture.walls else _FINE * 6
        self.caption_height = _FINE * 30
        self.picture = picture
        width = picture.columns * self.cell + 2 * self.margin
        self.grid_height = picture.rows * self.cell
        height = self.grid_height + 2 * self.margin + self.caption_height
        self.image = Image.new("RGB", (width, height), _PAPER)
        self.pen = ImageDraw.Draw(self.image)

    def place(self, point: Point) -> Point:
        """Returns the pixel of a point given in cells."""
        left, bottom = self.picture.corner
        x = self.margin + (point[0] - left + 0.5) * self.cell
        return x, self.margin + self.grid_height - (point[1] - bottom + 0.5) * self.cell

    def box(self, at: Point, half: float) -> tuple[float, float, float, float]:
        """Returns the square around a point, `half` cells to each side, in pixels."""
        x, y = self.place(at)
        return (
            x - half * self.cell,
            y - half * self.cell,
            x + half * self.cell,
            y + half * self.cell,
        )

    def write(self, at: Point, text: str, size: float, color: Rgb) -> None:
        """Writes a label centred on a point, `size` cells high."""
        font = _find_font(int(size * self.cell))
        self.pen.text(self.place(at), text, fill=color, font=font, anchor="mm")


def draw_picture(picture: Picture, cell: int | None = None) -> NDArray[np.uint8]:
    """Returns the image of a picture, (height, width, 3).

    Args:
        picture: what is to be drawn.
        cell: side of a cell (pixels); None for a grid about 500 pixels wide.
    """
    if cell is None:
        cell = min(max(_WIDTH // picture.columns, 8), 96)
    raster = Raster(picture, cell)
    _draw_floor(raster)
    for mark in picture.marks:
        if mark.kind in (GOAL, STATION):
            _draw_mark(raster, mark)
    _draw_walls(raster)
    _draw_hose(raster)
    for flag in picture.flags:
        _draw_flag(raster, *flag)
    for mark in picture.marks:
        if mark.kind not in (GOAL, STATION):
            _draw_mark(raster, mark)
    font = _find_font(_FINE * 14)
    below = raster.image.height - raster.caption_height / 2 - _FINE * 2
    raster.pen.text((raster.margin, below), picture.caption, fill=_INK, font=font, anchor="lm")
    return np.array(raster.image.reduce(_FINE))


def _find_font(size: int) -> Any:
    if size not in _FONTS:
        _FONTS[size] = ImageFont.load_default(size)
    return _FONTS[size]


_FONTS: dict[int, Any] = {}


def _draw_floor(raster: Raster) -> None:
    picture, m = raster.picture, raster.margin
    width, height = picture.columns * raster.cell, raster.grid_height
    raster.pen.rectangle((m, m, m + width, m + height), fill=_FLOOR)
    for column in range(picture.columns + 1):
        x = m + column * raster.cell
        raster.pen.line((x, m, x, m + height), fill=_GRID, width=_FINE)
    for row in range(picture.rows + 1):
        y = m + row * raster.cell
        raster.pen.line((m, y, m + width, y), fill=_GRID, width=_FINE)
    raster.pen.rectangle((m, m, m + width, m + height), outline=_INK, width=_FINE)


def _draw_walls(raster: Raster) -> None:
    half = max(_FINE, raster.cell // 24)
    for start, end in raster.picture.walls:
        (x0, y0), (x1, y1) = sorted((raster.place(start), raster.place(end)))
        box = (x0 - half, min(y0, y1) - half, x1 + half, max(y0, y1) + half)
        raster.pen.rectangle(box, fill=_INK)


def _draw_hose(raster: Raster) -> None:
    points = [raster.place(point) for point in raster.picture.hose]
    if len(points) < 2:
        return
    for color, width in ((_HOSE_RIM, 0.30), (_HOSE, 0.18)):
        raster.pen.line(points, fill=color, width=int(width * raster.cell), joint="curve")


def _draw_flag(raster: Raster, side: Point, centre: Point) -> None:
    """A bar along the side of a cell, a little inside it."""
    across = (side[0] - centre[0], side[1] - centre[1])
    along = (0.6 * across[1], 0.6 * across[0])
    inset = 0.87 if raster.picture.walls else 0.94  # a wall is thick
    inside = (centre[0] + inset * across[0], centre[1] + inset * across[1])
    ends = [raster.place((inside[0] + s * along[0], inside[1] + s * along[1])) for s in (-1, 1)]
    raster.pen.line([*ends[0], *ends[1]], fill=_FLAG, width=max(_FINE * 2, raster.cell // 11))


def _draw_mark(raster: Raster, mark: Mark) -> None:
    pen, thin = raster.pen, max(_FINE, raster.cell // 20)
    if mark.kind == STATION:
        pen.rectangle(raster.box(mark.at, 0.46), fill=_pale(mark.color))
        raster.write((mark.at[0] - 0.28, mark.at[1] + 0.25), mark.label, 0.3, mark.color)
    elif mark.kind == GOAL:
        pen.rectangle(raster.box(mark.at, 0.46), fill=_pale(mark.color))
        for half in (0.44,) if mark.label else (0.34, 0.16):
            pen.ellipse(raster.box(mark.at, half), outline=mark.color, width=2 * thin)
        raster.write(mark.at, mark.label, 0.5, mark.color)
    elif mark.kind == SOURCE:
        pen.rectangle(raster.box(mark.at, 0.36), fill=_INK)
        raster.write(mark.at, mark.label, 0.5, _PAPER)
    elif mark.kind == PASSENGER:
        pen.ellipse(raster.box(mark.at, 0.13), fill=mark.color, outline=_PAPER, width=thin)
        raster.write(mark.at, mark.label, 0.18, _PAPER)
    elif mark.kind == TAXI:
        box = raster.box(mark.at, 0.34)
        pen.rounded_rectangle(box, 0.12 * raster.cell, fill=mark.color, outline=_INK, width=thin)
        raster.write((mark.at[0], mark.at[1] + 0.14), mark.label, 0.3, _PAPER)
    elif mark.kind == ROBOT:
        pen.ellipse(raster.box(mark.at, 0.40), fill=mark.color, outline=_PAPER, width=thin)
        raster.write(mark.at, mark.label, 0.56, _PAPER)


def _pale(color: Rgb) -> Rgb:
    red, green, blue = (round(0.72 * 255 + 0.28 * part) for part in color)
    return red, green, blue
