"""The best joint action on a coordination graph, by three solvers (section 3.6.3, eq. 3.11).

A graph has a payoff f_ij(a_i, a_j) on each edge; wanted are the actions with the highest sum. Each
agent is restricted to what it may do, given as bits. Graphs are data: their edges, and the order in
which agents are eliminated.

All solvers work on a `Graph` and a `Scratch`, whose `values` begin with the payoffs of the edges.
`maximize` is compiled for itself, so that it is found on disk by every learner and task.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hose_learning.policies import compute_best, draw_allowed
from hose_mj.errors import InputError
from hose_mj.jit import bitwise, jitable
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import Stream

ELIMINATION, ASCENT, MAX_PLUS = 0, 1, 2
SOLVERS = {"variable-elimination": ELIMINATION, "coordinate-ascent": ASCENT, "max-plus": MAX_PLUS}
MOST_SWEEPS = 1000  # an ascent ends much earlier; but rounding could let it go round in circles
LARGEST_ELIMINATION = 10**6  # most numbers that variable elimination may write down


class Graph(NamedTuple):
    """A coordination graph and how its best joint action is found.

    Functions of some agents' actions are numbered: first the edges' payoffs, then what each step of
    the elimination leaves.
    """

    edges: Integers  # pairs of agents, the lower number first (n_edges, 2)
    degrees: Integers  # number of edges of each agent (n_agents,)
    everything: Integers  # all actions of each agent, as bits (n_agents,)
    order: Integers  # the agents as they are eliminated (n_agents,)
    ranks: Integers  # the place of each agent in that order (n_agents,)
    offsets: Integers  # where each function's values begin (n_functions,)
    # What a step of each agent's action adds; 0 where a function does not depend on it
    # (n_functions, n_agents).
    strides: Integers
    sizes: Integers  # number of values of each function (n_functions,)
    inputs: Integers  # functions that each step maximizes, filled up with -1 (n_agents, width)
    solver: int  # one of the numbers in `solvers.SOLVERS`
    rounds: int  # starts of coordinate ascent, or most rounds of messages


def make_graph(
    n_agents: int,
    n_actions: int,
    edges: Sequence[tuple[int, int]],
    solver: int,
    rounds: int,
    eliminates: bool,
) -> Graph:
    """Makes a graph of edges, pairs of agents with the lower number first; see `Graph`.

    `eliminates` says whether the solver needs the functions that elimination leaves; `InputError`
    is raised where so many edges make these too large.
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


class Scratch(NamedTuple):
    """Work arrays."""

    values: Floats  # of all functions of the graph, one after the other; the edges' payoffs first
    # Of each edge, from either end, about the other's actions (n_edges, 2, n_actions).
    messages: Floats
    # scores, replies: of one agent's actions (n_actions,).
    scores: Floats
    replies: Floats
    # trial, best: joint actions (n_agents,).
    trial: Integers
    best: Integers
    errors: Floats  # TD error of each agent (n_agents,)


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


@bitwise
def maximize(graph: Graph, scratch: Scratch, allowed: Integers, stream: Stream) -> float:
    """Writes the best joint action found into `scratch.best` and returns its payoff.

    `allowed` is what each agent may do, as bits (n_agents,), none of them 0. The stream decides
    ties and starts.
    """
    if graph.solver == ELIMINATION:
        eliminate(graph, scratch, allowed, stream)
    elif graph.solver == ASCENT:
        ascend(graph, scratch, allowed, stream)
    else:
        pass_messages(graph, scratch, allowed, stream)
    return compute_payoff(graph, scratch.values, scratch.best)


@jitable
def compute_place(graph: Graph, function: int, actions: Integers) -> int:
    """Returns where `Scratch.values` holds a function's value at a joint action."""
    place = graph.offsets[function]
    for agent in range(actions.shape[0]):
        place += graph.strides[function, agent] * actions[agent]
    return place


