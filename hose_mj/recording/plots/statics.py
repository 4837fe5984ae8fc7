"""Errors against closed forms: one panel per model, one line per parameter, over the resolution."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter, NullLocator

from hose_mj.recording.palette import Rgb, darken, find_color, format_hex, lighten, name_model
from hose_mj.recording.plots.labels import label_line_ends
from hose_mj.recording.plots.style import (
    ERRORS,
    PLAIN,
    add_legend,
    check_some,
    choose_looks,
    draw_levels,
    encode_png,
    is_positive,
    label_resolutions,
    make_figure,
)

_RAW: dict[str, Any] = {"ls": ":", "lw": 0.9, "ms": 3.6, "mfc": "white", "mew": 0.8, "zorder": 2}
_RAW["alpha"] = 0.55
_CORRECTED: dict[str, Any] = {"ls": "-", "lw": 1.4, "ms": 4.2, "mew": 0.8, "zorder": 3}


@dataclass(frozen=True)
class ErrorPoint:
    """One result of one model."""

    model: str  # model id; each has a panel
    parameter: str  # of the case ("Γ = 10"), "" where there is none; each has a line
    resolution: int  # control points or segments
    error: float  # as a fraction
    # True or False for a model whose clamp needs correcting, else None.
    clamp_corrected: bool | None = None


def plot_errors(
    title: str, points: Sequence[ErrorPoint], ylabel: str = "error (of the reference)"
) -> bytes:
    """Draws error over resolution, both logarithmic, in panels that share the errors' axis.

    Filled marks on full lines are clamp-corrected or in no need of it, hollow ones on faint dotted
    lines as documented.
    """
    check_some("points", points)
    drawn = [p for p in points if is_positive(p.error)]
    models = list(dict.fromkeys(p.model for p in points))
    parameters = list(dict.fromkeys(p.parameter for p in points))
    height = 3.1 + 0.2 * min(len(parameters), 6)
    with make_figure((7.6, height), title) as figure:
        panels = figure.subplots(1, len(models), sharey=True, squeeze=False)[0]
        for axes, model in zip(panels, models, strict=True):
            _draw_panel(axes, model, [p for p in drawn if p.model == model], parameters)
        panels[0].set_ylabel(ylabel)
        _set_errors(panels[0], drawn)
        add_legend(figure, _make_handles(drawn, len(points) - len(drawn)))
        _name_lines(figure, panels, models, drawn, parameters)
        return encode_png(figure)


def shade(model: str, rank: int, n: int, place: int = 0) -> Rgb:
    """Returns the colour of the rank-th of n parameters: the model's, from pale to dark.

    A model without a colour of its own takes the spare one at `place`.
    """
    color = find_color(model, place)
    if n < 2:
        return color
    share = rank / (n - 1)
    return lighten(color, 0.5 - share) if share < 0.5 else darken(color, 0.9 * (share - 0.5))


def _draw_panel(
    axes: Axes, model: str, points: Sequence[ErrorPoint], parameters: Sequence[str]
) -> None:
    marker = choose_looks([model])[model].marker
    for rank, parameter in enumerate(parameters):
        color = format_hex(shade(model, rank, len(parameters)))
        for raw in (True, False):
            line = sorted(
                (p.resolution, p.error)
                for p in points
                if p.parameter == parameter and (p.clamp_corrected is False) == raw
            )
            style = _RAW if raw else {**_CORRECTED, "mfc": color}
            axes.plot(*np.array(line).reshape(-1, 2).T, color=color, marker=marker, **style)
    axes.set_xscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    label_resolutions(axes, np.array([p.resolution for p in points], dtype=np.float64))
    axes.set_xlabel("control points" if model.startswith("geds") else "segments")
    axes.set_title(name_model(model), fontsize=9.5, color=format_hex(darken(shade(model, 0, 1))))


def _set_errors(axes: Axes, points: Sequence[ErrorPoint]) -> None:
    """Makes the shared axis logarithmic; raw results that are exact by chance do not stretch it."""
    axes.set_yscale("log")
    axes.yaxis.set_minor_locator(NullLocator())
    errors = [p.error for p in points]
    if errors:
        low = min([p.error for p in points if p.clamp_corrected is not False] or errors)
        axes.set_ylim(min(max(low, 1e-10) / 2.0, 3e-4), max(max(errors) * 2.0, 3e-2))


def _name_lines(
    figure: Figure,
    panels: Sequence[Axes],
    models: Sequence[str],
    points: Sequence[ErrorPoint],
    parameters: Sequence[str],
) -> None:
    """Writes the parameters at the ends of the lines, the finest resolution of each."""
    for place, axes in enumerate(panels):
        draw_levels(axes, ERRORS, named=place == 0)
    if len(parameters) < 2:
        return
    figure.draw_without_rendering()
    for axes, model in zip(panels, models, strict=True):
        ends = []
        for rank, parameter in enumerate(parameters):
            line = [
                (p.resolution, p.error)
                for p in points
                if (p.model, p.parameter) == (model, parameter) and p.clamp_corrected is not False
            ]
            if line:
                ink = format_hex(darken(shade(model, rank, len(parameters)), 0.3))
                ends.append((max(line)[1], parameter, ink))
        label_line_ends(axes, ends, fontsize=7.5)


def _make_handles(points: Sequence[ErrorPoint], n_hidden: int) -> list[Line2D]:
    handles = []
    if any(p.clamp_corrected is False for p in points):
        raw, corrected = "MuJoCo's clamp as documented", "its clamp corrected"
        handles = [
            Line2D([], [], color=PLAIN, ls=":", lw=0.9, marker="s", ms=3.6, mfc="w", label=raw),
            Line2D([], [], color=PLAIN, lw=1.4, marker="s", ms=4.2, label=corrected),
        ]
    if n_hidden:
        handles.append(Line2D([], [], ls="", label=f"{n_hidden} not drawn (not above 0)"))
    return handles
