"""One look for every plot: fonts, thin grids, colours by model, figures as PNG bytes."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hose_mj.recording.plots.palette import MARKERS, darken, find_color, find_model, format_hex

DPI = 150
SOFT = "#666666"
"""Colour of guides' names and other text that stands back."""
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
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.6,
    "lines.markersize": 5.5,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.6,
    "legend.fontsize": 8.5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}
DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
"""Dash patterns that tell lines apart."""


@dataclass(frozen=True)
class Look:
    """How one group is drawn: "#rrggbb", the same for text, marker, dash pattern."""

    color: str
    ink: str
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
        color = find_color(label, count)
        dashes = "-" if model is None else DASHES[count % len(DASHES)]
        looks[label] = Look(
            format_hex(color), format_hex(darken(color)), MARKERS.get(model or "", "."), dashes
        )
    return looks


@contextmanager
def make_figure(size: tuple[float, float], title: str = "") -> Iterator[Figure]:
    """A figure of `size` inches in the house style; no global state is touched."""
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        if title:
            figure.suptitle(title, x=0.01, ha="left", fontsize=11.0, fontweight="bold")
        yield figure


@contextmanager
def make_axes(title: str, size: tuple[float, float]) -> Iterator[tuple[Figure, Axes]]:
    """A figure with one axes."""
    with make_figure(size, title) as figure:
        yield figure, figure.add_subplot()


def encode_png(figure: Figure) -> bytes:
    """Returns the figure as PNG; the same figure gives the same bytes."""
    sink = io.BytesIO()
    figure.savefig(sink, format="png", dpi=DPI, metadata={"Software": None})
    return sink.getvalue()


def add_legend(owner: Figure, handles: Sequence[Any], columns: int = 4) -> None:
    """Puts the legend below the axes of a figure, where it hides no data."""
    if handles:
        owner.legend(handles=list(handles), loc="outside lower left", ncols=columns)
