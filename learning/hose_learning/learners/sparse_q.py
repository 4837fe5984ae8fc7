"""Sparse cooperative Q-learning with edge-based decomposition (Kok and Vlassis 2006; 3.6.3).

As in coordinated Q-learning the team's values are a sum over edges, but each edge learns from the
rewards and values of its own two agents: no error of the whole team has to be known.
"""

from typing import NamedTuple

from numpy.random import Generator

from hose_learning import rules
from hose_learning.learner import Made, make_learner
from hose_learning.learners import coordination
from hose_learning.learners.joint import get_own_reward
from hose_learning.learners.round_robin import get_learning_rate
from hose_learning.learners.solvers import Graph, compute_place
from hose_learning.records import Learner, Memory
from hose_learning.settings import LearnerSettings, get_options
from hose_mj.jit import jitable
from hose_mj.tasks.checks import check_choice
from hose_mj.tasks.task import Task

OPTIONS = {**coordination.OPTIONS, "update": "edge"}
"""Those of `coordination.OPTIONS`, and whether each "edge" has a TD error of its own or each
"agent", shared by its edges."""


class Sparse(NamedTuple):
    """The rule's constants: gamma, the coordination graph, and what `OPTIONS` says of updates."""

    discount: float
    graph: Graph
    updates_by_agent: bool


def make(task: Task, settings: LearnerSettings, generator: Generator) -> Made:
    """Makes the learner; see `hose_learning.learner.make_learner`.

    Raises:
        InputError: a wrong option (see `OPTIONS`), or settings that a sum over edges does not
            allow.
    """
    options = get_options(settings, OPTIONS)
    check_choice("update", options["update"], ("edge", "agent"))
    graph, scratch = coordination.make_coordination(task, settings, options)
    rule = Sparse(float(settings.discount), graph, options["update"] == "agent")
    width, n_edges = task.n_actions**2, len(graph.edges)
    return make_learner(task, settings, rule, generator, scratch, width, n_edges)


rules.choose_joint.register(Sparse)(coordination.choose_on_graph)


@rules.learn_joint.register(Sparse)
@jitable
def learn_joint(rule: Sparse, learner: Learner, memory: Memory, is_over: bool) -> None:
    """Learns from the joint action a* that is best for the whole graph in the new state."""
    for module in range(learner.bases.shape[0]):
        if not is_over:
            coordination.maximize_module(rule.graph, learner, memory, module)
        if rule.updates_by_agent:
            update_by_agent(rule, learner, memory, module, is_over)
        else:
            update_by_edge(rule, learner, memory, module, is_over)


@jitable
def get_next_value(rule: Sparse, memory: Memory, edge: int, is_over: bool) -> float:
    """Returns gamma Q_ij(s', a*_i, a*_j); 0 if the episode is over."""
    if is_over:
        return 0.0
    return rule.discount * memory.own.values[compute_place(rule.graph, edge, memory.own.best)]


@jitable
def update_by_edge(
    rule: Sparse, learner: Learner, memory: Memory, module: int, is_over: bool
) -> None:
    """Each edge learns from its agents' rewards, of which each of their edges gets its share.

    Q_ij(s, a_i, a_j) <- (1 - alpha) Q_ij(s, a_i, a_j)
                         + alpha [R_i / |G_i| + R_j / |G_j| + gamma Q_ij(s', a*_i, a*_j)]
    """
    graph, alpha = rule.graph, get_learning_rate(learner, memory)
    for edge in range(graph.edges.shape[0]):
        td_target = get_next_value(rule, memory, edge, is_over)
        for side in range(2):
            agent = graph.edges[edge, side]
            reward = get_own_reward(learner, memory, agent, module)
            td_target += reward / graph.degrees[agent]
        delta = td_target - coordination.get_edge_value(graph, learner, memory, edge, module)
        if delta != 0.0:  # a row of zeros that stays so is not stored
            coordination.add_to_edge(graph, learner, memory, edge, module, alpha * delta)


@jitable
def update_by_agent(
    rule: Sparse, learner: Learner, memory: Memory, module: int, is_over: bool
) -> None:
    """Each agent's TD error is shared among its edges; its values are half of theirs.

    Q_k = 1/2 sum_j Q_kj,  delta_k = R_k + gamma Q_k(s', a*) - Q_k(s, a)
    Q_ij(s, a_i, a_j) <- Q_ij(s, a_i, a_j) + alpha (delta_i / |G_i| + delta_j / |G_j|)
    """
    graph, alpha, errors = rule.graph, get_learning_rate(learner, memory), memory.own.errors
    for agent in range(errors.shape[0]):
        errors[agent] = get_own_reward(learner, memory, agent, module)
    for edge in range(graph.edges.shape[0]):
        gain = get_next_value(rule, memory, edge, is_over)
        gain -= coordination.get_edge_value(graph, learner, memory, edge, module)
        for side in range(2):
            errors[graph.edges[edge, side]] += 0.5 * gain
    for edge in range(graph.edges.shape[0]):
        delta = 0.0
        for side in range(2):
            agent = graph.edges[edge, side]
            delta += errors[agent] / graph.degrees[agent]
        if delta != 0.0:  # a row of zeros that stays so is not stored
            coordination.add_to_edge(graph, learner, memory, edge, module, alpha * delta)
