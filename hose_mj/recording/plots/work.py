"""Work-precision plot: error over cost, each model by its best settings; alone or beside a motion.

Arrows say how much more a peer costs at equal error.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.ticker import FuncFormatter
from matplotlib.transforms import ScaledTranslation
from numpy.typing import ArrayLike

from hose_mj.recording.episode import Array
from hose_mj.recording.palette import name_model
from hose_mj.recording.plots.labels import Label, label_points
from hose_mj.recording.plots.shapes import draw_shapes, label_snapshots
from hose_mj.recording.plots.style import (
    DPI,
    ERRORS,
    HALO,
    PLAIN,
    Look,
    add_legend,
    check_curve,
    check_some,
    choose_looks,
    draw_levels,
    encode_png,
    format_percent,
    format_seconds,
    is_positive,
    make_axes,
    make_figure,
    set_log,
    write_note,
)

OVERVIEW = (1600 / 150, 700 / 150)  # size of the overview (inches)
_SHIFT = 6.0  # distance of an arrow from its level (points of length)


@dataclass(frozen=True)
class WorkPoint:
    """One setting of one model with its cost."""

    model: str  # model id, or "geds planar"; points of one model make a series
    label: str  # the setting, short ("16, 1 ms")
    error: float  # as a fraction
    wall_s_per_sim_s: float  # wall over simulated time
    # True or False for a model whose clamp needs correcting, else None.
    clamp_corrected: bool | None = None

    @property
    def is_raw(self) -> bool:
        """Says whether this is a result before its clamp was corrected."""
        return self.clamp_corrected is False and not self.model.startswith("geds")


@dataclass(frozen=True)
class Gap:
    """An arrow that says what a peer costs more at equal error."""

    at_error: float  # the level, as a fraction
    against: str  # model id of the peer
    # cost, cost_against: wall over simulated time of the two.
    cost: float
    cost_against: float


def plot_work_precision(title: str, points: Sequence[WorkPoint], gaps: Sequence[Gap] = ()) -> bytes:
    """Draws error against cost, both logarithmic; lower left is better.

    The line of a model joins its Pareto front: the settings that no other of its settings beats in
    both error and cost. Only they are marked and labelled; all others are faint dots. Hollow marks
    on dotted lines are raw, filled ones clamp-corrected or in no need of it.
    """
    check_some("points", points)
    with make_axes(title, (8.4, 5.4)) as (figure, axes):
        handles, label = _draw_work(figure, axes, points, gaps)
        add_legend(figure, handles)
        label()
        return encode_png(figure)


def plot_overview(
    curves: Mapping[str, ArrayLike],
    times: Sequence[float],
    points: Sequence[WorkPoint],
    gaps: Sequence[Gap],
    captions: tuple[str, str],
) -> bytes:
    """Draws snapshots in the x-z plane beside the work-precision plot, 1600 by 700 pixels.

    Args:
        curves: label to snapshots (k, m, 3), the lowest first.
        times: of the snapshots (s), (k,).
        points: of the work-precision plot.
        gaps: of the work-precision plot.
        captions: a line above each side; what stands behind a newline is smaller.
    """
    check_some("curves", curves)
    check_some("points", points)
    with make_figure(OVERVIEW) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.12))
        for axes, caption in zip((left, right), captions, strict=True):
            head, _, rest = caption.partition("\n")
            axes.set_title(head, pad=22.0 if rest else 8.0)
            where: Any = {"xycoords": "axes fraction", "xytext": (0, 7), "fontsize": 8.5}
            write_note(axes, rest, (0.0, 1.0), **where)
        stacks = {label: check_curve(label, curve)[:, :, [0, 2]] for label, curve in curves.items()}
        left.legend(
            handles=draw_shapes(left, stacks), loc="upper left", bbox_to_anchor=(-0.05, -0.13)
        )
        left.set_anchor("N")
        handles, label = _draw_work(figure, right, points, gaps, spacing=34.0)
        below: Any = {"loc": "upper left", "bbox_to_anchor": (-0.08, -0.13)}
        right.legend(handles=handles, ncols=-(-len(handles) // 2), **below)
        label_snapshots(figure, left, stacks, times)
        label()
        return encode_png(figure)


def _draw_work(
    figure: Figure,
    axes: Axes,
    points: Sequence[WorkPoint],
    gaps: Sequence[Gap] = (),
    spacing: float = 20.0,
) -> tuple[list[Line2D], Callable[[], None]]:
    """Draws all but the labels of points into axes.

    Returns:
        what the legend has to hold, and what labels front points `spacing` apart (points of
        length) once the rest is laid out.
    """
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
    notes: list[Annotation] = draw_levels(axes, ERRORS)
    low, high = axes.get_xlim()
    if low < 1.0 < high:  # a line where a simulated second takes a second
        axes.axvline(1.0, color="#bbbbbb", lw=0.8, zorder=1)
        where: Any = {"xycoords": ("data", "axes fraction"), "xytext": (-2, 0), "rotation": 90}
        write_note(axes, "real time", (1.0, 0.985), **where, ha="right", va="top")
    notes += [note for gap in gaps for note in _draw_gap(axes, gap, looks[gap.against])]
    lines = [
        (np.array([p.wall_s_per_sim_s for p in front]), np.array([p.error for p in front]))
        for front in fronts.values()
    ]
    shown = [front for (_, raw), front in fronts.items() if not raw]

    def label() -> None:
        figure.draw_without_rendering()
        wanted = _choose_labels(axes, shown, looks, spacing)
        label_points(figure, axes, wanted, lines, notes)

    return _make_handles(looks, drawn, len(points) - len(drawn)), label


def compute_pareto_front(cost: Array, error: Array) -> Array:
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
    front = compute_pareto_front(cost, error)
    beaten = np.setdiff1d(np.arange(len(group)), front)
    faint: dict[str, Any] = {"ls": "", "marker": look.marker, "ms": 2.6, "alpha": 0.28, "mew": 0.5}
    face = "none" if raw else look.color
    axes.plot(cost[beaten], error[beaten], color=look.color, mfc=face, zorder=2, **faint)
    full: dict[str, Any] = {"ls": "-", "lw": 1.3, "ms": 5.0, "mec": "white", "mew": 0.5}
    if raw:
        full = {"ls": ":", "lw": 0.9, "ms": 4.2, "mfc": "white", "mew": 0.9, "alpha": 0.5}
    full |= {"color": look.color, "marker": look.marker, "zorder": 3 if raw else 4}
    axes.plot(cost[front], error[front], **full)
    return [group[i] for i in front]


def _draw_gap(axes: Axes, gap: Gap, look: Look) -> tuple[Annotation, Annotation]:
    """Draws an arrow along a level from one model's cost to the other's, with the ratio on it.

    The cable's arrow stands above the level, anyone else's below.
    """
    side = 1.0 if gap.against == "cable" else -1.0
    root = axes.get_figure(root=True)
    assert root is not None
    place = axes.transData + ScaledTranslation(0.0, side * _SHIFT / 72.0, root.dpi_scale_trans)
    ends: Any = {"arrowstyle": "|-|,widthA=0.25,widthB=0.25", "shrinkA": 0.0, "shrinkB": 0.0}
    start, end = (gap.cost, gap.at_error), (gap.cost_against, gap.at_error)
    line: Any = {"arrowprops": {"color": look.ink, "lw": 0.9, **ends}, "zorder": 5}
    arrow = axes.annotate("", end, start, xycoords=place, textcoords=place, **line)
    ratio = gap.cost_against / gap.cost
    text = f"{ratio:.0f}\u00d7" if ratio >= 10.0 else f"{ratio:.1f}\u00d7"
    share, above = (0.72, "bottom") if side > 0.0 else (0.55, "top")
    style: Any = {"fontsize": 9.0, "fontweight": "bold", "path_effects": HALO, "zorder": 7}
    style |= {"xycoords": place, "xytext": (0.0, side * 1.5), "ha": "center", "va": above}
    at = (gap.cost * ratio**share, gap.at_error)
    return arrow, write_note(axes, text, at, color=look.ink, **style)


def _choose_labels(
    axes: Axes, fronts: Sequence[Sequence[WorkPoint]], looks: Mapping[str, Look], spacing: float
) -> list[Label]:
    """Labels of front points: first those that reach a level most cheaply, then some others.

    The others of a series stand `spacing` apart from all that were chosen before them.
    """
    reaching = [[p for p in front if p.error <= level] for front in fronts for level in ERRORS]
    first = [min(some, key=lambda p: p.wall_s_per_sim_s) for some in reaching if some]
    chosen = list(first)
    for front in fronts:
        near = [_locate(axes, p) for p in first if p in front]
        for p in (front[0], front[-1], *front):
            here = _locate(axes, p)
            if all(np.hypot(*(here - other)) >= spacing * DPI / 72.0 for other in near):
                near.append(here)
                chosen.append(p)
    sides = {"geds planar": -1}
    return [
        Label(p.wall_s_per_sim_s, p.error, p.label, looks[p.model].ink, sides.get(p.model, 1))
        for p in dict.fromkeys(chosen)
    ]


def _locate(axes: Axes, point: WorkPoint) -> Array:
    """Returns where a point lies, in pixels."""
    return np.asarray(axes.transData.transform((point.wall_s_per_sim_s, point.error)))


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
