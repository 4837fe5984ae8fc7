"""Plots of shapes, to scale: snapshots of a motion, and fans of equilibria."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from hose_mj.recording.episode import Array
from hose_mj.recording.palette import darken, find_color, format_hex, lighten, name_model
from hose_mj.recording.plots.labels import Label, label_points
from hose_mj.recording.plots.statics import shade
from hose_mj.recording.plots.style import (
    PLAIN,
    add_legend,
    check_curve,
    check_some,
    choose_length_unit,
    encode_png,
    make_axes,
)

_WIDTHS = (6.0, 2.6, 1.0, 0.8)
"""Line widths (points) of models on top of each other, the first lowest."""
_SOLID = "#d9d9d9"
"""Colour of solid things behind the hoses."""


@dataclass(frozen=True)
class Fan:
    """The equilibria of one model over a parameter."""

    name: str  # what the reader calls it; starts with the model's id
    curves: Mapping[str, ArrayLike]  # centre line (m, 3) by parameter ("Γ = 10")
    dotted: bool = False  # drawn thin and dotted, and without the parameters' names


def plot_shapes(
    title: str,
    curves: Mapping[str, ArrayLike],
    plane: tuple[int, int] = (0, 2),
    times: Sequence[float] | None = None,
    outlines: Sequence[Array] = (),
) -> bytes:
    """Draws hoses seen along one axis, to scale, several models over each other.

    Args:
        title: text.
        curves: label to points (m, 3), or (k, m, 3) for k snapshots, the earlier the paler.
        plane: the two coordinates shown, horizontal first.
        times: of the snapshots (s), written beside them.
        outlines: of solid things, polygons (k, 2) in the plane shown (m), behind the hoses.
    """
    check_some("curves", curves)
    stacks = _flatten(curves, plane)
    size = choose_size(np.concatenate([*_list_corners(stacks), *outlines]))
    columns = 2 if size[0] > 7.0 else 1
    rows = -(-len(stacks) // columns)
    with make_axes(_wrap(title, size), (size[0], size[1] + 0.2 * rows)) as (figure, axes):
        handles = draw_shapes(axes, stacks, plane, outlines)
        add_legend(figure, handles, columns)
        label_snapshots(figure, axes, stacks, times)
        return encode_png(figure)


def draw_shapes(
    axes: Axes,
    stacks: Mapping[str, Array],
    plane: tuple[int, int] = (0, 2),
    outlines: Sequence[Array] = (),
) -> list[Line2D]:
    """Draws snapshots (k, m, 2) by label into axes; returns what the legend has to hold."""
    every = np.concatenate([*_list_corners(stacks), *outlines])
    unit, factor = choose_length_unit(float(np.ptp(every, axis=0).max()))
    for outline in outlines:
        axes.fill(*(factor * outline).T, color=_SOLID, lw=0.0, zorder=1)
    handles = []
    for rank, (label, stack) in enumerate(stacks.items()):
        width = _WIDTHS[min(rank, len(_WIDTHS) - 1)]
        base = 0.45 if rank == 0 and len(stacks) > 1 else 0.0
        for k, shape in enumerate(factor * stack):
            age = 1.0 - (k + 1) / len(stack)
            color = format_hex(lighten(find_color(label, rank), base + (0.75 - base) * age))
            order = 2 + k + rank / 8
            axes.plot(*shape.T, color=color, lw=width, solid_capstyle="round", zorder=order)
        full = format_hex(lighten(find_color(label, rank), base))
        handles.append(Line2D([], [], color=full, lw=width, label=name_model(label)))
    _set_view(axes, factor * every, unit, plane)
    return handles


def label_snapshots(
    figure: Figure, axes: Axes, stacks: Mapping[str, Array], times: Sequence[float] | None
) -> None:
    """Writes the times beside snapshots, once all else is laid out."""
    if times is None:
        return
    every = np.concatenate(_list_corners(stacks))
    factor = choose_length_unit(float(np.ptp(every, axis=0).max()))[1]
    first = factor * next(iter(stacks.values()))
    spots = first[:, choose_label_point(first)]
    near = 0.02 * factor * float(np.ptp(every, axis=0).max())
    notes = []
    for run in group_places(spots, near):
        names = dict.fromkeys((f"{times[run[0]]:.3g} s", f"{times[run[-1]]:.3g} s"))
        x, y = spots[run[0]]
        notes.append(Label(x, y, " to ".join(names), PLAIN))
    lines = [tuple(factor * shape.T) for stack in stacks.values() for shape in stack]
    label_points(figure, axes, notes, lines)


def plot_fan(title: str, fans: Sequence[Fan], plane: tuple[int, int] = (0, 2)) -> bytes:
    """Draws equilibria over a parameter, to scale; names of the parameters stand at the tips."""
    check_some("fans", fans)
    stacks = [_flatten(fan.curves, plane) for fan in fans]
    every = np.concatenate([curve[0] for stack in stacks for curve in stack.values()])
    size = choose_size(every)
    unit, factor = choose_length_unit(float(np.ptp(every, axis=0).max()))
    with make_axes(_wrap(title, size), (size[0], size[1] + 0.2 * len(fans))) as (figure, axes):
        handles, notes, lines = [], [], []
        for place, (fan, stack) in enumerate(zip(fans, stacks, strict=True)):
            style: dict[str, Any] = {"ls": ":" if fan.dotted else "-", "zorder": 3 + fan.dotted}
            style["lw"] = 1.5 if fan.dotted else 3.0
            plain = find_color(fan.name, place)
            for rank, (parameter, curve) in enumerate(stack.items()):
                points, color = factor * curve[0], shade(fan.name, rank, len(stack), place)
                style["color"] = format_hex(plain if fan.dotted else color)
                axes.plot(*points.T, solid_capstyle="round", **style)
                lines.append((points[:, 0], points[:, 1]))
                if not fan.dotted and parameter:
                    ink = format_hex(darken(color, 0.3))
                    notes.append(Label(points[-1, 0], points[-1, 1], parameter, ink))
            style["color"] = format_hex(plain)
            handles.append(Line2D([], [], label=name_model(fan.name), **style))
        _set_view(axes, factor * every, unit, plane)
        add_legend(figure, handles, columns=1)
        label_points(figure, axes, notes, lines)
        return encode_png(figure)


def choose_size(points: Array) -> tuple[float, float]:
    """Returns a figure size (inches) that axes to scale over points (k, 2) fill."""
    width, height = np.maximum(1.12 * np.ptp(points, axis=0), 1e-9)
    height = max(height, 0.12 * width)
    scale = min(6.9 / width, 4.6 / height)
    return max(scale * width + 0.9, 5.2), float(scale * height + 1.0)


def group_places(places: Array, near: float) -> list[list[int]]:
    """Returns runs of indices of places (k, 2) that stay `near` the first of the run."""
    runs: list[list[int]] = []
    for k, place in enumerate(places):
        if runs and np.linalg.norm(place - places[runs[-1][0]]) < near:
            runs[-1].append(k)
        else:
            runs.append([k])
    return runs


def choose_label_point(stack: Array) -> int:
    """Returns which point of snapshots (k, m, 2) tells them apart best: an end or the middle."""

    def spread(j: int) -> float:
        gaps = np.linalg.norm(stack[:, None, j] - stack[None, :, j], axis=-1)
        return float(np.min(gaps + np.where(np.eye(len(stack)) > 0.0, np.inf, 0.0), axis=1).mean())

    n = stack.shape[1]
    return n - 1 if len(stack) < 2 else int(max((n - 1, n // 2, 0), key=spread))


def _list_corners(stacks: Mapping[str, Array]) -> list[Array]:
    """Returns all points drawn, (k, 2) each."""
    return [stack.reshape(-1, 2) for stack in stacks.values()]


def _flatten(curves: Mapping[str, ArrayLike], plane: tuple[int, int]) -> dict[str, Array]:
    """Returns snapshots (k, m, 2) by label as seen in a plane."""
    return {
        label: check_curve(label, points)[:, :, list(plane)] for label, points in curves.items()
    }


def _set_view(axes: Axes, points: Array, unit: str, plane: tuple[int, int]) -> None:
    """Sets equal scales, and limits close about the points."""
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(high - low, 0.12 * float((high - low).max()) or 1.0)
    middle = 0.5 * (low + high)
    axes.set_aspect("equal", adjustable="box")
    for k, (name, axis) in enumerate((("x", axes.xaxis), ("y", axes.yaxis))):
        limits = (middle[k] - 0.56 * extent[k], middle[k] + 0.56 * extent[k])
        axes.set(**{f"{name}lim": limits, f"{name}label": f"{'xyz'[plane[k]]} ({unit})"})
        n_ticks = 7 if extent[k] > 0.6 * extent.max() else 4
        axis.set_major_locator(MaxNLocator(n_ticks, steps=(1, 2, 2.5, 5, 10)))


def _wrap(title: str, size: tuple[float, float]) -> str:
    """Breaks a title into lines that fit a figure's width (bold, 11 points)."""
    return "\n".join(textwrap.wrap(title, max(20, int(10.5 * size[0]))))
