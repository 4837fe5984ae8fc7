"""What learners on a coordination graph share (section 3.6.3, Figure 3.3).

Each edge {i, j} has values Q_ij(s, a_i, a_j) of its own for each module; their sum over the edges
stands for the team's Q(s, a). An edge sees what the first of its two agents sees.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hose_learning.learners.joint import allow_fallbacks, draw_each
from hose_learning.learners.solvers import ELIMINATION, SOLVERS, maximize
from hose_learning.mediators import GREATEST_MASS, MEDIATORS
from hose_learning.records import EPSILON
from hose_learning.settings import LearnerSettings, check_range
from hose_learning.tables import claim, find
from hose_mj.errors import InputError
from hose_mj.jit import jitable
from hose_mj.tasks.checks import check_choice
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import draw_unit
from hose_mj.tasks.task import Task

LARGEST_ELIMINATION = 10**6
"""Most numbers that variable elimination may write down."""


class Graph(NamedTuple):
    """A coordination graph and how its best joint action is found.

    Functions of some agents' actions are numbered: first the edges' payoffs, then what each step of
    the elimination leaves.

    Attributes:
        edges: pairs of agents, the lower number first (n_edges, 2).
        degrees: number of edges of each agent (n_agents,).
        everything: all actions of each agent, as bits (n_agents,).
        order: the agents as they are eliminated (n_agents,).
        ranks: the place of each agent in that order (n_agents,).
        offsets: where each function's values begin (n_functions,).
        strides: what a step of each agent's action adds; 0 where a function does not depend on it
            (n_functions, n_agents).
        sizes: number of values of each function (n_functions,).
        inputs: functions that each step maximizes, filled up with -1 (n_agents, width).
        solver: one of the numbers in `solvers.SOLVERS`.
        rounds: starts of coordinate ascent, or most rounds of messages.
    """

    edges: Integers
    degrees: Integers
    everything: Integers
    order: Integers
    ranks: Integers
    offsets: Integers
    strides: Integers
    sizes: Integers
    inputs: Integers
    solver: int
    rounds: int


def make_graph(
    n_agents: int,
    n_actions: int,
    edges: Sequence[tuple[int, int]],
    solver: int,
    rounds: int,
    eliminates: bool,
) -> Graph:
    """Makes a graph.

    Args:
        n_agents: number of agents.
        n_actions: number of actions of each.
        edges: pairs of agents, the lower number first.
        solver: one of the numbers in `solvers.SOLVERS`.
        rounds: see `Graph`.
        eliminates: whether the solver needs the functions that elimination leaves.

    Raises:
        InputError: elimination of a graph with so many edges that these functions grow too large.
    """
    order, left = order_elimination(n_agents, edges)
    scopes = [*edges, *(left if eliminates else [])]
    sizes = [n_actions ** len(scope) for scope in scopes]
    if sum(sizes) > LARGEST_ELIMINATION:
        valid = "fewer, or a solver that does not eliminate variables"
        raise InputError("edges", list(edges), valid)
    strides = np.zeros((len(scopes), n_agents), np.int64)
    for function, scope in enumerate(scopes):
        for place, agent in enumerate(scope):
            strides[function, agent] = n_actions ** (len(scope) - 1 - place)
    pairs = np.array(edges, np.int64)
    return Graph(
        edges=pairs,
        degrees=np.bincount(pairs.ravel(), minlength=n_agents),
        everything=np.full(n_agents, (1 << n_actions) - 1, np.int64),
        order=np.array(order, np.int64),
        ranks=np.argsort(order),
        offsets=np.cumsum([0, *sizes[:-1]]),
        strides=strides,
        sizes=np.array(sizes, np.int64),
        inputs=_list_inputs(order, scopes),
        solver=solver,
        rounds=rounds,
    )


def read_edges(text: str, n_agents: int) -> list[tuple[int, int]]:
    """Returns the edges of "chain", "complete" or pairs of agents as in "0-1 0-2".

    Raises:
        InputError: text that is no graph, or a graph that leaves out an agent.
    """
    if text == "chain":
        return [(agent, agent + 1) for agent in range(n_agents - 1)]
    every = [(i, j) for i in range(n_agents) for j in range(i + 1, n_agents)]
    if text == "complete":
        return every
    names = {name: (i, j) for i, j in every for name in (f"{i}-{j}", f"{j}-{i}")}
    edges = {names.get(word, (-1, -1)) for word in text.split()}
    if {agent for edge in edges for agent in edge} != set(range(n_agents)):
        valid = (
            f"'chain', 'complete' or edges as in '0-1 0-2' that reach agents 0 to {n_agents - 1}"
        )
        raise InputError("graph", text, valid)
    return sorted(edges)


def order_elimination(
    n_agents: int, edges: Sequence[tuple[int, int]]
) -> tuple[list[int], list[tuple[int, ...]]]:
    """Orders the agents so that each next one has the fewest neighbours, and joins these.

    Returns:
        order: the agents; in a tree each has at most one neighbour after it.
        neighbours: those of each when its turn comes, which the function that it leaves depends on.
    """
    near: dict[int, set[int]] = {agent: set() for agent in range(n_agents)}
    for i, j in edges:
        near[i].add(j)
        near[j].add(i)
    order, neighbours = [], []
    while near:
        agent = min(near, key=lambda one: (len(near[one]), one))
        around = near.pop(agent)
        for one in around:
            near[one] = (near[one] | around) - {one, agent}
        order.append(agent)
        neighbours.append(tuple(sorted(around)))
    return order, neighbours


def _list_inputs(order: Sequence[int], scopes: Sequence[tuple[int, ...]]) -> Integers:
    """Lists for each step the functions of its agent that no earlier step has maximized."""
    inputs: list[list[int]] = [[] for _ in order]
    for function, scope in enumerate(scopes):
        if scope:
            inputs[min(order.index(agent) for agent in scope)].append(function)
    width = max(map(len, inputs))
    return np.array([[*each, *[-1] * (width - len(each))] for each in inputs], np.int64)


OPTIONS: dict[str, float | str] = {
    "graph": "chain",
    "solver": "variable-elimination",
    "rounds": 20,
}
"""The edges: "chain" (neighbours along the hose), "complete", or pairs of agents as in "0-1 0-2";
one of `solvers.SOLVERS`; starts of coordinate ascent, or most rounds of messages of max-plus."""


class Scratch(NamedTuple):
    """Work arrays.

    Attributes:
        values: of all functions of the graph, one after the other; the edges' payoffs first.
        messages: of each edge, from either end, about the other's actions (n_edges, 2, n_actions).
        scores, replies: of one agent's actions (n_actions,).
        trial, best: joint actions (n_agents,).
        errors: TD error of each agent (n_agents,).
    """

    values: Floats
    messages: Floats
    scores: Floats
    replies: Floats
    trial: Integers
    best: Integers
    errors: Floats


def make_coordination(
    task: Task, settings: LearnerSettings, options: dict[str, Any]
) -> tuple[Graph, Scratch]:
    """Makes the graph of some options (see `OPTIONS`), and its work arrays.

    Raises:
        InputError: a wrong option, or settings that a sum over edges does not allow.
    """
    check_settings(task, settings)
    check_choice("solver", options["solver"], SOLVERS)
    check_range("rounds", options["rounds"], 1, 10**6)
    edges = read_edges(options["graph"], task.n_agents)
    solver = SOLVERS[options["solver"]]
    n_agents, n_actions = task.n_agents, task.n_actions
    rounds, eliminates = int(options["rounds"]), solver == ELIMINATION
    graph = make_graph(n_agents, n_actions, edges, solver, rounds, eliminates)
    return graph, make_scratch(graph, n_actions)


def make_scratch(graph: Graph, n_actions: int) -> Scratch:
    """Makes the work arrays of a graph."""
    n_edges, n_agents = len(graph.edges), len(graph.order)
    return Scratch(
        values=np.zeros(graph.sizes.sum()),
        messages=np.zeros((n_edges, 2, n_actions)),
        scores=np.zeros(n_actions),
        replies=np.zeros(n_actions),
        trial=np.zeros(n_agents, np.int64),
        best=np.zeros(n_agents, np.int64),
        errors=np.zeros(n_agents),
    )


def check_settings(task: Task, settings: LearnerSettings) -> None:
    """Raises `InputError` for settings that a sum over the edges of a graph does not allow."""
    if task.n_agents < 2:
        raise InputError("number of agents", task.n_agents, "two or more on a coordination graph")
    if settings.exploration.policy != "epsilon-greedy":
        valid = "'epsilon-greedy' on a coordination graph"
        raise InputError("policy", settings.exploration.policy, valid)
    if MEDIATORS[settings.mediator] != GREATEST_MASS:
        valid = "'greatest-mass' on a coordination graph, which adds up values"
        raise InputError("mediator", settings.mediator, valid)
    for module in settings.modules:
        if module.threshold is not None:
            valid = "None on a coordination graph, where veto modules alone veto"
            raise InputError(f"threshold of module {module.name!r}", module.threshold, valid)


@jitable
def find_edge_key(graph, learner, keys, edge, module):  # type: ignore[no-untyped-def]
    """Returns the key of what an edge sees: what its first agent sees, in the edge's own part."""
    agent = graph.edges[edge, 0]
    bases = learner.bases
    seen = keys[agent, module] - bases[module, min(agent, bases.shape[1] - 1)]
    return bases[module, edge] + seen


