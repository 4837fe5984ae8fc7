"""Coordinated reinforcement learning (Guestrin, Lagoudakis and Parr 2002; section 3.6.3).

The team's values are a sum over the edges of a coordination graph, the neighbours along the hose by
default. All edges learn from the team's one TD error.
"""

from typing import NamedTuple

from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners import coordination
from hose_learning.learners.joint import sum_team_reward
from hose_learning.learners.round_robin import get_learning_rate
from hose_learning.learners.solvers import Graph
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, get_options
from hose_mj.jit import jitable
from hose_mj.tasks.task import Task


class Coordinated(NamedTuple):
    """The rule's constants: gamma and the coordination graph."""

    discount: float
    graph: Graph


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: a wrong option (see `coordination.OPTIONS`), or settings that a sum over edges
            does not allow.
    """
    graph, scratch = coordination.make_coordination(
        task, settings, get_options(settings, coordination.OPTIONS)
    )
    rule = Coordinated(float(settings.discount), graph)
    width, n_edges = task.n_actions**2, len(graph.edges)
    return make_learner(task, settings, rule, generator, scratch, width, n_edges)


rules.choose_joint.register(Coordinated)(coordination.choose_on_graph)


@rules.learn_joint.register(Coordinated)
@jitable
def learn_joint(rule: Coordinated, learner: Learner, memory: Memory, is_over: bool) -> None:
    """Moves the values of all edges by the TD error of their sum.

    delta = r + gamma max_a' sum_ij Q_ij(s', a'_i, a'_j) - sum_ij Q_ij(s, a_i, a_j)
    Q_ij(s, a_i, a_j) <- Q_ij(s, a_i, a_j) + alpha delta, for every edge {i, j}
    """
    graph, n_edges = rule.graph, rule.graph.edges.shape[0]
    for module in range(learner.bases.shape[0]):
        td_target = sum_team_reward(learner, memory, module)
        if not is_over:
            best = coordination.maximize_module(graph, learner, memory, module)
            td_target += rule.discount * best
        value = 0.0
        for edge in range(n_edges):
            value += coordination.get_edge_value(graph, learner, memory, edge, module)
        delta = td_target - value
        if delta != 0.0:  # rows of zeros that stay so are not stored
            change = get_learning_rate(learner, memory) * delta
            for edge in range(n_edges):
                coordination.add_to_edge(graph, learner, memory, edge, module, change)
