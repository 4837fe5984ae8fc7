"""The one picture of a comparison: the motion at the left, what it costs at the right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from hose_mj.recording.plots.axes import check_curve, check_some
from hose_mj.recording.plots.gaps import Gap
from hose_mj.recording.plots.shapes import draw_shapes, label_snapshots
from hose_mj.recording.plots.style import SOFT, encode_png, make_figure
from hose_mj.recording.plots.work import (
    WorkPoint,
    draw_work_precision,
    label_work_precision,
)

SIZE = (1600 / 150, 700 / 150)


def plot_overview(
    curves: Mapping[str, ArrayLike],
    times: Sequence[float],
    points: Sequence[WorkPoint],
    gaps: Sequence[Gap],
    captions: tuple[str, str],
) -> bytes:
    """Snapshots in the x-z plane beside the work-precision plot, 1600 by 700 pixels.

    Args:
        curves: label to snapshots (k, m, 3), the lowest first.
        times: of the snapshots (s), (k,).
        points: of the work-precision plot.
        gaps: of the work-precision plot.
        captions: a line above each side; what stands behind a newline is smaller.
    """
    check_some("curves", curves)
    check_some("points", points)
    with make_figure(SIZE) as figure:
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.12))
        for axes, caption in zip((left, right), captions, strict=True):
            _write_caption(axes, caption)
        stacks = {label: check_curve(label, curve)[:, :, [0, 2]] for label, curve in curves.items()}
        handles = draw_shapes(left, stacks)
        left.legend(handles=handles, loc="upper left", bbox_to_anchor=(-0.05, -0.13))
        left.set_anchor("N")
        drawing = draw_work_precision(right, points, gaps)
        columns = -(-len(drawing.handles) // 2)
        right.legend(
            handles=drawing.handles, loc="upper left", bbox_to_anchor=(-0.08, -0.13), ncols=columns
        )
        label_snapshots(figure, left, stacks, times)
        label_work_precision(figure, right, drawing, spacing=34.0)
        return encode_png(figure)


def _write_caption(axes: Axes, caption: str) -> None:
    head, _, rest = caption.partition("\n")
    axes.set_title(head, pad=22.0 if rest else 8.0)
    if rest:
        axes.annotate(
            rest,
            (0.0, 1.0),
            xycoords="axes fraction",
            xytext=(0, 7),
            textcoords="offset points",
            color=SOFT,
            fontsize=8.5,
        )
