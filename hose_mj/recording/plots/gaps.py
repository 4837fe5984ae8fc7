"""Arrows that say how much more a peer costs at equal error."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.text import Text
from matplotlib.transforms import ScaledTranslation

from hose_mj.recording.episode import Array
from hose_mj.recording.plots.labels import HALO
from hose_mj.recording.plots.style import DPI, Look

_SHIFT = 6.0
"""Distance of an arrow from its level (points of length)."""


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


def draw_gap(axes: Axes, gap: Gap, look: Look) -> Text:
    """An arrow along a level from one model's cost to the other's, with the ratio on it."""
    above = _find_side(gap)
    shift = ScaledTranslation(0.0, above * _SHIFT / 72.0, axes.figure.dpi_scale_trans)
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


def trace_gap(axes: Axes, gap: Gap) -> tuple[Array, Array]:
    """Where an arrow runs, for labels to keep off."""
    ends = axes.transData.transform([(x, gap.at_error) for x in (gap.cost, gap.cost_against)])
    ends[:, 1] += _find_side(gap) * _SHIFT * DPI / 72.0
    x, y = axes.transData.inverted().transform(ends).T
    return x, y


def _find_side(gap: Gap) -> float:
    """The cable's arrow stands above the level (1), anyone else's below (-1)."""
    return 1.0 if gap.against == "cable" else -1.0
