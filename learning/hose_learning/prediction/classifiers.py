"""The twelve classifiers of Tables 8.1 and 8.2 by id, each with what stands for it here."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from sklearn.cluster import Birch, KMeans
from sklearn.ensemble import RandomForestClassifier
from sklearn.mixture import GaussianMixture
from sklearn.naive_bayes import GaussianNB
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import NuSVC
from sklearn.tree import DecisionTreeClassifier

from hose_learning.prediction.cross_validation import Classifier
from hose_learning.prediction.weka_substitutes import (
    ClusterClassifier,
    ClusterRule,
    NaiveBayesTree,
    RbfNetwork,
)
from hose_mj.errors import InputError

Family = Literal["neighbours", "Bayes", "tree", "clusters", "support vectors", "network"]


@dataclass(frozen=True)
class Setup:
    """What a classifier is made for.

    Attributes:
        n_attributes: number of attributes.
        undesired_share: share of the undesired instances among all.
        cluster_rule: how clusters become classes, see `ClusterClassifier`.
        seed: of its random choices.
    """

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
    """A classifier.

    Attributes:
        name: as the thesis's tables have it.
        runs: what runs here; `stands_in` says whether that is another algorithm.
        family: what it has in common with others.
        make: makes one that has learned nothing.
        stands_in: whether scikit-learn lacks the thesis's algorithm.
    """

    name: str
    runs: str
    family: Family
    make: Callable[[Setup], Classifier]
    stands_in: bool = False


def count_split_attributes(n_attributes: int) -> int:
    """Returns how many attributes a forest looks at for a split: log2 n + 1 (section 8.3.2)."""
    return int(math.log2(n_attributes)) + 1


def make_forest(setup: Setup) -> Classifier:
    """Makes a random forest of ten trees, Weka's default at the time of the thesis."""
    features = count_split_attributes(setup.n_attributes)
    forest: Classifier = RandomForestClassifier(
        10, criterion="entropy", max_features=features, random_state=setup.seed
    )
    return forest


def make_entropy_tree(setup: Setup) -> Classifier:
    """Makes an unpruned tree that splits where entropy falls most."""
    tree: Classifier = DecisionTreeClassifier(criterion="entropy", random_state=setup.seed)
    return tree


def _make_support_vectors(kernel: str) -> Callable[[Setup], Classifier]:
    def make(setup: Setup) -> Classifier:
        machine: Classifier = NuSVC(nu=setup.nu, kernel=kernel, gamma="scale")
        return machine

    return make


def _make_k_means(setup: Setup) -> Classifier:
    return ClusterClassifier(KMeans(2, n_init=10, random_state=setup.seed), setup.cluster_rule)


def _make_birch(setup: Setup) -> Classifier:
    return ClusterClassifier(Birch(threshold=0.5, n_clusters=2), setup.cluster_rule)


def _make_mixture(setup: Setup) -> Classifier:
    return ClusterClassifier(GaussianMixture(2, random_state=setup.seed), setup.cluster_rule)


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
    """Makes a classifier that has learned nothing.

    Raises:
        InputError: an unknown id.
    """
    if id not in CLASSIFIERS:
        raise InputError("classifier", id, "one of " + ", ".join(CLASSIFIERS))
    return CLASSIFIERS[id].make(setup)
