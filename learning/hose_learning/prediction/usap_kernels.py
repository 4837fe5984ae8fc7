"""What compiled training loops need of undesired state-action prediction (chapter 8).

A forest of decision trees lies flat in arrays of fixed size, one forest for each agent, so that it
can be grown anew in place between two calls of a compiled loop. The attributes of its splits are
the variables as `kernels.observe` wrote them and the action's number: scaling would move the
thresholds and change no answer.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import draw_below

Small = npt.NDArray[np.int32]

SAFE, UNDESIRED = 0, 1
LEAF = -1


class Buffer(NamedTuple):
    """A balanced training set for each agent: as many instances at most of each action and class.

    Attributes:
        values: all variables (n_agents, n_actions, 2, capacity, n_variables).
        counts: how many of the places are taken, the first ones (n_agents, n_actions, 2).
        seen: how many instances each agent has been given since its last fit (n_agents,).
    """

    values: Small
    counts: Integers
    seen: Integers


class Forest(NamedTuple):
    """What was learned from the buffer.

    Attributes:
        feature: what a node splits by, a variable's number or n_variables for the action; LEAF in a
            leaf (n_agents, n_trees, n_nodes).
        threshold: a value up to it goes left (n_agents, n_trees, n_nodes).
        left: the left child (n_agents, n_trees, n_nodes).
        right: the right child (n_agents, n_trees, n_nodes).
        undesired: share of undesired instances in a node (n_agents, n_trees, n_nodes).
        trained: mu_(a, omega), the instances of each action and class that the forest was fitted
            to (n_agents, n_actions, 2).
        minimum: mu, the least of them with which an action may be vetoed.
        veto_probability: actions are vetoed from this probability on.
    """

    feature: Small
    threshold: Floats
    left: Small
    right: Small
    undesired: Floats
    trained: Integers
    minimum: int
    veto_probability: float


@jitable
def add_instance(buffer, values, agent, action, undesired, stream):  # type: ignore[no-untyped-def]
    """Keeps an instance; where its action and class are full it replaces a random one of them.

    Args:
        buffer: changed in place.
        values: what the agent saw before its move (n_variables,).
        agent: who moved.
        action: its action.
        undesired: UNDESIRED if the move broke a constraint, SAFE if not.
        stream: random numbers.
    """
    place = buffer.counts[agent, action, undesired]
    if place < buffer.values.shape[3]:
        buffer.counts[agent, action, undesired] += 1
    else:
        place = draw_below(stream, buffer.values.shape[3])
    for k in range(buffer.values.shape[4]):
        buffer.values[agent, action, undesired, place, k] = values[k]
    buffer.seen[agent] += 1


@jitable
def predict_undesired(forest, values, agent, action):  # type: ignore[no-untyped-def]
    """Returns p(s, a), the probability that an action breaks a constraint at once.

    It is 0 while an action has fewer than `minimum` instances of either class.
    """
    trained = forest.trained
    if min(trained[agent, action, SAFE], trained[agent, action, UNDESIRED]) < forest.minimum:
        return 0.0
    total = 0.0
    for tree in range(forest.feature.shape[1]):
        node = 0
        feature = forest.feature[agent, tree, node]
        while feature != LEAF:
            value = values[feature] if feature < values.shape[0] else action
            if value <= forest.threshold[agent, tree, node]:
                node = forest.left[agent, tree, node]
            else:
                node = forest.right[agent, tree, node]
            feature = forest.feature[agent, tree, node]
        total += forest.undesired[agent, tree, node]
    return total / forest.feature.shape[1]


@jitable
def compute_veto_mask(forest, values, agent):  # type: ignore[no-untyped-def]
    """Returns, as bits, the actions that the forest of an agent vetoes in what it sees."""
    vetoed = 0
    for action in range(forest.trained.shape[1]):
        if predict_undesired(forest, values, agent, action) >= forest.veto_probability:
            vetoed |= 1 << action
    return vetoed
