"""Pieces that several plots share: markers, levels, guides, logarithmic axes, checked input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Sized

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogFormatterSciNotation, NullFormatter, NullLocator
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.recording.episode import Array
from hose_mj.recording.plot_style import Look, add_legend

PLAIN = "#555555"


def draw_markers(axes: Axes, x: Array, y: Array, look: Look, hollow: bool) -> None:
    """Draws the points of one group, hollow or filled."""
    face = "white" if hollow else look.color
    axes.plot(x, y, ls="", marker=look.marker, color=look.color, mfc=face, mew=1.2, zorder=3)


def draw_levels(axes: Axes, levels: Sequence[float], horizontal: bool) -> None:
    """Draws thin lines across at levels that lie within half a decade of the axis' range."""
    low, high = axes.get_ylim() if horizontal else axes.get_xlim()
    line = axes.axhline if horizontal else axes.axvline
    for level in levels:
        if low / 3.2 <= level <= high * 3.2:
            line(level, color="#888888", lw=0.8, ls=(0, (1, 2)), zorder=1)


def draw_slopes(
    axes: Axes, groups: Mapping[str, tuple[Array, Array]], slopes: Sequence[float], sign: float
) -> None:
    """Draws guides of given orders through the coarsest and worst point of all groups."""
    x = np.concatenate([x for x, _ in groups.values()])
    y = np.concatenate([y for _, y in groups.values()])
    if not len(x):
        return
    coarse, fine = (x.min(), x.max()) if sign < 0.0 else (x.max(), x.min())
    limits = axes.get_ylim()
    for slope in slopes:
        ends = np.array([coarse, fine])
        levels = 2.0 * y.max() * (ends / coarse) ** (sign * slope)
        axes.plot(ends, levels, color="#999999", lw=0.8, ls=(0, (4, 3)), zorder=1)
        inside = np.clip(limits[0] * 1.3, levels.min(), levels.max())
        place = max(levels[1], inside)
        at = coarse * (place / levels[0]) ** (1.0 / (sign * slope))
        axes.annotate(
            f"order {slope:g}",
            (at, place),
            color="#777777",
            fontsize=7.5,
            va="bottom" if sign < 0.0 else "top",
            xytext=(4, 2 if sign < 0.0 else -2),
            textcoords="offset points",
        )
    axes.set_ylim(limits[0], max(limits[1], 2.8 * y.max()))


def set_log(axes: Axes, x: bool, y: bool) -> None:
    """Makes axes logarithmic over whole decades' worth of room around the data."""
    for wanted, axis, limits in ((x, "x", axes.get_xlim), (y, "y", axes.get_ylim)):
        if not wanted:
            continue
        getattr(axes, f"set_{axis}scale")("log")
        axes.relim()
        axes.autoscale_view()
        low, high = limits()
        if high / low < 12.0:  # keep at least one decade in view, so that ticks have numbers
            room = np.sqrt(12.0 * low / high)
            getattr(axes, f"set_{axis}lim")(low / room, high * room)
        getattr(axes, f"{axis}axis").set_minor_formatter(NullFormatter())


def label_resolutions(axes: Axes, x: Array) -> None:
    """Ticks a logarithmic axis at the resolutions themselves where they are few."""
    values = np.unique(x)
    if 0 < len(values) <= 12 and np.all(np.diff(np.log(values)) > 0.12):
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xticks(values)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    else:
        axes.xaxis.set_minor_formatter(LogFormatterSciNotation(minor_thresholds=(2, 0.5)))


def add_model_legend(axes: Axes, looks: Mapping[str, Look], any_raw: bool, n_hidden: int) -> None:
    """Names the models, says what hollow means, and how many points a log axis cannot show."""
    handles = [
        Line2D([], [], color=look.color, marker=look.marker, label=model)
        for model, look in looks.items()
    ]
    if any_raw:
        for face, text in (("white", "as it is"), (PLAIN, "clamp-corrected")):
            handles.append(
                Line2D([], [], color=PLAIN, ls="", marker="s", mfc=face, mew=1.2, label=text)
            )
    if n_hidden:
        handles.append(Line2D([], [], ls="", label=f"{n_hidden} not drawn\n(not above 0)"))
    add_legend(axes, handles)


def choose_size(points: Array) -> tuple[float, float]:
    """Returns a figure size (inches) near the aspect ratio of points (k, 2)."""
    width, height = np.maximum(np.ptp(points, axis=0), 1e-9)
    return 7.6, float(np.clip(5.2 * height / width + 1.0, 2.8, 5.6))


def is_positive(value: float) -> bool:
    """Whether a logarithmic axis can show a value."""
    return bool(np.isfinite(value) and value > 0.0)


def check_some(name: str, values: Sized) -> None:
    """Raises `InputError` where there is nothing to draw."""
    if len(values) == 0:
        raise InputError(name, values, "at least one")


def check_pair(label: str, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Returns two vectors of one length."""
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if x.ndim != 1 or x.shape != y.shape or len(x) == 0:
        raise InputError(f"shapes of {label!r}", (x.shape, y.shape), "two of shape (k,), k >= 1")
    return x, y


def keep_positive(label: str, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Returns the pairs that logarithmic axes can show, by rising x."""
    x, y = check_pair(label, x, y)
    kept = np.isfinite(x) & np.isfinite(y) & (x > 0.0) & (y > 0.0)
    order = np.argsort(x[kept], kind="stable")
    return x[kept][order], y[kept][order]


def check_curve(label: str, points: ArrayLike) -> Array:
    """Returns snapshots (k, m, 3) of a curve given as (m, 3) or (k, m, 3)."""
    stack = np.asarray(points, dtype=np.float64)
    stack = stack[None] if stack.ndim == 2 else stack
    if stack.ndim != 3 or stack.shape[2] != 3 or 0 in stack.shape or not np.all(np.isfinite(stack)):
        raise InputError(
            f"curve {label!r}", np.shape(points), "finite points of shape (m, 3) or (k, m, 3)"
        )
    return stack
