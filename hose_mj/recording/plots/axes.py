"""Pieces that several plots share: levels, slopes, logarithmic axes, units, checked input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Sized

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.recording.episode import Array
from hose_mj.recording.plots.labels import HALO
from hose_mj.recording.plots.style import SOFT

PLAIN = "#555555"
ERRORS = (1e-2, 1e-3)
"""Error levels drawn across plots."""


def draw_levels(axes: Axes, levels: Sequence[float], *, named: bool = True) -> list[Text]:
    """Draws lines across at errors within half a decade of the axis' range, named in percent."""
    low, high = axes.get_ylim()
    names: list[Text] = []
    for level in levels:
        if low / 3.2 <= level <= high * 3.2:
            axes.axhline(level, color="#777777", lw=0.8, ls=(0, (1, 2)), zorder=1)
            if named:
                name = axes.annotate(
                    format_percent(level),
                    (1.0, level),
                    xycoords=("axes fraction", "data"),
                    xytext=(-2, 2),
                    textcoords="offset points",
                    ha="right",
                    color=SOFT,
                    fontsize=7.5,
                    path_effects=HALO,
                )
                names.append(name)
    return names


def draw_slopes(
    axes: Axes,
    groups: Mapping[str, tuple[Array, Array]],
    slopes: Sequence[float],
    sign: float,
    word: str = "order",
) -> None:
    """Draws guides of given orders above the coarsest and worst point of all groups."""
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
        middle = np.sqrt(levels[0] * max(levels[1], 1.5 * limits[0]))
        at = coarse * (middle / levels[0]) ** (1.0 / (sign * slope))
        axes.annotate(
            f"{word} {slope:g}",
            (at, middle),
            color=SOFT,
            fontsize=7.5,
            ha="right" if sign > 0.0 else "left",
            va="bottom",
            xytext=(-5 if sign > 0.0 else 5, 2),
            textcoords="offset points",
            path_effects=HALO,
            zorder=5,
        )
    axes.set_ylim(limits[0], max(limits[1], 4.0 * y.max()))


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
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
        axes.set_xlim(values[0] / 1.12, values[-1] * 1.12)


def format_percent(fraction: float) -> str:
    """Returns "0.1 %"."""
    return f"{100.0 * fraction:.6g} %"


def format_seconds(seconds: float) -> str:
    """Returns a time with the unit that suits it: "10 ms"."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= 0.9995 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{1e9 * seconds:.3g} ns"


def choose_length_unit(size: float) -> tuple[str, float]:
    """Returns the unit for lengths up to `size` (m), and how many of it make a metre."""
    return ("mm", 1e3) if size < 0.3 else ("m", 1.0)


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
