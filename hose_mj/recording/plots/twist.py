"""The twist along a hose as several strains see it, below the shape of the hose."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.recording.plots.axes import check_curve, check_pair, check_some
from hose_mj.recording.plots.labels import label_line_ends
from hose_mj.recording.plots.palette import name_model
from hose_mj.recording.plots.style import SOFT, choose_looks, encode_png, make_figure


def plot_twist(
    title: str,
    arc_lengths: ArrayLike,
    shape: ArrayLike,
    twists: Mapping[str, ArrayLike],
    knots: ArrayLike = (),
) -> bytes:
    """Shape above, twist below, over one axis of arc length.

    Args:
        title: text.
        arc_lengths: (k,), m.
        shape: the centre line there (k, 3), m, of which y and z are drawn.
        twists: label to twist (k,), rad/m.
        knots: arc lengths marked by thin lines.

    Raises:
        InputError: nothing to draw, or shapes that do not fit.
    """
    check_some("twists", twists)
    points = check_curve("shape", shape)[0]
    looks = choose_looks(list(twists))
    ends = []
    with make_figure((7.6, 5.0), title) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2))
        for name, dim, dashes in (("y", 1, "-"), ("z", 2, (0, (5, 2)))):
            s, height = check_pair(name, arc_lengths, points[:, dim])
            above.plot(s, height, color="#444444", ls=dashes)
            ends.append((float(height[-1]), name, "#444444"))
        above.set_ylabel("shape (m)")
        figure.draw_without_rendering()
        label_line_ends(above, ends)
        ends = []
        for label, values in twists.items():
            s, twist = check_pair(label, arc_lengths, values)
            below.plot(s, twist, color=looks[label].color, ls=looks[label].dashes)
            ends.append((float(twist[-1]), name_model(label), looks[label].ink))
        for knot in np.ravel(knots):
            below.axvline(knot, color=SOFT, lw=0.5, ls=(0, (1, 3)), zorder=0)
        below.set_xlim(float(np.min(s)), float(np.max(s)))
        below.set_xlabel("arc length (m)")
        below.set_ylabel("twist (rad/m)")
        figure.draw_without_rendering()
        label_line_ends(below, ends)
        return encode_png(figure)
