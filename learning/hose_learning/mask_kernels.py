"""The veto functions of the training loop by themselves: what a learner allows, what it adds."""

from __future__ import annotations

from hose_learning.loop import keep_keys, see, veto
from hose_learning.mediators import find_above_thresholds
from hose_mj.jit import bitwise


@bitwise
def find_unvetoed(task, learner, memory, agent):  # type: ignore[no-untyped-def]
    """Returns, as bits, what nothing forbids the agent in `memory.state`; maybe nothing."""
    allowed = see(task, learner, memory, agent)
    if learner.has_thresholds:
        allowed &= find_above_thresholds(learner, memory, agent, memory.scores.shape[0])
    return allowed


@bitwise
def add_vetoes(task, learner, memory, agent, action, events):  # type: ignore[no-untyped-def]
    """Vetoes an action that the agent took in `memory.state`, where its events are a reason to."""
    see(task, learner, memory, agent)
    keep_keys(learner, memory, agent)
    memory.actions[agent] = action
    veto(learner, memory, agent, events)
