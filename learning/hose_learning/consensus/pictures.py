"""The picture of `hose-mj consensus`: clocks that agree, and agents that act by them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from hose_mj.recording.palette import OTHERS, darken, format_hex
from hose_mj.recording.plots.labels import label_line_ends
from hose_mj.recording.plots.style import SOFT, encode_png, make_figure

if TYPE_CHECKING:
    from hose_mj.cli.consensus import Trial

SHOWN_TURNS = 1.0
"""Time during which the agreement is shown, in turns."""
SHOWN_ACTIONS = 16


def draw_consensus(trials: Sequence[Trial], own: Trial) -> bytes:
    """Returns the PNG: disagreement over time above, the actions of one trial below.

    Args:
        trials: one for each loss.
        own: the one whose actions are drawn.
    """
    n = own.settings.n_agents
    with make_figure((7.6, 5.6), f"{n} clocks agree on whose turn it is") as figure:
        above, below = figure.subplots(2, 1, height_ratios=(3, 2))
        ends = _draw_agreement(above, trials)
        _draw_actions(below, own)
        figure.draw_without_rendering()
        label_line_ends(above, ends)
        return encode_png(figure)


def _draw_agreement(axes: Axes, trials: Sequence[Trial]) -> list[tuple[float, str, str]]:
    """Draws disagreement over time; returns where each line ends, its name and colour."""
    ends = []
    for place, trial in enumerate(trials):
        color = OTHERS[place % len(OTHERS)]
        clocks = trial.clocks
        shown = clocks.times <= SHOWN_TURNS
        deviations = clocks.clocks.std(axis=1)[shown]
        axes.plot(clocks.times[shown], deviations, color=format_hex(color), lw=1.3)
        exact = trial.record["exact_disagreement"]
        if exact > 0.0:
            axes.axhline(exact, color=format_hex(color), lw=0.9, ls=(0, (1.5, 1.5)))
        name = f"{100.0 * trial.settings.loss:g} % lost"
        ends.append((float(deviations[-1]), name, format_hex(darken(color))))
    axes.set_yscale("log")
    axes.set_xlim(0.0, SHOWN_TURNS)
    axes.set_xlabel("time (turns); dotted: the exact value in the long run")
    axes.set_ylabel("standard deviation\nof the clocks (turns)")
    return ends


def _draw_actions(axes: Axes, trial: Trial) -> None:
    """Draws a bar for each action, with its turn, on the line of its agent."""
    settings = trial.settings
    shown = trial.play.actions[:SHOWN_ACTIONS]
    for action in shown:
        color = OTHERS[action.agent % len(OTHERS)]
        width = action.end - action.begin
        axes.barh(action.agent, width, left=action.begin, height=0.55, color=format_hex(color))
        axes.axvline(action.begin, color=SOFT, lw=0.5, ls=(0, (1, 3)), zorder=0)
        axes.annotate(
            str(action.turn),
            (action.begin, action.agent - 0.3),
            xytext=(0, 1),
            textcoords="offset points",
            fontsize=7.0,
            color=SOFT,
            va="bottom",
        )
    axes.grid(False)
    axes.set_ylim(settings.n_agents - 0.5, -0.8)
    axes.set_yticks(range(settings.n_agents), [f"agent {i}" for i in range(settings.n_agents)])
    given = "given when the action is done" if settings.early_finish else "left to run out"
    lost = f"{100.0 * settings.loss:g} % of messages lost"
    axes.set_xlabel(f"time (turns); bars: who acts in which turn; {lost}, turns {given}")
