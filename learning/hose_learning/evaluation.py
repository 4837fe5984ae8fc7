"""Greedy episodes of what a learner has learned so far: in turns, jointly, or composed (6.4)."""

from typing import Any, NamedTuple

import numpy as np

from hose_learning import rules
from hose_learning.loop import begin_episode, choose, see
from hose_learning.records import Learner, Memory
from hose_mj.jit import bitwise, jitable
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import STEPS, TURN, Integers, dispatched


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
def compose(task: Any, learner: Learner, memory: Memory, start: Integers) -> None:
    """Writes the joint move that the agents agree on, one after the other (section 6.4).

    Agent i chooses greedily in the state that its predecessors expect to hand on. In a
    deterministic task an estimated transition is what was seen, so here it is played on a copy of
    the state (`start`, a work array), as if everything had been seen once;
    `hose_learning.mdp.joint_policy` has the estimates. Where a terminal state is expected nobody
    moves any more. The memory is a probe, whose state stays as it is.
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


class Turns(NamedTuple):
    """Agents that move one after the other."""


class Joint(NamedTuple):
    """Agents that learned to move at once."""


class Composed(NamedTuple):
    """Agents that learned in turns and move at once; a work array of the state's length."""

    start: Integers


@dispatched
def play(manner: Any, task: Any, learner: Any, memory: Any) -> int:
    """Makes the next greedy move, one agent's or a joint one, and returns the events."""
    raise NotImplementedError(type(manner).__name__)


@play.register(Turns)
@jitable
def play_turn(manner: Any, task: Any, learner: Learner, memory: Memory) -> int:
    """The agent whose turn it is moves."""
    agent = memory.state[TURN]
    allowed = see(task, learner, memory, agent)
    action = choose(task, learner, memory, agent, allowed, False)
    return kernels.apply(task, memory.state, agent, action)


@play.register(Joint)
@jitable
def play_joint(manner: Any, task: Any, learner: Learner, memory: Memory) -> int:
    """All agents move at once."""
    for agent in range(memory.actions.shape[0]):
        memory.allowed[agent] = see(task, learner, memory, agent)
    rules.choose_joint(learner.rule, task, learner, memory, False)
    return kernels.apply_joint(task, memory.state, memory.actions, memory.caused_events)


@play.register(Composed)
@jitable
def play_composed(manner: Any, task: Any, learner: Learner, memory: Memory) -> int:
    """All agents make the joint move that they agree on."""
    compose(task, learner, memory, manner.start)
    return kernels.apply_joint(task, memory.state, memory.actions, memory.caused_events)


@bitwise
def run_tests(
    manner: Any,
    task: Any,
    learner: Learner,
    memory: Memory,
    n_episodes: int,
    max_moves: int,
    results: Integers,
) -> None:
    """Plays greedy episodes, the agents moving in a manner (`Turns`, `Joint` or `Composed`).

    The memory is a probe (`make_probe`), changed in place. An episode is given up after `max_moves`
    of single agents. `results` gets moves of single agents and last events of each (n_episodes, 2).
    """
    for episode in range(n_episodes):
        begin_episode(task, memory)
        events = 0
        while memory.state[STEPS] < max_moves:
            events = play(manner, task, learner, memory)
            if kernels.is_over(task, events):
                break
        results[episode, 0], results[episode, 1] = memory.state[STEPS], events