@jitable
def compute_payoff(graph: Graph, values: Floats, actions: Integers) -> float:
    """Returns the sum over the edges at a joint action (n_agents,)."""
    payoff = 0.0
    for edge in range(graph.edges.shape[0]):
        payoff += values[compute_place(graph, edge, actions)]
    return payoff


@jitable
def keep_if_better(graph: Graph, scratch: Scratch, highest: float) -> float:
    """Keeps the joint action on trial if it is the best so far; returns the highest payoff."""
    payoff = compute_payoff(graph, scratch.values, scratch.trial)
    if payoff > highest:
        highest = payoff
        for agent in range(scratch.best.shape[0]):
            scratch.best[agent] = scratch.trial[agent]
    return highest


@jitable
def eliminate(graph: Graph, scratch: Scratch, allowed: Integers, stream: Stream) -> None:
    """Variable elimination: exact (Guestrin, Koller and Parr 2002).

    In the graph's order each agent is maximized over, e(a_G) = max_a_i sum of the functions with
    a_i, which leaves a function of its neighbours G. In reverse order each then takes its best
    reply to those already known.
    """
    n_agents, n_actions = scratch.best.shape[0], scratch.scores.shape[0]
    for step in range(n_agents):
        made = graph.edges.shape[0] + step
        for number in range(graph.sizes[made]):
            for other in range(n_agents):
                stride = graph.strides[made, other]
                if stride > 0:
                    scratch.best[other] = number // stride % n_actions
            score_replies(graph, scratch, step)
            highest = -math.inf
            for action in range(n_actions):
                if allowed[graph.order[step]] >> action & 1:
                    highest = max(highest, scratch.scores[action])
            scratch.values[graph.offsets[made] + number] = highest
    for step in range(n_agents - 1, -1, -1):
        score_replies(graph, scratch, step)
        agent = graph.order[step]
        scratch.best[agent] = draw_allowed(compute_best(scratch.scores, allowed[agent]), stream)


@jitable
def score_replies(graph: Graph, scratch: Scratch, step: int) -> None:
    """Writes the sum of an elimination's functions for each action of the agent eliminated."""
    agent = graph.order[step]
    for action in range(scratch.scores.shape[0]):
        scratch.best[agent] = action
        total = 0.0
        for k in range(graph.inputs.shape[1]):
            if graph.inputs[step, k] >= 0:
                total += scratch.values[compute_place(graph, graph.inputs[step, k], scratch.best)]
        scratch.scores[action] = total


@jitable
def ascend(graph: Graph, scratch: Scratch, allowed: Integers, stream: Stream) -> None:
    """Coordinate ascent from random joint actions (Vlassis, Elhorst and Kok 2004).

    One agent after the other takes its best reply to all others, until none can do better.
    """
    highest = -math.inf
    for _ in range(graph.rounds):
        for agent in range(scratch.trial.shape[0]):
            scratch.trial[agent] = draw_allowed(allowed[agent], stream)
        changed, sweeps = True, 0
        while changed and sweeps < MOST_SWEEPS:
            changed = False
            sweeps += 1
            for agent in range(scratch.trial.shape[0]):
                changed = improve(graph, scratch, agent, allowed[agent]) or changed
        highest = keep_if_better(graph, scratch, highest)


@jitable
def improve(graph: Graph, scratch: Scratch, agent: int, allowed: Integers) -> bool:
    """Lets an agent take a better reply to the others' actions on trial; whether there is one."""
    trial, before = scratch.trial, scratch.trial[agent]
    best, highest = before, sum_at(graph, scratch, agent)
    for action in range(scratch.scores.shape[0]):
        if allowed >> action & 1:
            trial[agent] = action
            payoff = sum_at(graph, scratch, agent)
            if payoff > highest:
                best, highest = action, payoff
    trial[agent] = best
    return best != before


