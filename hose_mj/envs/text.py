"""Writes a `Picture` in characters, two to a cell."""

from __future__ import annotations

from math import ceil, dist, floor

from hose_mj.envs.picture import GOAL, PASSENGER, ROBOT, SOURCE, STATION, TAXI, Picture, Point

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
        cell = _find_cell(mark.at)
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


def _find_cell(point: Point) -> tuple[int, int]:
    return floor(point[0] + 0.5), floor(point[1] + 0.5)


def _walk(start: Point, end: Point) -> list[tuple[int, int]]:
    """Cells along a segment, sampled four times a cell."""
    steps = max(1, ceil(4 * dist(start, end)))
    shares = [k / steps for k in range(steps + 1)]
    return [_find_cell(tuple(a + t * (b - a) for a, b in zip(start, end))) for t in shares]  # type: ignore[arg-type]  # noqa: B905
