"""One look for every plot: fonts, thin grids, colours by model, labels that do not overlap."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from hose_mj.recording.palette import MARKERS, find_color, find_model, format_hex

DPI = 150
STYLE: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 10.0,
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.edgecolor": "#444444",
    "axes.labelcolor": "#222222",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.5,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.6,
    "lines.markersize": 5.5,
    "legend.frameon": False,
    "legend.handlelength": 3.4,
    "legend.fontsize": 8.5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}
_DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))


@dataclass(frozen=True)
class Look:
    """How one group is drawn: "#rrggbb", marker, dash pattern."""

    color: str
    marker: str
    dashes: Any


def choose_looks(labels: Sequence[str]) -> dict[str, Look]:
    """Gives each label its model's colour and marker; labels of one model differ in dashes."""
    looks: dict[str, Look] = {}
    seen: dict[str | None, int] = {}
    for label in labels:
        model = find_model(label)
        count = seen.get(model, 0)
        seen[model] = count + 1
        color = format_hex(find_color(label, count))
        dashes = "-" if model is None else _DASHES[count % len(_DASHES)]
        looks[label] = Look(color, MARKERS.get(model or "", "v"), dashes)
    return looks


@contextmanager
def make_axes(title: str, size: tuple[float, float]) -> Iterator[tuple[Figure, Axes]]:
    """A figure of `size` inches with one axes, in the house style; no global state is touched."""
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        axes.set_title(title)
        yield figure, axes


def encode_png(figure: Figure) -> bytes:
    """Returns the figure as PNG; the same figure gives the same bytes."""
    sink = io.BytesIO()
    figure.savefig(sink, format="png", dpi=DPI, metadata={"Software": None})
    return sink.getvalue()


def add_legend(axes: Axes, handles: Sequence[Any] | None = None) -> None:
    """Puts the legend to the right of the axes, where it hides no data."""
    items = axes.get_legend_handles_labels()[0] if handles is None else list(handles)
    if items:
        axes.legend(handles=items, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


def label_line_ends(axes: Axes, ends: Sequence[tuple[float, str, str]]) -> None:
    """Writes each line's name right of the axes at the height of its last point, pushed apart.

    Args:
        axes: limits must be final.
        ends: last value, text, "#rrggbb".
    """
    if not ends:
        return
    heights = axes.transData.transform([(axes.get_xlim()[1], value) for value, _, _ in ends])[:, 1]
    low, high = axes.transAxes.transform([(0, 0), (0, 1)])[:, 1]
    fractions = spread_apart((heights - low) / (high - low), 13.0 * DPI / 72.0 / (high - low))
    for (_, text, color), fraction in zip(ends, fractions, strict=True):
        axes.annotate(
            text,
            (1.0, fraction),
            xycoords="axes fraction",
            xytext=(5, 0),
            textcoords="offset points",
            color=color,
            va="center",
            fontsize=8.5,
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
    labels: Sequence[tuple[float, float, str, str]],
    lines: Sequence[tuple[Any, Any]] = (),
) -> int:
    """Writes small labels beside points where there is room, and returns how many found it.

    Args:
        figure: of the axes.
        axes: limits must be final.
        labels: x, y, text, "#rrggbb".
        lines: x (k,) and y (k,) of lines that labels keep off.
    """
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    taken = _cover([axes.transData.transform([(x, y)]) for x, y, _, _ in labels], 3.5 * DPI / 72.0)
    paths = [axes.transData.transform(np.column_stack([x, y])) for x, y in lines]
    taken += _cover([_refine(path, 4.0) for path in paths], 1.0)
    offsets = [(5, 4), (5, -4), (-5, 4), (-5, -4), (0, 8), (0, -8), (8, 0), (-8, 0)]
    offsets += [(14, 8), (14, -8), (-14, 8), (-14, -8), (0, 18), (0, -18)]
    n_placed = 0
    for x, y, text, color in labels:
        for dx, dy in offsets:
            note = axes.annotate(
                text,
                (x, y),
                xytext=(dx, dy),
                textcoords="offset points",
                ha="left" if dx > 0 else "right" if dx < 0 else "center",
                va="bottom" if dy > 0 else "top" if dy < 0 else "center",
                fontsize=7.0,
                color=color,
            )
            box = note.get_window_extent(renderer)
            if box.count_overlaps(taken) == 0 and _holds(axes.bbox, box):
                taken.append(Bbox(box.get_points()))
                n_placed += 1
                break
            note.remove()
    return n_placed


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