@jitable
def sum_at(graph: Graph, scratch: Scratch, agent: int) -> float:
    """Returns the sum over the agent's own edges at the joint action on trial."""
    payoff = 0.0
    for edge in range(graph.edges.shape[0]):
        if graph.edges[edge, 0] == agent or graph.edges[edge, 1] == agent:
            payoff += scratch.values[compute_place(graph, edge, scratch.trial)]
    return payoff


@jitable
def pass_messages(graph: Graph, scratch: Scratch, allowed: Integers, stream: Stream) -> None:
    """Max-plus, which keeps the best joint action seen (Kok and Vlassis 2006).

    Exact on a tree once the messages have settled, after as many rounds as its longest path; on
    other graphs an approximation.
    """
    scratch.messages[:] = 0.0
    highest, change = -math.inf, math.inf
    rounds = 0
    while rounds < graph.rounds and change > 0.0:
        rounds += 1
        change = 0.0
        for edge in range(graph.edges.shape[0]):
            for side in range(2):
                change = max(change, send(graph, scratch, edge, side, allowed))
        decide(graph, scratch, allowed, stream)
        highest = keep_if_better(graph, scratch, highest)


@jitable
def send(graph: Graph, scratch: Scratch, edge: int, side: int, allowed: Integers) -> float:
    """Updates the message from one end i of an edge to the other, j; returns the largest change.

    mu_ij(a_j) = max_a_i [f_ij(a_i, a_j) + sum_(k != j) mu_ki(a_i)] - c_ij

    c_ij is the mean, so that messages do not grow around loops.
    """
    sender, receiver = graph.edges[edge, side], graph.edges[edge, 1 - side]
    n_actions = scratch.scores.shape[0]
    for action in range(n_actions):
        scratch.scores[action] = sum_messages(graph, scratch, sender, action, edge)
    total, count = 0.0, 0
    for reply in range(n_actions):
        if allowed[receiver] >> reply & 1:
            highest = -math.inf
            for action in range(n_actions):
                if allowed[sender] >> action & 1:
                    place = graph.offsets[edge] + graph.strides[edge, sender] * action
                    place += graph.strides[edge, receiver] * reply
                    highest = max(highest, scratch.values[place] + scratch.scores[action])
            scratch.replies[reply] = highest
            total += highest
            count += 1
    change = 0.0
    for reply in range(n_actions):
        if allowed[receiver] >> reply & 1:
            message = scratch.replies[reply] - total / count
            change = max(change, abs(message - scratch.messages[edge, side, reply]))
            scratch.messages[edge, side, reply] = message
    return change


@jitable
def sum_messages(graph: Graph, scratch: Scratch, agent: int, action: int, left_out: int) -> float:
    """Returns the sum of what the agent is told about its action on all edges but one."""
    total = 0.0
    for edge in range(graph.edges.shape[0]):
        for side in range(2):
            if edge != left_out and graph.edges[edge, 1 - side] == agent:
                total += scratch.messages[edge, side, action]
    return total


@jitable
def decide(graph: Graph, scratch: Scratch, allowed: Integers, stream: Stream) -> None:
    """Writes the joint action that the messages say is best into `scratch.trial`.

    The agents decide one after the other: with neighbours that have decided counts the payoff with
    their action, and not their message, so that agents agree where there are ties.
    """
    for step in range(scratch.trial.shape[0] - 1, -1, -1):
        agent = graph.order[step]
        for action in range(scratch.scores.shape[0]):
            scratch.trial[agent] = action
            total = 0.0
            for edge in range(graph.edges.shape[0]):
                for side in range(2):
                    if graph.edges[edge, 1 - side] == agent:
                        if graph.ranks[graph.edges[edge, side]] > step:
                            total += scratch.values[compute_place(graph, edge, scratch.trial)]
                        else:
                            total += scratch.messages[edge, side, action]
            scratch.scores[action] = total
        scratch.trial[agent] = draw_allowed(compute_best(scratch.scores, allowed[agent]), stream)
