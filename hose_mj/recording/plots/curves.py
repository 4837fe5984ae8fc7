"""Plots of curves: convergence with orders, numbers over time, learning."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, PercentFormatter
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.recording.episode import Array
from hose_mj.recording.palette import LIMIT, OTHERS, darken, find_model, format_hex, name_model
from hose_mj.recording.plots.labels import label_line_ends
from hose_mj.recording.plots.style import (
    DASHES,
    Look,
    check_pair,
    check_some,
    choose_looks,
    draw_slopes,
    encode_png,
    format_seconds,
    keep_positive,
    label_resolutions,
    make_axes,
    make_figure,
    set_log,
)

_MARKERS = "osD^v"


def plot_convergence(
    title: str,
    xlabel: str,
    groups: Mapping[str, tuple[ArrayLike, ArrayLike]],
    slopes: Sequence[float] = (),
    finer_is_larger: bool = True,
    ylabel: str = "error",
    in_seconds: bool = False,
) -> bytes:
    """Draws error over resolution, both logarithmic; each line's name and slope stand at its end.

    Args:
        title: text.
        xlabel: text.
        groups: label to resolutions (k,) and errors (k,). Labels that share what stands before
            their last comma ("free-free, mode 2") share a colour.
        slopes: drawn as thin guides from the coarsest point of all.
        finer_is_larger: True for numbers of points, False for step sizes.
        ylabel: text.
        in_seconds: y is a time (s), drawn with units; slopes are then of a cost, and rise.
    """
    check_some("groups", groups)
    looks = _choose_looks(list(groups))
    sign = -1.0 if finer_is_larger and not in_seconds else 1.0
    kept = {label: keep_positive(label, x, y) for label, (x, y) in groups.items()}
    ends = []
    with make_axes(title, (7.6, 4.2)) as (figure, axes):
        for label, (x, y) in kept.items():
            look = looks[label]
            axes.plot(x, y, color=look.color, ls=look.dashes, marker=look.marker, ms=4.5, lw=1.3)
            order = measure_order(x, y)
            text = name_model(label) + ("" if order is None else f": {sign * order:.2f}")
            if len(y):
                ends.append((float(y[-1]), text, look.ink))
        set_log(axes, x=True, y=True)
        label_resolutions(axes, np.concatenate([x for x, _ in kept.values()]))
        draw_slopes(axes, kept, slopes, sign, "slope" if in_seconds else "order")
        if in_seconds:
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_seconds(value)))
        axes.set_xlabel(xlabel)
        axes.set_ylabel(ylabel)
        figure.draw_without_rendering()
        label_line_ends(axes, ends, fontsize=8.0)
        return encode_png(figure)


def measure_order(x: Array, y: Array) -> float | None:
    """Returns the least-squares slope of log y over log x, or None with fewer than two points."""
    if len(x) < 2 or np.ptp(x) == 0.0:
        return None
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def plot_series(
    title: str,
    ylabel: str,
    groups: Mapping[str, tuple[ArrayLike, ArrayLike]],
    limits: Mapping[str, float] | None = None,
    xlabel: str = "time (s)",
    is_log: bool = False,
) -> bytes:
    """Draws numbers over time or what else, lines named at their ends.

    `limits` go across with their names. Where `is_log` both axes are logarithmic, and each point of
    a line has a mark and its place on the axis.
    """
    check_some("groups", groups)
    looks = choose_looks(list(groups))
    ends, ink = [], format_hex(LIMIT)
    with make_axes(title, (7.6, 3.3)) as (figure, axes):
        for rank, (label, (times, values)) in enumerate(groups.items()):
            t, y = check_pair(label, times, values)
            width = 1.3 + 1.1 * (len(groups) - 1 - rank) / max(len(groups) - 1, 1)
            mark = _MARKERS[rank % len(_MARKERS)] if is_log else ""
            style = {"color": looks[label].color, "ls": looks[label].dashes, "marker": mark}
            axes.plot(t, y, lw=width, ms=4.5, **style)
            seen = y[np.isfinite(y)]
            last = float(seen[-1]) if len(seen) else 0.0
            ends.append((last, name_model(label), looks[label].ink))
        for name, limit in (limits or {}).items():
            axes.axhline(limit, color=ink, lw=0.9, ls=(0, (4, 3)))
            ends.append((limit, name, ink))
        every = np.concatenate([np.ravel(times) for times, _ in groups.values()])
        if is_log:
            set_log(axes, x=True, y=True)
            label_resolutions(axes, every)
        else:
            axes.set_xlim(float(every.min()), float(every.max()) or 1.0)
        axes.set_xlabel(xlabel)
        axes.set_ylabel(ylabel)
        figure.draw_without_rendering()
        label_line_ends(axes, ends)
        return encode_png(figure)


def _choose_looks(labels: Sequence[str]) -> dict[str, Look]:
    """Looks of models; other labels have a colour per kind and a marker per member of it."""
    kinds = [label.rpartition(", ")[0] or label for label in labels]
    if any(find_model(label) for label in labels) or len(set(kinds)) == len(kinds):
        looks = choose_looks(labels)
        for place, (label, look) in enumerate(looks.items()):
            if find_model(label) is None:
                looks[label] = replace(look, marker=_MARKERS[place % 5])
        return looks
    colors = {kind: OTHERS[place % len(OTHERS)] for place, kind in enumerate(dict.fromkeys(kinds))}
    looks = {}
    for place, (label, kind) in enumerate(zip(labels, kinds, strict=True)):
        color, marker = colors[kind], _MARKERS[kinds[:place].count(kind) % 5]
        looks[label] = Look(format_hex(color), format_hex(darken(color)), marker, "-")
    return looks


PANEL = (4.6, 3.5)  # width and height of a panel (inches)


@dataclass(frozen=True)
class Curve:
    """One line; values that are not finite are left out."""

    x: ArrayLike  # (k,)
    middle: ArrayLike  # (k,)
    # low, high: its band (k,).
    low: ArrayLike
    high: ArrayLike


@dataclass(frozen=True)
class Panel:
    """One measure of all learners."""

    name: str  # of the measure, with its unit
    curves: Mapping[str, Curve]  # by label; the same labels in all panels
    scale: Literal["share", "log", "linear"] = "linear"  # "share" from 0 to 1, "log" or "linear"


def plot_learning(title: str, xlabel: str, panels: Sequence[Panel]) -> bytes:
    """Draws panels side by side; each line's name stands at its end, in the last panel.

    Each line has dashes of its own, so that one shows through another that lies over it.
    `InputError` is raised for no panel, one without curves, or arrays of different lengths.
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


def _check_curve(label: str, curve: Curve) -> list[Array]:
    parts = [np.asarray(part, float) for part in (curve.x, curve.middle, curve.low, curve.high)]
    if any(part.ndim != 1 or part.shape != parts[0].shape for part in parts):
        shapes = tuple(part.shape for part in parts)
        raise InputError(f"shapes of {label!r}", shapes, "four of shape (k,)")
    kept = np.all(np.isfinite(parts), axis=0)
    return [part[kept] for part in parts]
