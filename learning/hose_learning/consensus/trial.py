"""Trials of turns by consensus: what clocks do at one loss of messages, measured and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from hose_learning.consensus.clocks import (
    ConsensusSettings,
    Record,
    compute_disagreement,
    compute_leads,
    compute_longest_action,
    count_disorder,
    count_overlaps,
    run_clocks,
    simulate,
)
from hose_mj.recording.palette import OTHERS, darken, format_hex
from hose_mj.recording.plots.labels import label_line_ends
from hose_mj.recording.plots.style import SOFT, encode_png, make_figure

SETTLING_TURNS, MEASURED_TURNS = 10, 40
"""Turns after which clocks that run alone have agreed, and turns measured from then on."""
SHOWN_TURNS = 1.0
"""Time during which the agreement is shown, in turns."""
SHOWN_ACTIONS = 16


class ConsensusTrial(NamedTuple):
    """One loss: clocks that run alone, agents that act (`play`), and numbers for the document."""

    settings: ConsensusSettings
    clocks: Record
    play: Record
    record: dict[str, float]


def run_trial(settings: ConsensusSettings, seed: int) -> ConsensusTrial:
    """Simulates one loss, twice: clocks alone, and agents that act by them."""
    alone, playing = np.random.default_rng(seed).spawn(2)
    settling = SETTLING_TURNS * settings.rounds
    n_rounds = settling + MEASURED_TURNS * settings.rounds
    clocks = run_clocks(settings, alone, n_rounds)
    play = simulate(settings, playing)
    leads = compute_leads(play)
    lead = float(leads.max()) if len(leads) else 1.0  # clocks so coarse that they skip all turns
    reached = (play.clocks.max(axis=1) >= settings.first_turn).argmax()
    duration = (len(play.times) - reached) * settings.round_time  # the last round is over too
    record = {
        "loss": settings.loss,
        "first_spread": float(play.spreads[0]),
        "agreed_spread": float(play.spreads[reached]),
        "disagreement": float(np.sqrt(clocks.clocks[settling:].var(axis=1).mean())),
        "exact_disagreement": compute_disagreement(settings, clocks.rates),
        "actions": len(play.actions),
        "disorder": count_disorder(play.actions, settings),
        "overlaps": count_overlaps(play.actions),
        "longest_safe_action": compute_longest_action(lead, settings.drift),
        "turns_per_time": settings.n_turns / float(duration),
    }
    return ConsensusTrial(settings, clocks, play, record)


def draw_consensus(trials: Sequence[ConsensusTrial], own: ConsensusTrial) -> bytes:
    """Returns the PNG: disagreement of all trials over time above, the actions of one below."""
    n = own.settings.n_agents
    with make_figure((7.6, 5.6), f"{n} clocks agree on whose turn it is") as figure:
        above, below = figure.subplots(2, 1, height_ratios=(3, 2))
        ends = _draw_agreement(above, trials)
        _draw_actions(below, own)
        figure.draw_without_rendering()
        label_line_ends(above, ends)
        return encode_png(figure)


def _draw_agreement(axes: Axes, trials: Sequence[ConsensusTrial]) -> list[tuple[float, str, str]]:
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


def _draw_actions(axes: Axes, trial: ConsensusTrial) -> None:
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
