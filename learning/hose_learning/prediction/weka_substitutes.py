"""Classifiers of chapter 8 that scikit-learn lacks, put together from what it has.

Each is a stand-in: it shares the idea with the classifier of the thesis, which ran in Weka, and not
the algorithm.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from sklearn.cluster import KMeans
from sklearn.linear_model import LogisticRegression
from sklearn.naive_bayes import GaussianNB
from sklearn.tree import DecisionTreeClassifier

from hose_learning.experience import Bools
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Floats, Integers

ClusterRule = Literal["matched", "majority"]


class ClusterClassifier:
    """Clusters found without the classes, which then name the clusters.

    Args:
        clusterer: has `fit` and `predict`.
        rule: "matched" gives each of two clusters a class of its own, in the way with fewer errors
            on the training set; "majority" gives any cluster the class of most of its instances.

    Raises:
        InputError: another rule, or more than two clusters to be matched.
    """

    def __init__(self, clusterer: Any, rule: ClusterRule) -> None:
        if rule not in ("matched", "majority"):
            raise InputError("cluster rule", rule, "matched or majority")
        self._clusterer, self._rule = clusterer, rule
        self._is_undesired = np.zeros(0, np.bool_)

    def fit(self, attributes: Floats, undesired: Bools) -> None:
        """Finds the clusters, then names them."""
        clusters = self._clusterer.fit(attributes).predict(attributes)
        n_clusters = max(2, int(clusters.max()) + 1)
        # How far the undesired instances of a cluster outnumber the safe ones.
        surplus = np.bincount(clusters, np.where(undesired, 1.0, -1.0), n_clusters)
        if self._rule == "majority":
            self._is_undesired = surplus > 0.0
            return
        if n_clusters > 2:
            raise InputError("clusters", n_clusters, "two, to be matched with two classes")
        second = bool(surplus[1] > surplus[0])
        self._is_undesired = np.array([not second, second])

    def predict(self, attributes: Floats) -> Bools:
        """Returns the class of each instance's cluster (n,)."""
        found: Bools = self._is_undesired[self._clusterer.predict(attributes)]
        return found


class NaiveBayesTree:
    """A tree with naive Bayes in its leaves, after Kohavi (1996).

    Kohavi splits where that raises the cross-validated accuracy of the naive Bayes below, and not
    below 30 instances; here entropy chooses the splits, and only the least number of instances is
    his.
    """

    LEAST_INSTANCES = 30

    def __init__(self, seed: int) -> None:
        self._tree = DecisionTreeClassifier(
            criterion="entropy", min_samples_leaf=self.LEAST_INSTANCES, random_state=seed
        )
        self._leaves: dict[int, GaussianNB] = {}

    def fit(self, attributes: Floats, undesired: Bools) -> None:
        """Grows the tree, then fits a naive Bayes in each leaf with both classes."""
        self._tree.fit(attributes, undesired)
        self._leaves = {}
        leaves = self._tree.apply(attributes)
        for leaf in np.unique(leaves).tolist():
            inside = leaves == leaf
            varies = np.any(np.ptp(attributes[inside], axis=0) > 0.0)
            if varies and len(np.unique(undesired[inside])) == 2:
                # A tenth of the largest variance keeps flags that are constant within a class
                # from deciding alone.
                naive = GaussianNB(var_smoothing=0.1)
                self._leaves[leaf] = naive.fit(attributes[inside], undesired[inside])

    def predict(self, attributes: Floats) -> Bools:
        """Asks the naive Bayes of each instance's leaf, or the leaf where it has none (n,)."""
        predicted: Bools = np.asarray(self._tree.predict(attributes), np.bool_)
        leaves = self._tree.apply(attributes)
        for leaf, naive in self._leaves.items():
            inside = leaves == leaf
            if inside.any():
                predicted[inside] = naive.predict(attributes[inside])
        return predicted


class RbfNetwork:
    """Gaussian bumps around two cluster centres of each class, and a logistic regression on them.

    Weka's network has normalised bumps with a width for each attribute; these have one each, the
    root mean square distance of their cluster's instances over the root of n_attributes.
    """

    CENTRES = 2

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._regression = LogisticRegression(C=1e3, max_iter=1000)
        self._centres, self._widths = np.zeros((0, 0)), np.zeros(0)

    def fit(self, attributes: Floats, undesired: Bools) -> None:
        """Finds the centres within each class, then fits the regression."""
        centres, widths = [], []
        for label in (False, True):
            instances = attributes[undesired == label]
            number = min(self.CENTRES, len(np.unique(instances, axis=0)))
            clusterer = KMeans(number, n_init=4, random_state=self._seed).fit(instances)
            clusters: Integers = clusterer.labels_
            spread = ((instances - clusterer.cluster_centers_[clusters]) ** 2).mean(axis=1)
            variance = np.bincount(clusters, spread) / np.bincount(clusters)
            centres.append(clusterer.cluster_centers_)
            widths.append(np.sqrt(np.maximum(variance, 1e-4)))
        self._centres, self._widths = np.concatenate(centres), np.concatenate(widths)
        self._regression.fit(self._compute_bumps(attributes), undesired)

    def predict(self, attributes: Floats) -> Bools:
        """Returns the likelier class (n,)."""
        predicted: Bools = np.asarray(
            self._regression.predict(self._compute_bumps(attributes)), np.bool_
        )
        return predicted

    def _compute_bumps(self, attributes: Floats) -> Floats:
        """Returns each bump's height at each instance (n, n_bumps)."""
        distances = ((attributes[:, None, :] - self._centres) ** 2).sum(axis=2)
        bumps: Floats = np.exp(-distances / (2.0 * self._widths**2 * attributes.shape[1]))
        return bumps
