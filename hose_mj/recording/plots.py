"""Plots of a comparison as PNG bytes: one function per kind, no pyplot, no global state.

Labels that start with a model id take that model's colour and marker (`palette`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.recording.episode import Array
from hose_mj.recording.palette import LIMIT, find_model, format_hex
from hose_mj.recording.plot_parts import (
    PLAIN,
    add_model_legend,
    check_curve,
    check_pair,
    check_some,
    choose_size,
    draw_levels,
    draw_markers,
    draw_slopes,
    is_positive,
    keep_positive,
    label_resolutions,
    set_log,
)
from hose_mj.recording.plot_style import (
    add_legend,
    choose_looks,
    encode_png,
    label_line_ends,
    label_points,
    make_axes,
)


@dataclass(frozen=True)
class ErrorPoint:
    """One setting of one model.

    Attributes:
        model: model id.
        label: the setting, short ("16", "40, 1 ms").
        error: as a fraction.
        clamp_corrected: True or False for a model whose clamp needs correcting, else None.
    """

    model: str
    label: str
    error: float
    clamp_corrected: bool | None = None

    @property
    def is_raw(self) -> bool:
        """Whether this is a result before its clamp was corrected."""
        return self.clamp_corrected is False and self.model != "geds"


@dataclass(frozen=True)
class WorkPoint:
    """One setting of one model with its cost: an `ErrorPoint` and wall over simulated time."""

    model: str
    label: str
    error: float
    wall_s_per_sim_s: float
    clamp_corrected: bool | None = None

    @property
    def is_raw(self) -> bool:
        """Whether this is a result before its clamp was corrected."""
        return self.clamp_corrected is False and self.model != "geds"


def plot_work_precision(
    title: str,
    points: Sequence[WorkPoint],
    reference_errors: Sequence[float] = (1e-2, 1e-3),
) -> bytes:
    """Error against cost, both logarithmic; lower left is better.

    The line of a model joins its Pareto front: the settings that no other of its settings beats in
    both error and cost. Hollow points are raw, filled ones clamp-corrected or in no need of it.
    """
    drawn = [p for p in points if is_positive(p.error) and is_positive(p.wall_s_per_sim_s)]
    check_some("points", points)
    looks = choose_looks(list(dict.fromkeys(p.model for p in points)))
    lines = []
    with make_axes(title, (7.6, 4.6)) as (figure, axes):
        for model, raw in dict.fromkeys((p.model, p.is_raw) for p in drawn):
            group = [p for p in drawn if (p.model, p.is_raw) == (model, raw)]
            cost = np.array([p.wall_s_per_sim_s for p in group])
            error = np.array([p.error for p in group])
            draw_markers(axes, cost, error, looks[model], raw)
            front = find_pareto_front(cost, error)
            lines.append((cost[front], error[front]))
            axes.plot(*lines[-1], color=looks[model].color, ls=":" if raw else "-", lw=1.2)
        set_log(axes, x=True, y=True)
        draw_levels(axes, reference_errors, horizontal=True)
        axes.set_xlabel("wall time per simulated time (s / s)")
        axes.set_ylabel("error")
        add_model_legend(axes, looks, any(p.is_raw for p in drawn), len(points) - len(drawn))
        notes = [(p.wall_s_per_sim_s, p.error, p.label, looks[p.model].color) for p in drawn]
        label_points(figure, axes, notes, lines)
        return encode_png(figure)


def find_pareto_front(cost: Array, error: Array) -> Array:
    """Returns the indices, by rising cost, of the points that no other beats in both."""
    best, front = np.inf, []
    for i in np.lexsort((error, cost)):
        if error[i] < best:
            best = error[i]
            front.append(int(i))
    return np.array(front, dtype=int)


def plot_convergence(
    title: str,
    xlabel: str,
    groups: Mapping[str, tuple[ArrayLike, ArrayLike]],
    slopes: Sequence[float] = (),
    finer_is_larger: bool = True,
    reference_errors: Sequence[float] = (),
) -> bytes:
    """Error against resolution, both logarithmic, with each group's measured order in the legend.

    Args:
        title: text.
        xlabel: text.
        groups: label to resolutions (k,) and errors (k,); labels draw in this order.
        slopes: orders drawn as thin guides from the coarsest point of all.
        finer_is_larger: True for numbers of points, False for step sizes.
        reference_errors: levels drawn across.
    """
    check_some("groups", groups)
    looks = choose_looks(list(groups))
    sign = -1.0 if finer_is_larger else 1.0
    kept = {label: keep_positive(label, x, y) for label, (x, y) in groups.items()}
    with make_axes(title, (7.6, 4.4)) as (figure, axes):
        for label, (x, y) in kept.items():
            order = measure_order(x, y)
            text = label if order is None else f"{label}: order {sign * order:.1f}"
            look = looks[label]
            axes.plot(x, y, color=look.color, ls=look.dashes, marker=look.marker, label=text)
        set_log(axes, x=True, y=True)
        label_resolutions(axes, np.concatenate([x for x, _ in kept.values()]))
        draw_slopes(axes, kept, slopes, sign)
        draw_levels(axes, reference_errors, horizontal=True)
        axes.set_xlabel(xlabel)
        axes.set_ylabel("error")
        add_legend(axes)
        return encode_png(figure)


def measure_order(x: Array, y: Array) -> float | None:
    """Returns the least-squares slope of log y over log x, or None with fewer than two points."""
    if len(x) < 2 or np.ptp(x) == 0.0:
        return None
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def plot_shapes(
    title: str,
    curves: Mapping[str, ArrayLike],
    plane: tuple[int, int] = (0, 2),
    times: Sequence[float] | None = None,
) -> bytes:
    """Hoses seen along one axis, to scale, several models over each other.

    Args:
        title: text.
        curves: label to points (m, 3), or (k, m, 3) for k snapshots, the earlier the paler.
        plane: the two coordinates shown, horizontal first.
        times: of the snapshots (s), written at their tips.
    """
    check_some("curves", curves)
    stacks = {label: check_curve(label, points) for label, points in curves.items()}
    stacks = dict(sorted(stacks.items(), key=lambda item: find_model(item[0]) != "reference"))
    looks = choose_looks(list(curves))
    every = np.concatenate([stack.reshape(-1, 3) for stack in stacks.values()])[:, list(plane)]
    with make_axes(title, choose_size(every)) as (figure, axes):
        for rank, (label, stack) in enumerate(stacks.items()):
            for k, shape in enumerate(stack):
                axes.plot(
                    *shape[:, list(plane)].T,
                    color=looks[label].color,
                    ls=looks[label].dashes,
                    lw=max(3.6 / 1.6**rank, 1.0),
                    alpha=0.25 + 0.75 * (k + 1) / len(stack) if len(stack) > 1 else 1.0,
                    label=label if k == len(stack) - 1 else None,
                )
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        axes.set_xlabel(f"{'xyz'[plane[0]]} (m)")
        axes.set_ylabel(f"{'xyz'[plane[1]]} (m)")
        add_legend(axes)
        if times is not None:
            tips = next(iter(stacks.values()))[:, -1][:, list(plane)]
            notes = [(*tip, f"{t:.3g} s", PLAIN) for tip, t in zip(tips, times, strict=True)]
            drawn = [shape[:, list(plane)].T for stack in stacks.values() for shape in stack]
            label_points(figure, axes, notes, [(x, y) for x, y in drawn])
        return encode_png(figure)


def plot_series(
    title: str,
    ylabel: str,
    groups: Mapping[str, tuple[ArrayLike, ArrayLike]],
    limit: float | None = None,
    logy: bool = False,
) -> bytes:
    """Numbers over time, each line named at its end; `limit` is drawn across."""
    check_some("groups", groups)
    looks = choose_looks(list(groups))
    ends = []
    with make_axes(title, (7.6, 3.6)) as (figure, axes):
        for label, (times, values) in groups.items():
            t, y = check_pair(label, times, values)
            if logy:
                y = np.where(y > 0.0, y, np.nan)
            axes.plot(t, y, color=looks[label].color, ls=looks[label].dashes)
            seen = y[np.isfinite(y)]
            ends.append((float(seen[-1]) if len(seen) else 0.0, label, looks[label].color))
        if limit is not None:
            axes.axhline(limit, color=format_hex(LIMIT), lw=0.9, ls=(0, (4, 3)))
            ends.append((limit, "limit", format_hex(LIMIT)))
        if logy:
            set_log(axes, x=False, y=True)
        every = np.concatenate([np.ravel(times) for times, _ in groups.values()])
        axes.set_xlim(float(every.min()), float(every.max()) or 1.0)
        axes.set_xlabel("time (s)")
        axes.set_ylabel(ylabel)
        figure.draw_without_rendering()
        label_line_ends(axes, ends)
        return encode_png(figure)


def plot_bars_vs_reference(
    title: str,
    points: Sequence[ErrorPoint | WorkPoint],
    xlabel: str = "error (fraction of the reference)",
    reference_errors: Sequence[float] = (1e-2, 1e-3),
) -> bytes:
    """Error of each model and resolution as a dot on a logarithmic axis, one row per setting.

    The raw and the clamp-corrected result of a setting share its row, joined by a thin line.
    """
    check_some("points", points)
    drawn = [p for p in points if is_positive(p.error)]
    looks = choose_looks(list(dict.fromkeys(p.model for p in points)))
    rows = [
        (m, label)
        for m in looks
        for label in dict.fromkeys(p.label for p in points if p.model == m)
    ]
    with make_axes(title, (7.6, 1.5 + 0.26 * len(rows))) as (figure, axes):
        for height, row in enumerate(rows):
            group = [p for p in drawn if (p.model, p.label) == row]
            if len(group) > 1:
                axes.plot([p.error for p in group], [height] * len(group), color="#aaaaaa", lw=0.8)
            for p in group:
                at, level = np.array([p.error]), np.array([height])
                draw_markers(axes, at, level, looks[p.model], p.is_raw)
        set_log(axes, x=True, y=False)
        draw_levels(axes, reference_errors, horizontal=False)
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.set_yticks(range(len(rows)), [f"{model} {label}" for model, label in rows])
        axes.grid(axis="y", visible=False)
        axes.set_xlabel(xlabel)
        add_model_legend(axes, looks, any(p.is_raw for p in drawn), len(points) - len(drawn))
        return encode_png(figure)
