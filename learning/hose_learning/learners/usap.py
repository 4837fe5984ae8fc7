"""Undesired state-action prediction (Algorithms 8.1 and 8.3): a classifier vetoes for the learner.

Round-robin Q-learning, of one agent (8.1) or several (8.3). Each move is an instance for the
agent's classifier, which is fitted anew every so often; from then on an action that it holds for
undesired with probability 1/2 or more is not taken.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.random import Generator
from sklearn.ensemble import RandomForestClassifier
from sklearn.tree import DecisionTreeClassifier

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners.round_robin import add_rewards, end_episode, on_observe
from hose_learning.prediction.classifiers import count_split_attributes
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, check_range, get_options
from hose_mj.errors import InputError
from hose_mj.jit import jitable
from hose_mj.tasks.checks import check_choice, check_integer
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import Stream, draw_below, make_stream
from hose_mj.tasks.task import Task

N_TREES = 10


class UndesiredPredictor:
    """Learns from each agent's own moves which of its actions break a constraint at once.

    A training loop in plain Python calls `remember` after each move and `veto_mask` before it. A
    compiled loop takes `buffer`, `forest` and `stream`, calls `add_instance` and
    `compute_veto_mask` with them, and lets Python call `fit` between two of its calls: the arrays
    stay the same ones.

    Args:
        task: gives the numbers of agents, actions and variables, and the variables' cardinalities.
        generator: seeds the stream of all random choices.
        classifier: "tree" grows one entropy tree, the stand-in of C4.5 (the taxi's classifier in
            section 8.3.2); "forest" ten trees (the hose's).
        capacity: instances kept of each action and class; 100 in section 8.3.2.
        minimum: mu, the instances of either class that an action needs before it can be vetoed. The
            thesis gives no value.
        veto_probability: from which on an action is vetoed. Alg 8.1 and 8.3 execute actions with
            p < 0.5; eq. 8.1 vetoes those with p > 0.5, which is the next number above 0.5 here.
        refit_every: moves of an agent after which `remember` fits its classifier anew; 1 is
            Algorithm 8.1 to the letter.

    Attributes:
        buffer: the instances, see `Buffer`.
        forest: what was learned, see `Forest`.
        stream: random numbers.

    Raises:
        InputError: an option outside its valid set.
    """

    def __init__(
        self,
        task: Task,
        generator: np.random.Generator,
        *,
        classifier: Literal["tree", "forest"] = "tree",
        capacity: int = 100,
        minimum: int = 5,
        veto_probability: float = 0.5,
        refit_every: int = 100,
    ) -> None:
        check_choice("classifier", classifier, ("tree", "forest"))
        check_integer("capacity", capacity, 1, 10**6)
        check_integer("minimum", minimum, 1, capacity)
        check_integer("refit_every", refit_every, 1, 10**9)
        if not 0.0 < veto_probability <= 1.0:
            valid = "a number above 0 and at most 1"
            raise InputError("veto_probability", veto_probability, valid)
        self._classifier, self._refit_every = classifier, refit_every
        self.stream = make_stream(generator)
        classes = (task.n_agents, task.n_actions, 2)
        self.buffer = Buffer(
            values=np.zeros((*classes, capacity, len(task.variables)), np.int32),
            counts=np.zeros(classes, np.int64),
            seen=np.zeros(task.n_agents, np.int64),
        )
        # Each leaf holds an instance, and a tree has one node fewer inside than it has leaves.
        n_trees = 1 if classifier == "tree" else N_TREES
        shape = (task.n_agents, n_trees, 2 * task.n_actions * 2 * capacity - 1)
        self.forest = Forest(
            feature=np.full(shape, LEAF, np.int32),
            threshold=np.zeros(shape),
            left=np.zeros(shape, np.int32),
            right=np.zeros(shape, np.int32),
            undesired=np.zeros(shape),
            trained=np.zeros(classes, np.int64),
            minimum=minimum,
            veto_probability=float(veto_probability),
        )

    def remember(self, values: Integers, agent: int, action: int, undesired: bool) -> None:
        """Keeps an instance <s_t, a_t, omega(r_t)>, and fits anew when it is time.

        `values` (n_variables,) are what the agent saw before the move that broke a constraint or
        not.
        """
        label = UNDESIRED if undesired else SAFE
        add_instance(self.buffer, values, agent, action, label, self.stream)
        if self.buffer.seen[agent] >= self._refit_every:
            self.fit(agent)

    def fit(self, agent: int) -> None:
        """Fits the classifier of an agent to what it remembers of both classes."""
        buffer, forest = self.buffer, self.forest
        buffer.seen[agent] = 0
        attributes, undesired = self.list_instances(agent)
        if len(np.unique(undesired)) < 2:
            return
        seed = int(draw_below(self.stream, 2**31))
        for number, tree in enumerate(self._grow(attributes, undesired, seed)):
            _flatten(tree, [array[agent, number] for array in forest[:5]])
        forest.trained[agent] = buffer.counts[agent]

    def _grow(self, attributes: Integers, undesired: npt.NDArray[np.bool_], seed: int) -> list[Any]:
        if self._classifier == "tree":
            tree = DecisionTreeClassifier(criterion="entropy", random_state=seed)
            return [tree.fit(attributes, undesired)]
        features = count_split_attributes(attributes.shape[1])
        forest = RandomForestClassifier(
            N_TREES, criterion="entropy", max_features=features, random_state=seed
        )
        return list(forest.fit(attributes, undesired).estimators_)

    def list_instances(self, agent: int) -> tuple[Integers, npt.NDArray[np.bool_]]:
        """Returns an agent's instances, variables and action, (n, n_variables + 1) and (n,)."""
        values, labels = [], []
        for action, label in np.ndindex(*self.buffer.counts.shape[1:]):
            kept = self.buffer.values[
                agent, action, label, : self.buffer.counts[agent, action, label]
            ]
            values.append(np.column_stack([kept, np.full(len(kept), action)]))
            labels.append(np.full(len(kept), label == UNDESIRED))
        return np.concatenate(values).astype(np.int64), np.concatenate(labels)

    def veto_mask(self, values: Integers, agent: int) -> int:
        """Returns the actions to avoid in what an agent sees, as bits; they may be all."""
        return int(compute_veto_mask(self.forest, values, agent))


def _flatten(tree: Any, outputs: list[npt.NDArray[Any]]) -> None:
    """Writes a tree of scikit-learn into feature, threshold, left, right, undesired (n_nodes,)."""
    grown = tree.tree_
    n_nodes = grown.node_count
    feature, threshold, left, right, undesired = (output[:n_nodes] for output in outputs)
    is_leaf = grown.children_left < 0
    feature[:] = np.where(is_leaf, LEAF, grown.feature)
    threshold[:] = grown.threshold
    left[:] = grown.children_left
    right[:] = grown.children_right
    undesired[:] = grown.value[:, 0, 1]


Small = npt.NDArray[np.int32]

SAFE, UNDESIRED = 0, 1
LEAF = -1


class Buffer(NamedTuple):
    """A balanced training set for each agent: as many instances at most per action and class."""

    values: Small  # all variables (n_agents, n_actions, 2, capacity, n_variables)
    counts: Integers  # how many of the places are taken, the first ones (n_agents, n_actions, 2)
    seen: Integers  # how many instances each agent has been given since its last fit (n_agents,)


class Forest(NamedTuple):
    """What was learned from the buffer."""

    # What a node splits by, a variable's number or n_variables for the action; LEAF in a leaf
    # (n_agents, n_trees, n_nodes).
    feature: Small
    threshold: Floats  # a value up to it goes left (n_agents, n_trees, n_nodes)
    left: Small  # the left child (n_agents, n_trees, n_nodes)
    right: Small  # the right child (n_agents, n_trees, n_nodes)
    undesired: Floats  # share of undesired instances in a node (n_agents, n_trees, n_nodes)
    # mu_(a, omega), the instances of each action and class that the forest was fitted to (n_agents,
    # n_actions, 2).
    trained: Integers
    minimum: int  # mu, the least of them with which an action may be vetoed
    veto_probability: float  # actions are vetoed from this probability on


@jitable
def add_instance(
    buffer: Buffer, values: Integers, agent: int, action: int, undesired: int, stream: Stream
) -> None:
    """Keeps an instance; where its action and class are full it replaces a random one of them.

    `values` (n_variables,) are what the agent saw before its move, `undesired` is UNDESIRED if that
    broke a constraint and SAFE if not. The buffer is changed in place.
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
def predict_undesired(forest: Forest, values: Integers, agent: int, action: int) -> float:
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
def compute_veto_mask(forest: Forest, values: Integers, agent: int) -> int:
    """Returns, as bits, the actions that the forest of an agent vetoes in what it sees."""
    vetoed = 0
    for action in range(forest.trained.shape[1]):
        if predict_undesired(forest, values, agent, action) >= forest.veto_probability:
            vetoed |= 1 << action
    return vetoed


OPTIONS: dict[str, float | str] = {"classifier": "tree", "minimum": 5, "capacity": 1000}
"""See `UndesiredPredictor`. The thesis keeps 100 instances of each action and
class, with which the taxi is not learned."""


class Usap(NamedTuple):
    """The rule's constants."""

    discounts: Floats  # 1, gamma, .., gamma^N (n_agents + 1,)
    undesired: int  # the events that make a move undesired


class Prediction(NamedTuple):
    """What the classifiers learn from and what they learned, and their random numbers (1,)."""

    buffer: Buffer
    forest: Forest
    stream: npt.NDArray[np.uint64]


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: a wrong option (see `OPTIONS`).
    """
    predictor = _make_predictor(task, settings, generator)
    own = Prediction(predictor.buffer, predictor.forest, predictor.stream)
    discounts = float(settings.discount) ** np.arange(task.n_agents + 1.0)
    rule = Usap(discounts, int(task.kernel.violations))
    return make_learner(task, settings, rule, generator, own)


def _make_predictor(
    task: Task, settings: LearnerSettings, generator: np.random.Generator
) -> UndesiredPredictor:
    options: dict[str, Any] = get_options(settings, OPTIONS)
    for name in ("minimum", "capacity"):
        check_range(name, options[name], 1, 10**6)
        options[name] = int(options[name])
    return UndesiredPredictor(task, generator, **options)


def refresh(task: Task, settings: LearnerSettings, memory: Memory) -> None:
    """Fits the classifiers of all agents to their instances."""
    predictor = _make_predictor(task, settings, np.random.default_rng(0))
    predictor.buffer, predictor.forest, predictor.stream = memory.own
    for agent in range(task.n_agents):
        predictor.fit(agent)


@rules.mask.register(Usap)
@jitable
def mask(rule: Usap, memory: Memory, agent: int, allowed: int) -> int:
    """Leaves the actions with p(s, a) < 1/2."""
    return allowed & ~compute_veto_mask(memory.own.forest, memory.values, agent)


@rules.accumulate.register(Usap)
@jitable
def accumulate(
    rule: Usap, learner: Learner, memory: Memory, agent: int, action: int, events: int
) -> None:
    """Keeps the instance <s_t, a_t, omega(r_t)>, and adds rewards as in Algorithm 6.3."""
    label = UNDESIRED if events & rule.undesired else SAFE
    own = memory.own
    add_instance(own.buffer, memory.values, agent, action, label, own.stream)
    add_rewards(rule, learner, memory, agent, events)


# All else is as in Algorithm 6.3.
rules.on_observe.register(Usap)(on_observe)
rules.end_episode.register(Usap)(end_episode)