@jitable
def number_pair(graph, memory, edge):  # type: ignore[no-untyped-def]
    """Returns the number of the actions a_i, a_j of an edge's agents; the second runs fastest."""
    first = memory.actions[graph.edges[edge, 0]]
    return first * memory.own.scores.shape[0] + memory.actions[graph.edges[edge, 1]]


@jitable
def add_payoffs(graph, learner, memory, module):  # type: ignore[no-untyped-def]
    """Adds a module's values in the state that the agents see to the payoffs of all edges."""
    for edge in range(graph.edges.shape[0]):
        key = find_edge_key(graph, learner, memory.keys, edge, module)
        row = find(memory.table, key)
        for pair in range(graph.sizes[edge]):
            memory.own.values[graph.offsets[edge] + pair] += memory.table.rows[row, pair]


@jitable
def maximize_module(graph, learner, memory, module):  # type: ignore[no-untyped-def]
    """Returns max_a' sum_ij Q_ij(s', a'_i, a'_j) of one module; `memory.own.best` is that a'."""
    memory.own.values[:] = 0.0
    add_payoffs(graph, learner, memory, module)
    return maximize(graph, memory.own, graph.everything, memory.stream)


@jitable
def get_edge_value(graph, learner, memory, edge, module):  # type: ignore[no-untyped-def]
    """Returns Q_ij(s, a_i, a_j) before the joint move."""
    row = find(memory.table, find_edge_key(graph, learner, memory.last_keys, edge, module))
    return memory.table.rows[row, number_pair(graph, memory, edge)]


@jitable
def add_to_edge(graph, learner, memory, edge, module, change):  # type: ignore[no-untyped-def]
    """Adds to Q_ij(s, a_i, a_j) before the joint move."""
    row = claim(memory.table, find_edge_key(graph, learner, memory.last_keys, edge, module))
    memory.table.rows[row, number_pair(graph, memory, edge)] += change


@jitable
def choose_on_graph(rule, task, learner, memory, explores):  # type: ignore[no-untyped-def]
    """Chooses a joint action epsilon-greedily, by the sum of all modules and edges (eq. 3.11)."""
    allow_fallbacks(task, learner, memory)
    if explores and draw_unit(memory.stream) < memory.numbers[EPSILON]:
        draw_each(memory)
        return
    memory.own.values[:] = 0.0
    for module in range(learner.bases.shape[0]):
        add_payoffs(rule.graph, learner, memory, module)
    maximize(rule.graph, memory.own, memory.allowed, memory.stream)
    for agent in range(memory.actions.shape[0]):
        memory.actions[agent] = memory.own.best[agent]
