"""Undesired state-action prediction: a classifier learns which actions to veto (Alg 8.1 to 8.3)."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from sklearn.ensemble import RandomForestClassifier
from sklearn.tree import DecisionTreeClassifier

from hose_learning.prediction.classifiers import count_split_attributes
from hose_learning.prediction.usap_kernels import (
    LEAF,
    SAFE,
    UNDESIRED,
    Buffer,
    Forest,
    add_instance,
    compute_veto_mask,
    predict_undesired,
)
from hose_mj.errors import InputError
from hose_mj.tasks.checks import check_choice, check_integer
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import draw_below, make_stream
from hose_mj.tasks.task import Task

N_TREES = 10


class UndesiredPredictor:
    """Learns from each agent's own moves which of its actions break a constraint at once.

    A training loop in plain Python calls `remember` after each move and `veto_mask` before it. A
    compiled loop takes `buffer`, `forest` and `stream`, calls `usap_kernels.add_instance` and
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
        buffer: the instances, see `usap_kernels.Buffer`.
        forest: what was learned, see `usap_kernels.Forest`.
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

        Args:
            values: what the agent saw before its move (n_variables,).
            agent: who moved.
            action: its action.
            undesired: whether the move broke a constraint.
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

    def predict(self, values: Integers, agent: int) -> Floats:
        """Returns p(s, a) of all actions in what an agent sees (n_actions,)."""
        actions = range(self.forest.trained.shape[1])
        return np.array([predict_undesired(self.forest, values, agent, a) for a in actions])

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
