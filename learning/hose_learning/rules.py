"""What a learner's update rule can do, one function name for all; the rule's type selects the code.

As with tasks (`hose_mj.tasks.kernels`): a rule is a NamedTuple of numbers and arrays, each learner
file registers functions for its own, and a loop written with these names compiles for any rule and
runs unchanged as plain Python. A rule needs those of its schedule.

When agents move in turns the loop calls, at each move,

1. `on_observe`: the agent whose turn it is sees the state (`memory.keys[agent]`), so what its last
   move waited for is complete;
2. `accumulate`: it moved, and everyone notes the rewards;
3. `end_episode`: the episode ended, so nothing more follows what still waits.

Before a choice it asks `mask` and `score`, which have defaults.

When agents move at once it calls `choose_joint` and `learn_joint`.
"""

from typing import Any

from hose_learning.mediators import mediate
from hose_learning.records import Learner, Memory
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import dispatched


@dispatched
def on_observe(rule: Any, learner: Any, memory: Any, agent: int) -> None:
    """Learns what can be learned once the agent sees the state in which it is to move."""
    raise NotImplementedError(type(rule).__name__)


@dispatched
def accumulate(rule: Any, learner: Any, memory: Any, agent: int, action: int, events: int) -> None:
    """Notes a move of the agent and its events for the updates that wait for them."""
    raise NotImplementedError(type(rule).__name__)


@dispatched
def end_episode(rule: Any, learner: Any, memory: Any, is_over: bool) -> None:
    """Learns from what still waits when an episode ends, or drops it where one is cut off."""
    raise NotImplementedError(type(rule).__name__)


@dispatched
@jitable
def mask(rule: Any, memory: Memory, agent: int, allowed: int) -> int:
    """Returns, as bits, what the rule leaves of the allowed actions; by default all of them."""
    return allowed


@dispatched
@jitable
def score(rule: Any, learner: Learner, memory: Memory, agent: int) -> None:
    """Writes `memory.scores`, which action choice goes by; by default what the mediator says."""
    mediate(learner, memory, agent)


@dispatched
def choose_joint(rule: Any, task: Any, learner: Any, memory: Any, explores: bool) -> None:
    """Writes every agent's action (`memory.actions`) among the allowed (`memory.allowed`)."""
    raise NotImplementedError(type(rule).__name__)


@dispatched
def learn_joint(rule: Any, learner: Any, memory: Any, is_over: bool) -> None:
    """Learns from a joint move: `last_keys`, `actions`, `rewards`, and the new state's `keys`."""
    raise NotImplementedError(type(rule).__name__)
