"""Plots of a comparison as PNG bytes: one function per kind, no pyplot, no global state.

Labels that start with a model id take that model's colour and marker (`palette`).
"""

from __future__ import annotations

from hose_mj.recording.plots.bars import Bar, BarPanel, plot_bars
from hose_mj.recording.plots.curves import measure_order, plot_convergence, plot_series
from hose_mj.recording.plots.shapes import Fan, plot_fan, plot_shapes
from hose_mj.recording.plots.statics import ErrorPoint, plot_errors
from hose_mj.recording.plots.style import choose_length_unit, format_seconds
from hose_mj.recording.plots.work import (
    Gap,
    WorkPoint,
    compute_pareto_front,
    plot_overview,
    plot_work_precision,
)

__all__ = [
    "Bar",
    "BarPanel",
    "ErrorPoint",
    "Fan",
    "Gap",
    "WorkPoint",
    "choose_length_unit",
    "compute_pareto_front",
    "format_seconds",
    "measure_order",
    "plot_bars",
    "plot_convergence",
    "plot_errors",
    "plot_fan",
    "plot_overview",
    "plot_series",
    "plot_shapes",
    "plot_work_precision",
]
