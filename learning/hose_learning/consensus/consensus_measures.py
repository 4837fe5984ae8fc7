"""What is measured on turns by consensus: order, actions at once, room for actions."""

from __future__ import annotations

import numpy as np

from hose_learning.consensus.clocks import Action, ConsensusSettings, Floats, Record


def count_overlaps(actions: tuple[Action, ...]) -> int:
    """Returns how many actions began before an earlier one had ended."""
    ends = np.maximum.accumulate([action.end for action in actions])
    begins = np.array([action.begin for action in actions])
    return int((begins[1:] < ends[:-1]).sum())


def count_disorder(actions: tuple[Action, ...], settings: ConsensusSettings) -> int:
    """Returns how many places of the sequence of turns are not what the order of turns wants."""
    wanted = range(settings.first_turn, settings.first_turn + settings.n_turns)
    got = [action.turn for action in actions]
    wrong = sum(a != b for a, b in zip(got, wanted, strict=False))
    return wrong + abs(len(got) - len(wanted))


def compute_leads(record: Record) -> Floats:
    """Returns how far clocks have got into its turn when each action begins (n_actions,), in turns.

    It is the furthest that any clock has been by then: late messages still tell of it.
    """
    furthest = np.maximum.accumulate(record.clocks.max(axis=1))
    rounds = [round(action.begin / record.round_time) for action in record.actions]
    turns = [action.turn for action in record.actions]
    return np.asarray(furthest[rounds] - turns, np.float64)


def compute_longest_action(lead: float, drift: float) -> float:
    """Returns the longest action that surely ends before the next one begins, in turns.

    The agent after the owner of turn t begins when its clock reaches t + 1, so not before any clock
    does. The furthest that any has been grows by at most 1 + drift per unit of time (a mean of what
    clocks show or showed puts none beyond it) until the owner itself, being done, gives the turn.
    So an action is over in time if lead + (1 + drift) A <= 1.

    The thesis's v = 1/T, a turn as long as the longest action, leaves no room for any disagreement.

    Args:
        lead: how far any clock has got into a turn when its owner begins, at most.
        drift: largest relative error of a clock's rate.
    """
    return (1.0 - lead) / (1.0 + drift)
