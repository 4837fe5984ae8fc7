"""Greedy episodes of what a learner has learned so far: in turns, jointly, or composed (6.4)."""

from __future__ import annotations

from typing import Any

import numpy as np

from hose_mj.compiled import bitwise, jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import STEPS, TURN
from learning import rules
from learning.loop import begin_episode, choose, see
from learning.records import Memory


def make_probe(memory: Memory) -> Memory:
    """Makes a memory that shares what was learned and nothing else, so that tests change nothing.

    Its random numbers, for ties, go on from where those of the memory stand.
    """
    shared = {"table", "vetoes"}
    copied = {name: _copy(value) for name, value in memory._asdict().items() if name not in shared}
    return memory._replace(**copied)


def _copy(value: Any) -> Any:
    """Copies an array, or a NamedTuple of arrays and numbers."""
    if isinstance(value, tuple):
        return type(value)(*map(_copy, value))
    return value.copy() if isinstance(value, np.ndarray) else value


@jitable
def play_turn(task, learner, memory):  # type: ignore[no-untyped-def]
    """Lets the agent whose turn it is make its greedy move; returns the events."""
    agent = memory.state[TURN]
    allowed = see(task, learner, memory, agent)
    action = choose(task, learner, memory, agent, allowed, False)
    return kernels.apply(task, memory.state, agent, action)


@jitable
def play_joint(task, learner, memory):  # type: ignore[no-untyped-def]
    """Lets all agents make their greedy moves at once; returns the events."""
    for agent in range(memory.actions.shape[0]):
        memory.allowed[agent] = see(task, learner, memory, agent)
    rules.choose_joint(learner.rule, task, learner, memory, False)
    return kernels.apply_joint(task, memory.state, memory.actions, memory.charged)


@jitable
def compose(task, learner, memory, start):  # type: ignore[no-untyped-def]
    """Writes the joint move that the agents agree on, one after the other (section 6.4).

    Agent i chooses greedily in the state that its predecessors expect to hand on. In a
    deterministic task an estimated transition is what was seen, so here it is played on a copy of
    the state, as if everything had been seen once; `learning.components.joint_policy` has the
    estimates. Where a terminal state is expected nobody moves any more.

    Args:
        task: the task's kernel record.
        learner: the learner.
        memory: a probe; its state stays as it is.
        start: work array of the state's length.
    """
    state = memory.state
    for k in range(state.shape[0]):
        start[k] = state[k]
    n_agents = memory.actions.shape[0]
    is_over = False
    for agent in range(n_agents):
        if is_over and learner.fallback >= 0:
            memory.actions[agent] = learner.fallback
            continue
        allowed = see(task, learner, memory, agent)
        action = choose(task, learner, memory, agent, allowed, False)
        memory.actions[agent] = action
        if not is_over:
            state[TURN] = agent
            is_over = kernels.is_over(task, kernels.apply(task, state, agent, action))
    for k in range(state.shape[0]):
        state[k] = start[k]


@bitwise
def test_turns(task, learner, memory, n_episodes, max_moves, results):  # type: ignore[no-untyped-def]
    """Plays greedy episodes of agents in turns.

    Args:
        task: the task's kernel record.
        learner: the learner.
        memory: a probe (`make_probe`), changed in place.
        n_episodes: how many.
        max_moves: moves of single agents after which an episode is given up.
        results: moves of single agents and last events of each (n_episodes, 2), written in place.
    """
    for episode in range(n_episodes):
        begin_episode(task, memory)
        events = 0
        while memory.state[STEPS] < max_moves:
            events = play_turn(task, learner, memory)
            if kernels.is_over(task, events):
                break
        results[episode, 0], results[episode, 1] = memory.state[STEPS], events


@bitwise
def test_joint(task, learner, memory, n_episodes, max_moves, results):  # type: ignore[no-untyped-def]
    """Plays greedy episodes of agents that move at once; arguments are those of `test_turns`."""
    for episode in range(n_episodes):
        begin_episode(task, memory)
        events = 0
        while memory.state[STEPS] < max_moves:
            events = play_joint(task, learner, memory)
            if kernels.is_over(task, events):
                break
        results[episode, 0], results[episode, 1] = memory.state[STEPS], events


@bitwise
def test_composed(task, learner, memory, start, n_episodes, max_moves, results):  # type: ignore[no-untyped-def]
    """Plays episodes of composed joint moves; `start` is the work array of `compose`."""
    for episode in range(n_episodes):
        begin_episode(task, memory)
        events = 0
        while memory.state[STEPS] < max_moves:
            compose(task, learner, memory, start)
            events = kernels.apply_joint(task, memory.state, memory.actions, memory.charged)
            if kernels.is_over(task, events):
                break
        results[episode, 0], results[episode, 1] = memory.state[STEPS], events
