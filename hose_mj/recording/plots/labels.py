"""Texts in plots that do not overlap: beside points, and at the ends of lines."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox
from scipy.optimize import isotonic_regression

from hose_mj.recording.plots.style import DPI, HALO, write_note


class Label(NamedTuple):
    """A small text beside a point; `side` is where it would rather stand: -1 left, 1 right."""

    x: float
    y: float
    text: str
    ink: str
    side: int = 1


def label_line_ends(
    axes: Axes, ends: Sequence[tuple[float, str, str]], fontsize: float = 8.5
) -> None:
    """Writes each line's name right of the axes at the height of its last point, pushed apart.

    Args:
        axes: limits and layout must be final.
        ends: last value, text, "#rrggbb".
        fontsize: of the names (points).
    """
    if not ends:
        return
    heights = axes.transData.transform([(axes.get_xlim()[1], value) for value, _, _ in ends])[:, 1]
    low, high = axes.transAxes.transform([(0, 0), (0, 1)])[:, 1]
    gap = 1.45 * fontsize * DPI / 72.0 / (high - low)
    fractions = spread_apart((heights - low) / (high - low), gap)
    where: Any = {"xycoords": "axes fraction", "xytext": (5, 0), "va": "center"}
    for (_, text, ink), fraction in zip(ends, fractions, strict=True):
        write_note(axes, text, (1.0, fraction), color=ink, fontsize=fontsize, **where)


def spread_apart(places: Any, gap: float) -> list[float]:
    """Moves places in [0, 1] by the least sum of squares that sets them `gap` apart.

    Less gap * rank, sorted places need only not fall, which is isotonic regression.
    """
    places = np.clip(np.asarray(places, dtype=float), 0.0, 1.0)
    order, ranks = np.argsort(places, kind="stable"), gap * np.arange(len(places))
    level = isotonic_regression(places[order] - ranks).x
    moved = np.empty_like(level)
    moved[order] = np.clip(level, 0.0, max(0.0, 1.0 - ranks[-1])) + ranks
    return [float(value) for value in moved]


def label_points(
    figure: Figure,
    axes: Axes,
    labels: Sequence[Label],
    lines: Sequence[tuple[Any, Any]] = (),
    texts: Sequence[Text] = (),
) -> int:
    """Writes small labels beside points where there is room, and returns how many found it.

    Args:
        figure: of the axes.
        axes: limits must be final.
        labels: the first come first.
        lines: x (k,) and y (k,) of lines that labels keep off.
        texts: already drawn, kept off as well, with their arrows.
    """
    figure.draw_without_rendering()
    paths = [Path(axes.transData.transform(np.column_stack(line))) for line in lines]
    marks = axes.transData.transform([label[:2] for label in labels] or np.zeros((0, 2)))
    taken = [Bbox([mark - 7.0, mark + 7.0]) for mark in marks]
    taken += [text.get_window_extent() for text in texts]
    n_placed = 0
    for label in labels:
        for note in _try_places(axes, label):
            box = note.get_window_extent()
            inside = axes.bbox.contains(*box.min) and axes.bbox.contains(*box.max)
            crossed = any(path.intersects_bbox(box, filled=False) for path in paths)
            if inside and not crossed and not box.count_overlaps(taken):
                taken.append(box)
                n_placed += 1
                break
            note.remove()
    return n_placed


def _try_places(axes: Axes, label: Label) -> Iterator[Annotation]:
    """Writes a label at ever less handy places; the caller removes it where it does not fit."""
    near = [(6, 3), (6, -3), (8, 0), (0, 8), (0, -8), (-6, 3), (-6, -3), (-8, 0)]
    near += [(14, 8), (14, -8), (0, 18), (0, -18), (-14, 8), (-14, -8)]
    horizontal, vertical = ("center", "left", "right"), ("center", "bottom", "top")
    look: Any = {"color": label.ink, "fontsize": 7.0, "path_effects": HALO, "zorder": 6}
    for dx, dy in near:
        dx, dy = label.side * dx, label.side * dy
        align = {"ha": horizontal[int(np.sign(dx))], "va": vertical[int(np.sign(dy))]}
        yield write_note(axes, label.text, (label.x, label.y), xytext=(dx, dy), **align, **look)
