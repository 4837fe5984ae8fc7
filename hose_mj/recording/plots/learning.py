"""Learning curves: a mean over seeds in a band, one panel for each measure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, PercentFormatter
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.recording.plots.axes import check_some, set_log
from hose_mj.recording.plots.labels import label_line_ends
from hose_mj.recording.plots.style import DASHES, choose_looks, encode_png, make_figure

PANEL = (4.6, 3.5)
"""Width and height of a panel (inches)."""


@dataclass(frozen=True)
class Curve:
    """One line; values that are not finite are left out.

    Attributes:
        x: (k,).
        middle: (k,).
        low, high: its band (k,).
    """

    x: ArrayLike
    middle: ArrayLike
    low: ArrayLike
    high: ArrayLike


@dataclass(frozen=True)
class Panel:
    """One measure of all learners.

    Attributes:
        name: of the measure, with its unit.
        curves: by label; the same labels in all panels.
        scale: "share" from 0 to 1, "log" or "linear".
    """

    name: str
    curves: Mapping[str, Curve]
    scale: Literal["share", "log", "linear"] = "linear"


def plot_learning(title: str, xlabel: str, panels: Sequence[Panel]) -> bytes:
    """Draws panels side by side; each line's name stands at its end, in the last panel.

    Each line has dashes of its own, so that one shows through another that lies over it.

    Raises:
        InputError: no panel, one without curves, or arrays of different lengths.
    """
    check_some("panels", panels)
    labels = list(dict.fromkeys(label for panel in panels for label in panel.curves))
    check_some("curves", labels)
    looks = choose_looks(labels)
    width, height = PANEL
    with make_figure((width * len(panels) + 1.2, height), title) as figure:
        rows = np.atleast_1d(figure.subplots(1, len(panels)))
        ends = []
        for axes, panel in zip(rows, panels, strict=True):
            for place, (label, curve) in enumerate(panel.curves.items()):
                x, middle, low, high = _check_curve(label, curve)
                look = looks[label]
                axes.fill_between(x, low, high, color=look.color, alpha=0.18, lw=0.0)
                axes.plot(x, middle, color=look.color, ls=DASHES[place % len(DASHES)])
                if axes is rows[-1] and len(middle):
                    ends.append((float(middle[-1]), label, look.ink))
            _set_axes(axes, xlabel, panel)
        figure.draw_without_rendering()
        label_line_ends(rows[-1], ends)
        return encode_png(figure)


def _set_axes(axes: Axes, xlabel: str, panel: Panel) -> None:
    axes.set_xlabel(xlabel)
    axes.set_ylabel(panel.name)
    axes.set_xlim(0.0, max(float(np.max(curve.x)) for curve in panel.curves.values()))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    if panel.scale == "log":
        set_log(axes, x=False, y=True)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.6g}"))
    elif panel.scale == "share":
        axes.set_ylim(-0.02, 1.02)
        axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0, symbol=" %"))


def _check_curve(label: str, curve: Curve) -> list[np.ndarray[tuple[int], np.dtype[np.float64]]]:
    parts = [np.asarray(part, float) for part in (curve.x, curve.middle, curve.low, curve.high)]
    if any(part.ndim != 1 or part.shape != parts[0].shape for part in parts):
        shapes = tuple(part.shape for part in parts)
        raise InputError(f"shapes of {label!r}", shapes, "four of shape (k,)")
    kept = np.all(np.isfinite(parts), axis=0)
    return [part[kept] for part in parts]
