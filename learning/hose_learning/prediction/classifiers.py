"""The twelve classifiers of Tables 8.1 and 8.2 by id, each with what stands for it here."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from sklearn.cluster import Birch, KMeans
from sklearn.ensemble import RandomForestClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.mixture import GaussianMixture
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import NuSVC
from sklearn.tree import DecisionTreeClassifier

from hose_learning.experience import Bools
from hose_learning.prediction.cross_validation import Classifier
from hose_mj.errors import InputError, check_choice
from hose_mj.tasks.kernels import Floats, Integers

ClusterRule = Literal["matched", "majority"]


class ClusterClassifier:
    """Clusters found without the classes, which then name the clusters.

    The rule "matched" gives each of two clusters a class of its own, in the way with fewer errors
    on the training set; "majority" gives any cluster the class of most of its instances.
    `InputError` is raised for another rule, or more than two clusters to be matched.
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
        return self._is_undesired[self._clusterer.predict(attributes)]


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
        return np.asarray(self._regression.predict(self._compute_bumps(attributes)), np.bool_)

    def _compute_bumps(self, attributes: Floats) -> Floats:
        """Returns each bump's height at each instance (n, n_bumps)."""
        distances = ((attributes[:, None, :] - self._centres) ** 2).sum(axis=2)
        return np.exp(-distances / (2.0 * self._widths**2 * attributes.shape[1]))


Family = Literal["neighbours", "Bayes", "tree", "clusters", "support vectors", "network"]


@dataclass(frozen=True)
class Setup:
    """What a classifier is made for; `cluster_rule` is that of `ClusterClassifier`."""

    n_attributes: int
    undesired_share: float
    cluster_rule: ClusterRule
    seed: int

    @property
    def nu(self) -> float:
        """The share of the rarer class; a nu-SVM has no solution from twice that share on."""
        return min(self.undesired_share, 1.0 - self.undesired_share)


@dataclass(frozen=True)
class ClassifierEntry:
    """A classifier, and how it is made."""

    name: str  # in the thesis's tables
    runs: str  # what runs here
    family: Family
    make: Callable[[Setup], Classifier]
    # Whether scikit-learn lacks the thesis's algorithm, so that another one runs.
    stands_in: bool = False


def count_split_attributes(n_attributes: int) -> int:
    """Returns how many attributes a forest looks at for a split: log2 n + 1 (section 8.3.2)."""
    return int(math.log2(n_attributes)) + 1


def make_forest(setup: Setup) -> Classifier:
    """Makes a random forest of ten trees, Weka's default at the time of the thesis."""
    features = count_split_attributes(setup.n_attributes)
    return RandomForestClassifier(
        10, criterion="entropy", max_features=features, random_state=setup.seed
    )


def make_entropy_tree(setup: Setup) -> Classifier:
    """Makes an unpruned tree that splits where entropy falls most."""
    return DecisionTreeClassifier(criterion="entropy", random_state=setup.seed)


def _make_support_vectors(kernel: str) -> Callable[[Setup], Classifier]:
    return lambda setup: NuSVC(nu=setup.nu, kernel=kernel, gamma="scale")


def _make_clusters(find: Callable[[int], Any]) -> Callable[[Setup], Classifier]:
    """What makes a classifier of the clusters that `find` makes a finder of, from a seed."""
    return lambda setup: ClusterClassifier(find(setup.seed), setup.cluster_rule)


_make_k_means = _make_clusters(lambda seed: KMeans(2, n_init=10, random_state=seed))
_make_birch = _make_clusters(lambda seed: Birch(threshold=0.5, n_clusters=2))
_make_mixture = _make_clusters(lambda seed: GaussianMixture(2, random_state=seed))


CLASSIFIERS: dict[str, ClassifierEntry] = {
    "1-nn": ClassifierEntry(
        "1-NN", "nearest neighbour", "neighbours", lambda setup: KNeighborsClassifier(1)
    ),
    "3-nn": ClassifierEntry(
        "3-NN", "three nearest neighbours", "neighbours", lambda setup: KNeighborsClassifier(3)
    ),
    "naive-bayes": ClassifierEntry(
        "Naive Bayes", "Gaussian naive Bayes", "Bayes", lambda setup: GaussianNB()
    ),
    "random-forest": ClassifierEntry(
        "Random Forest", "random forest, 10 trees", "tree", make_forest
    ),
    "naive-bayes-tree": ClassifierEntry(
        "Naive Bayes Tree",
        "entropy tree, naive Bayes in the leaves",
        "tree",
        lambda setup: NaiveBayesTree(setup.seed),
        stands_in=True,
    ),
    "c4.5": ClassifierEntry(
        "C4.5 Tree", "entropy tree, not pruned", "tree", make_entropy_tree, stands_in=True
    ),
    "k-means": ClassifierEntry("k-means", "k-means, 2 clusters", "clusters", _make_k_means),
    "cobweb": ClassifierEntry(
        "Cobweb", "Birch, 2 clusters", "clusters", _make_birch, stands_in=True
    ),
    "em": ClassifierEntry("Exp. Max.", "mixture of 2 Gaussians", "clusters", _make_mixture),
    "nu-svm-rbf": ClassifierEntry(
        "nu-SVM RBF", "nu-SVM, RBF", "support vectors", _make_support_vectors("rbf")
    ),
    "nu-svm-sigmoid": ClassifierEntry(
        "nu-SVM Sigmoidal", "nu-SVM, sigmoid", "support vectors", _make_support_vectors("sigmoid")
    ),
    "rbf-network": ClassifierEntry(
        "Gaussian RBF Network",
        "4 Gaussian bumps, logistic regression",
        "network",
        lambda setup: RbfNetwork(setup.seed),
        stands_in=True,
    ),
}


def make_classifier(id: str, setup: Setup) -> Classifier:
    """Makes a classifier that has learned nothing; `InputError` for an unknown id."""
    check_choice("classifier", id, CLASSIFIERS)
    return CLASSIFIERS[id].make(setup)
