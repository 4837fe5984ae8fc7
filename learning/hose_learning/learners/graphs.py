"""Coordination graphs as data: their edges, and the order in which agents are eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Integers

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
