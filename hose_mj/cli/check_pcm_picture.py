"""The picture of `hose-mj check-pcm`: what a PCM's values say about the target's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hose_mj.recording.palette import OTHERS, format_hex
from hose_mj.recording.plots.style import SOFT, add_legend, encode_png, make_axes

if TYPE_CHECKING:
    from hose_learning.mdp.partially_constrained import Propositions


def draw_values(title: str, propositions: Propositions) -> bytes:
    """Returns the PNG: the bound of each target state and what greedy transfer gets, over V_t*."""
    best = propositions.best
    with make_axes(f"Values that a PCM transfers: {title}", (6.4, 4.6)) as (figure, axes):
        ends = np.array([min(best.min(), propositions.greedy.min()), propositions.bounds.max()])
        axes.plot(ends, ends, color=SOFT, lw=0.8, ls=(0, (4, 3)), label="$V_t^*$ itself")
        for values, name, marker, place in (
            (propositions.bounds, "$\\max_a Q_s^*([s], a)$: never below", "o", 1),
            (propositions.greedy, "greedy on the transferred values: never above", "x", 0),
        ):
            color = format_hex(OTHERS[place])
            axes.plot(best, values, ls="", marker=marker, ms=5.0, mfc="none", c=color, label=name)
        axes.set_xlabel("best value of a target state, $V_t^*(s)$")
        axes.set_ylabel("value")
        add_legend(figure, axes.get_legend_handles_labels()[0], columns=2)
        return encode_png(figure)
