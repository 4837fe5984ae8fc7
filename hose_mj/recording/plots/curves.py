"""Plots of curves: convergence with measured orders, and numbers over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.ticker import FuncFormatter
from numpy.typing import ArrayLike

from hose_mj.recording.episode import Array
from hose_mj.recording.plots.axes import (
    check_pair,
    check_some,
    draw_slopes,
    format_seconds,
    keep_positive,
    label_resolutions,
    set_log,
)
from hose_mj.recording.plots.labels import label_line_ends
from hose_mj.recording.plots.palette import (
    LIMIT,
    OTHERS,
    darken,
    find_model,
    format_hex,
    name_model,
)
from hose_mj.recording.plots.style import Look, choose_looks, encode_png, make_axes

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
    """Error against resolution, both logarithmic; each line's name and slope stand at its end.

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
    logy: bool = False,
) -> bytes:
    """Numbers over time, each line named at its end; `limits` are drawn across with their names."""
    check_some("groups", groups)
    looks = choose_looks(list(groups))
    ends, ink = [], format_hex(LIMIT)
    with make_axes(title, (7.6, 3.3)) as (figure, axes):
        for rank, (label, (times, values)) in enumerate(groups.items()):
            t, y = check_pair(label, times, values)
            y = np.where(y > 0.0, y, np.nan) if logy else y
            width = 1.3 + 1.1 * (len(groups) - 1 - rank) / max(len(groups) - 1, 1)
            axes.plot(t, y, color=looks[label].color, ls=looks[label].dashes, lw=width)
            seen = y[np.isfinite(y)]
            last = float(seen[-1]) if len(seen) else 0.0
            ends.append((last, name_model(label), looks[label].ink))
        for name, limit in (limits or {}).items():
            axes.axhline(limit, color=ink, lw=0.9, ls=(0, (4, 3)))
            ends.append((limit, name, ink))
        if logy:
            set_log(axes, x=False, y=True)
        every = np.concatenate([np.ravel(times) for times, _ in groups.values()])
        axes.set_xlim(float(every.min()), float(every.max()) or 1.0)
        axes.set_xlabel("time (s)")
        axes.set_ylabel(ylabel)
        figure.draw_without_rendering()
        label_line_ends(axes, ends)
        return encode_png(figure)


def _choose_looks(labels: Sequence[str]) -> dict[str, Look]:
    """Looks of models; other labels have a colour per kind and a marker per member of it."""
    kinds = [label.rpartition(", ")[0] or label for label in labels]
    if any(find_model(label) for label in labels) or len(set(kinds)) == len(kinds):
        looks = choose_looks(labels)
        return {
            label: Look(look.color, look.ink, _MARKERS[place % 5], look.dashes)
            if find_model(label) is None
            else look
            for place, (label, look) in enumerate(looks.items())
        }
    colors = {kind: OTHERS[place % len(OTHERS)] for place, kind in enumerate(dict.fromkeys(kinds))}
    return {
        label: Look(
            format_hex(colors[kind]),
            format_hex(darken(colors[kind])),
            _MARKERS[kinds[:place].count(kind) % 5],
            "-",
        )
        for place, (label, kind) in enumerate(zip(labels, kinds, strict=True))
    }
