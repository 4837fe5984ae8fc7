"""The best joint action on a coordination graph, by three solvers (section 3.6.3, eq. 3.11).

A graph has a payoff f_ij(a_i, a_j) on each edge; wanted are the actions with the highest sum. Each
agent is restricted to what it may do, given as bits.

All work on a `Graph` (graphs.py) and a `Scratch` (coordination.py), whose `values` begin
with the payoffs of the edges. `maximize` is compiled for itself, so that it is found on disk by
every learner and task.
"""

from __future__ import annotations

import math

from hose_learning.policies import draw_allowed, find_best
from hose_mj.jit import bitwise, jitable

ELIMINATION, ASCENT, MAX_PLUS = 0, 1, 2
SOLVERS = {
    "variable-elimination": ELIMINATION,
    "coordinate-ascent": ASCENT,
    "max-plus": MAX_PLUS,
}
MOST_SWEEPS = 1000
"""An ascent ends much earlier; but rounding could let it go round in circles."""


@bitwise
def maximize(graph, scratch, allowed, stream):  # type: ignore[no-untyped-def]
    """Writes the best joint action found into `scratch.best` and returns its payoff.

    Args:
        graph: the graph.
        scratch: payoffs and work arrays.
        allowed: what each agent may do, as bits (n_agents,), none of them 0.
        stream: random numbers for ties and starts.
    """
    if graph.solver == ELIMINATION:
        eliminate(graph, scratch, allowed, stream)
    elif graph.solver == ASCENT:
        ascend(graph, scratch, allowed, stream)
    else:
        pass_messages(graph, scratch, allowed, stream)
    return compute_payoff(graph, scratch.values, scratch.best)


@jitable
def find_place(graph, function, actions):  # type: ignore[no-untyped-def]
    """Returns where `Scratch.values` holds a function's value at a joint action."""
    place = graph.offsets[function]
    for agent in range(actions.shape[0]):
        place += graph.strides[function, agent] * actions[agent]
    return place


@jitable
def compute_payoff(graph, values, actions):  # type: ignore[no-untyped-def]
    """Returns the sum over the edges at a joint action (n_agents,)."""
    payoff = 0.0
    for edge in range(graph.edges.shape[0]):
        payoff += values[find_place(graph, edge, actions)]
    return payoff


@jitable
def keep_if_better(graph, scratch, highest):  # type: ignore[no-untyped-def]
    """Keeps the joint action on trial if it is the best so far; returns the highest payoff."""
    payoff = compute_payoff(graph, scratch.values, scratch.trial)
    if payoff > highest:
        highest = payoff
        for agent in range(scratch.best.shape[0]):
            scratch.best[agent] = scratch.trial[agent]
    return highest


@jitable
def eliminate(graph, scratch, allowed, stream):  # type: ignore[no-untyped-def]
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
            weigh_replies(graph, scratch, step)
            highest = -math.inf
            for action in range(n_actions):
                if allowed[graph.order[step]] >> action & 1:
                    highest = max(highest, scratch.scores[action])
            scratch.values[graph.offsets[made] + number] = highest
    for step in range(n_agents - 1, -1, -1):
        weigh_replies(graph, scratch, step)
        agent = graph.order[step]
        scratch.best[agent] = draw_allowed(find_best(scratch.scores, allowed[agent]), stream)


@jitable
def weigh_replies(graph, scratch, step):  # type: ignore[no-untyped-def]
    """Writes the sum of an elimination's functions for each action of the agent eliminated."""
    agent = graph.order[step]
    for action in range(scratch.scores.shape[0]):
        scratch.best[agent] = action
        total = 0.0
        for k in range(graph.inputs.shape[1]):
            if graph.inputs[step, k] >= 0:
                total += scratch.values[find_place(graph, graph.inputs[step, k], scratch.best)]
        scratch.scores[action] = total


@jitable
def ascend(graph, scratch, allowed, stream):  # type: ignore[no-untyped-def]
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
def improve(graph, scratch, agent, allowed):  # type: ignore[no-untyped-def]
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
def sum_at(graph, scratch, agent):  # type: ignore[no-untyped-def]
    """Returns the sum over the agent's own edges at the joint action on trial."""
    payoff = 0.0
    for edge in range(graph.edges.shape[0]):
        if graph.edges[edge, 0] == agent or graph.edges[edge, 1] == agent:
            payoff += scratch.values[find_place(graph, edge, scratch.trial)]
    return payoff


@jitable
def pass_messages(graph, scratch, allowed, stream):  # type: ignore[no-untyped-def]
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
def send(graph, scratch, edge, side, allowed):  # type: ignore[no-untyped-def]
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
def sum_messages(graph, scratch, agent, action, left_out):  # type: ignore[no-untyped-def]
    """Returns the sum of what the agent is told about its action on all edges but one."""
    total = 0.0
    for edge in range(graph.edges.shape[0]):
        for side in range(2):
            if edge != left_out and graph.edges[edge, 1 - side] == agent:
                total += scratch.messages[edge, side, action]
    return total


@jitable
def decide(graph, scratch, allowed, stream):  # type: ignore[no-untyped-def]
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
                            total += scratch.values[find_place(graph, edge, scratch.trial)]
                        else:
                            total += scratch.messages[edge, side, action]
            scratch.scores[action] = total
        scratch.trial[agent] = draw_allowed(find_best(scratch.scores, allowed[agent]), stream)
