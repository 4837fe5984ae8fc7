"""Bars with intervals beside the values that others found, a panel for each data set."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import PercentFormatter

from hose_mj.recording.palette import find_color, format_hex
from hose_mj.recording.plots.style import (
    SOFT,
    add_legend,
    check_some,
    encode_png,
    make_figure,
    write_note,
)

HEIGHT = 0.38  # room of an item over all its bars, in inches
FILLED = 0.8  # part of that room which the bars fill


@dataclass(frozen=True)
class Bar:
    """A share between 0 and 1."""

    value: float  # its length; NaN for no bar
    interval: float = math.nan  # half width of its interval; NaN for none
    reference: float | None = None  # what others found; None for nothing
    sure: bool = True  # whether the reference can be right as printed; its mark is hollow if not


@dataclass(frozen=True)
class BarPanel:
    """One data set."""

    title: str  # above its axes
    series: Mapping[str, Sequence[Bar]]  # label to one bar for each item
    # A share to draw a line at, with its name; None for no line.
    guide: tuple[float, str] | None = None


def plot_bars(items: Sequence[str], panels: Sequence[BarPanel], reference: str) -> bytes:
    """Draws horizontal bars in groups, the first item at the top; returns a PNG.

    Args:
        items: their names, written at the left.
        panels: side by side; all have the same series.
        reference: what the marks are that stand beside the bars.
    """
    check_some("items", items)
    check_some("panels", panels)
    size = (2.0 + 3.6 * len(panels), 1.3 + HEIGHT * len(items))
    with make_figure(size) as figure:
        row = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for axes, panel in zip(row, panels, strict=True):
            _draw_panel(axes, panel, len(items))
        row[0].set_yticks(range(len(items)), items)
        row[0].invert_yaxis()
        labels = list(panels[0].series)
        handles = [Patch(color=_choose_color(k), label=name) for k, name in enumerate(labels)]
        marks = [_make_mark("black", reference)]
        bars = [bar for panel in panels for series in panel.series.values() for bar in series]
        if any(not bar.sure for bar in bars):
            marks.append(_make_mark("white", "misprinted there"))
        add_legend(figure, [*handles, *marks])
        return encode_png(figure)


def _choose_color(place: int) -> str:
    return format_hex(find_color("", place + 1))


def _make_mark(inside: str, label: str) -> Line2D:
    return Line2D([], [], color="black", marker="D", markersize=4, mfc=inside, ls="", label=label)


def _draw_panel(axes: Axes, panel: BarPanel, n_items: int) -> None:
    height = FILLED / len(panel.series)
    for k, bars in enumerate(panel.series.values()):
        places = np.arange(n_items) + (k + 0.5) * height - FILLED / 2.0
        values = np.array([bar.value for bar in bars])
        intervals = np.array([bar.interval for bar in bars])
        axes.barh(places, values, height, color=_choose_color(k))
        known = np.isfinite(values) & np.isfinite(intervals)
        # An interval may not leave the shares that exist.
        left = np.minimum(intervals, values)[known]
        right = np.minimum(intervals, 1.0 - values)[known]
        style: Any = {"fmt": "none", "ecolor": "#333333", "elinewidth": 0.9, "capsize": 1.6}
        axes.errorbar(values[known], places[known], xerr=[left, right], **style)
        for bar, y in zip(bars, places, strict=True):
            if bar.reference is not None:
                inside, edge = ("black", "white") if bar.sure else ("white", "black")
                mark: dict[str, Any] = {"markersize": 3.2, "mfc": inside, "mec": edge}
                axes.plot(bar.reference, y, "D", **mark, mew=0.5, zorder=4)
    axes.set_title(panel.title)
    axes.set_xlim(0.0, 1.02)
    axes.set_ylim(-0.6, n_items - 0.4)
    axes.xaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    if panel.guide is not None:
        at, name = panel.guide
        axes.axvline(at, color=SOFT, lw=0.9, ls=(0, (4, 3)), zorder=3)
        where: Any = {"xycoords": ("data", "axes fraction"), "xytext": (0, -26), "ha": "center"}
        write_note(axes, name, (at, 0.0), **where)
