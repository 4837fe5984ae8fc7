"""Work-precision plot: error over cost, each model by its best settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter
from matplotlib.transforms import ScaledTranslation

from hose_mj.recording.episode import Array
from hose_mj.recording.palette import name_model
from hose_mj.recording.plot_labels import HALO, Label, label_points
from hose_mj.recording.plot_parts import (
    ERRORS,
    PLAIN,
    check_some,
    draw_levels,
    format_percent,
    format_seconds,
    is_positive,
    set_log,
)
from hose_mj.recording.plot_style import (
    SOFT,
    Look,
    add_legend,
    choose_looks,
    encode_png,
    make_axes,
)


@dataclass(frozen=True)
class WorkPoint:
    """One setting of one model with its cost.

    Attributes:
        model: model id, or "geds planar"; points of one model make a series.
        label: the setting, short ("16, 1 ms").
        error: as a fraction.
        wall_s_per_sim_s: wall over simulated time.
        clamp_corrected: True or False for a model whose clamp needs correcting, else None.
    """

    model: str
    label: str
    error: float
    wall_s_per_sim_s: float
    clamp_corrected: bool | None = None

    @property
    def is_raw(self) -> bool:
        """Whether this is a result before its clamp was corrected."""
        return self.clamp_corrected is False and not self.model.startswith("geds")


@dataclass(frozen=True)
class Gap:
    """What a peer costs more at equal error.

    Attributes:
        at_error: the level, as a fraction.
        against: model id of the peer.
        cost, cost_against: wall over simulated time of the two.
    """

    at_error: float
    against: str
    cost: float
    cost_against: float


def plot_work_precision(title: str, points: Sequence[WorkPoint], gaps: Sequence[Gap] = ()) -> bytes:
    """Error against cost, both logarithmic; lower left is better.

    The line of a model joins its Pareto front: the settings that no other of its settings beats in
    both error and cost. Only they are marked and labelled; all others are faint dots. Hollow marks
    on dotted lines are raw, filled ones clamp-corrected or in no need of it.
    """
    check_some("points", points)
    with make_axes(title, (8.4, 5.4)) as (figure, axes):
        handles = draw_work_precision(figure, axes, points, gaps)
        add_legend(figure, handles)
        return encode_png(figure)


def draw_work_precision(
    figure: Figure, axes: Axes, points: Sequence[WorkPoint], gaps: Sequence[Gap] = ()
) -> list[Line2D]:
    """Draws the plot into axes and returns what its legend has to hold."""
    drawn = [p for p in points if is_positive(p.error) and is_positive(p.wall_s_per_sim_s)]
    looks = choose_looks(list(dict.fromkeys(p.model for p in points)))
    fronts = {
        key: _draw_series(axes, [p for p in drawn if (p.model, p.is_raw) == key], looks[key[0]])
        for key in dict.fromkeys((p.model, p.is_raw) for p in drawn)
    }
    set_log(axes, x=True, y=True)
    axes.set_xlabel("wall time per simulated second")
    axes.set_ylabel("error")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: format_seconds(value)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_percent(value)))
    draw_levels(axes, ERRORS)
    _draw_real_time(axes)
    texts = [_draw_gap(figure, axes, gap, looks[gap.against]) for gap in gaps]
    lines = [
        (np.array([p.wall_s_per_sim_s for p in front]), np.array([p.error for p in front]))
        for front in fronts.values()
    ]
    wanted = _choose_labels([front for (_, raw), front in fronts.items() if not raw], looks)
    label_points(figure, axes, wanted, lines, texts)
    return _make_handles(looks, drawn, len(points) - len(drawn))


def find_pareto_front(cost: Array, error: Array) -> Array:
    """Returns the indices, by rising cost, of the points that no other beats in both."""
    best, front = np.inf, []
    for i in np.lexsort((error, cost)):
        if error[i] < best:
            best = error[i]
            front.append(int(i))
    return np.array(front, dtype=int)


def _draw_series(axes: Axes, group: Sequence[WorkPoint], look: Look) -> list[WorkPoint]:
    """Draws one series, its front in full and the rest faint, and returns the front."""
    raw = group[0].is_raw
    cost = np.array([p.wall_s_per_sim_s for p in group])
    error = np.array([p.error for p in group])
    front = find_pareto_front(cost, error)
    beaten = np.setdiff1d(np.arange(len(group)), front)
    faint: dict[str, Any] = {"ls": "", "marker": look.marker, "ms": 2.6, "alpha": 0.28, "mew": 0.5}
    face = "none" if raw else look.color
    axes.plot(cost[beaten], error[beaten], color=look.color, mfc=face, zorder=2, **faint)
    axes.plot(
        cost[front],
        error[front],
        color=look.color,
        ls=":" if raw else "-",
        lw=0.9 if raw else 1.3,
        marker=look.marker,
        ms=4.2 if raw else 5.0,
        mfc="white" if raw else look.color,
        mec=look.color if raw else "white",
        mew=0.9 if raw else 0.5,
        alpha=0.5 if raw else 1.0,
        zorder=3 if raw else 4,
    )
    return [group[i] for i in front]


def _draw_real_time(axes: Axes) -> None:
    """A line where a simulated second takes a second."""
    low, high = axes.get_xlim()
    if low < 1.0 < high:
        axes.axvline(1.0, color="#bbbbbb", lw=0.8, zorder=1)
        axes.annotate(
            "real time",
            (1.0, 0.985),
            xycoords=("data", "axes fraction"),
            xytext=(-2, 0),
            textcoords="offset points",
            rotation=90,
            ha="right",
            va="top",
            color=SOFT,
            fontsize=7.5,
        )


def _draw_gap(figure: Figure, axes: Axes, gap: Gap, look: Look) -> Text:
    """An arrow along a level from one model's cost to the other's, with the ratio on it.

    The cable's stands above the level, anyone else's below.
    """
    above = 1.0 if gap.against == "cable" else -1.0
    shift = ScaledTranslation(0.0, above * 6.0 / 72.0, figure.dpi_scale_trans)
    place = axes.transData + shift
    axes.annotate(
        "",
        (gap.cost_against, gap.at_error),
        (gap.cost, gap.at_error),
        xycoords=place,
        textcoords=place,
        arrowprops={
            "arrowstyle": "|-|,widthA=0.25,widthB=0.25",
            "color": look.ink,
            "lw": 0.9,
            "shrinkA": 0.0,
            "shrinkB": 0.0,
        },
        zorder=5,
    )
    ratio = gap.cost_against / gap.cost
    share = 0.72 if above > 0.0 else 0.55
    return axes.annotate(
        f"{ratio:.0f}\u00d7" if ratio >= 10.0 else f"{ratio:.1f}\u00d7",
        (gap.cost * ratio**share, gap.at_error),
        xycoords=place,
        xytext=(0.0, above * 1.5),
        textcoords="offset points",
        ha="center",
        va="bottom" if above > 0.0 else "top",
        color=look.ink,
        fontsize=9.0,
        fontweight="bold",
        path_effects=HALO,
        zorder=7,
    )


def _choose_labels(
    fronts: Sequence[Sequence[WorkPoint]], looks: Mapping[str, Look]
) -> list[Label]:
    """Labels of front points: first those that reach a level most cheaply, then the others."""
    chosen: list[WorkPoint] = []
    for front in fronts:
        chosen += [
            min(reached, key=lambda p: p.wall_s_per_sim_s)
            for level in ERRORS
            if (reached := [p for p in front if p.error <= level])
        ]
    chosen += [front[end] for front in fronts for end in (0, -1) if front]
    chosen += [p for front in fronts for p in front]
    return [
        Label(
            p.wall_s_per_sim_s,
            p.error,
            p.label,
            looks[p.model].ink,
            -1 if p.model == "geds planar" else 1,
        )
        for p in dict.fromkeys(chosen)
    ]


def _make_handles(
    looks: Mapping[str, Look], drawn: Sequence[WorkPoint], n_hidden: int
) -> list[Line2D]:
    """Names the models, says what hollow and faint mean, and how many points cannot be shown."""
    handles = [
        Line2D([], [], color=look.color, marker=look.marker, lw=1.3, label=name_model(model))
        for model, look in looks.items()
    ]
    faint: dict[str, Any] = {"color": PLAIN, "alpha": 0.6}
    if any(p.is_raw for p in drawn):
        text = "clamp as documented"
        handles.append(Line2D([], [], ls=":", lw=0.9, marker="s", mfc="w", label=text, **faint))
    handles.append(Line2D([], [], ls="", marker="o", ms=2.6, label="other settings", **faint))
    if n_hidden:
        handles.append(Line2D([], [], ls="", label=f"{n_hidden} not drawn (not above 0)"))
    return handles
