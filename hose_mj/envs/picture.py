"""`Picture`: what a moment of a task looks like, as data; drawn by `raster` or written by `text`.

Coordinates are cells: x to the right, y upwards, the centre of a cell at whole numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    """Something that stands on a cell.

    Attributes:
        kind: `SOURCE`, `GOAL`, `STATION`, `ROBOT`, `TAXI` or `PASSENGER`.
        at: where it stands.
        label: its number or letter, in at most two characters.
        color: red, green, blue, 0 to 255.
    """

    kind: str
    at: Point
    label: str = ""
    color: Rgb = (90, 90, 90)


@dataclass(frozen=True)
class Picture:
    """A grid and what is on it.

    Attributes:
        corner: cell in the lower left corner.
        columns, rows: size of the grid in cells.
        marks: drawn in this order.
        hose: corners of its centre line, from one end to the other; empty without a hose.
        walls: segments between cells, each two points (on half-integers).
        flags: sides of cells that a flag marks as blocked: a point on the side and the cell's
            centre.
        caption: a line of text below the grid.
    """

    corner: tuple[int, int]
    columns: int
    rows: int
    marks: tuple[Mark, ...]
    hose: tuple[Point, ...] = ()
    walls: tuple[tuple[Point, Point], ...] = ()
    flags: tuple[tuple[Point, Point], ...] = ()
    caption: str = ""
