"""Texts in plots that do not overlap: beside points, and at the ends of lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from hose_mj.recording.plots.style import DPI

HALO = (withStroke(linewidth=2.2, foreground="white"),)
"""Keeps small text readable over faint points and lines."""


@dataclass(frozen=True)
class Label:
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
        axes: limits must be final.
        ends: last value, text, "#rrggbb".
        fontsize: of the names (points).
    """
    if not ends:
        return
    heights = axes.transData.transform([(axes.get_xlim()[1], value) for value, _, _ in ends])[:, 1]
    low, high = axes.transAxes.transform([(0, 0), (0, 1)])[:, 1]
    gap = 1.45 * fontsize * DPI / 72.0 / (high - low)
    fractions = spread_apart((heights - low) / (high - low), gap)
    for (_, text, ink), fraction in zip(ends, fractions, strict=True):
        axes.annotate(
            text,
            (1.0, fraction),
            xycoords="axes fraction",
            xytext=(5, 0),
            textcoords="offset points",
            color=ink,
            va="center",
            fontsize=fontsize,
        )


def spread_apart(places: Any, gap: float) -> list[float]:
    """Moves places in [0, 1] by the least sum of squares that sets them `gap` apart.

    Less gap * rank, sorted places need only not fall: isotonic regression, by pooling neighbours.
    """
    places = np.clip(np.asarray(places, dtype=float), 0.0, 1.0)
    order = np.argsort(places, kind="stable")
    ranks = gap * np.arange(len(places))
    pools: list[list[float]] = []
    for value in places[order] - ranks:
        pools.append([float(value)])
        while len(pools) > 1 and np.mean(pools[-2]) > np.mean(pools[-1]):
            pools[-2:] = [pools[-2] + pools[-1]]
    level = np.concatenate([np.full(len(pool), np.mean(pool)) for pool in pools])
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
        texts: already drawn, kept off as well.
    """
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    taken = _cover([axes.transData.transform([(label.x, label.y)]) for label in labels], 7.0)
    paths = [axes.transData.transform(np.column_stack([x, y])) for x, y in lines]
    taken += _cover([_refine(path, 4.0) for path in paths], 1.0)
    taken += [Bbox(text.get_window_extent(renderer).get_points()) for text in texts]
    n_placed = 0
    for label in labels:
        for offset in _list_offsets(label.side):
            note = _write(axes, label, offset)
            box = note.get_window_extent(renderer)
            if box.count_overlaps(taken) == 0 and _holds(axes.bbox, box):
                taken.append(Bbox(box.get_points()))
                n_placed += 1
                break
            note.remove()
    return n_placed


def _list_offsets(side: int) -> list[tuple[int, int]]:
    """Offsets in points from a point to its label, the best first."""
    near = [(6, 3), (6, -3), (8, 0), (0, 8), (0, -8), (-6, 3), (-6, -3), (-8, 0)]
    near += [(14, 8), (14, -8), (0, 18), (0, -18), (-14, 8), (-14, -8)]
    return [(side * dx, dy if side > 0 else -dy) for dx, dy in near]


def _write(axes: Axes, label: Label, offset: tuple[int, int]) -> Text:
    dx, dy = offset
    return axes.annotate(
        label.text,
        (label.x, label.y),
        xytext=offset,
        textcoords="offset points",
        ha="left" if dx > 0 else "right" if dx < 0 else "center",
        va="bottom" if dy > 0 else "top" if dy < 0 else "center",
        fontsize=7.0,
        color=label.ink,
        path_effects=HALO,
        zorder=6,
    )


def _cover(paths: Sequence[Any], half: float) -> list[Bbox]:
    """Squares of side 2 half about points in pixels."""
    return [
        Bbox.from_extents(x - half, y - half, x + half, y + half) for path in paths for x, y in path
    ]


def _refine(path: Any, step: float) -> Any:
    """Points at most about `step` apart along a path (k, 2) in pixels."""
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.linspace(0.0, along[-1], int(along[-1] / step) + 2)
    return np.column_stack([np.interp(places, along, path[:, c]) for c in range(2)])


def _holds(outer: Any, inner: Any) -> bool:
    return bool(
        outer.x0 <= inner.x0
        and inner.x1 <= outer.x1
        and outer.y0 <= inner.y0
        and inner.y1 <= outer.y1
    )
