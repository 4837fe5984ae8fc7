from itertools import product

import numpy as np
import pytest
from hose_learning.learners.solvers import (
    ASCENT,
    ELIMINATION,
    MAX_PLUS,
    compute_payoff,
    make_graph,
    make_scratch,
    maximize,
    order_elimination,
    read_edges,
)

from hose_mj.errors import InputError

N_ACTIONS = 3


class Problem:
    """A random graph with random payoffs and vetoes, and its solution by brute force."""

    def __init__(self, seed, n_agents, tree=False, integers=False, free=False):
        generator = np.random.default_rng(seed)
        self.n_agents = n_agents
        edges = {(int(generator.integers(k)), k) for k in range(1, n_agents)}
        if not tree:
            every = read_edges("complete", n_agents)
            edges |= {edge for edge in every if generator.random() < 0.5}
        self.edges = sorted(edges)
        shape = (len(self.edges), N_ACTIONS, N_ACTIONS)
        self.payoffs = generator.normal(size=shape)
        if integers:
            self.payoffs = generator.integers(-1, 2, shape).astype(float)
        most = 2**N_ACTIONS
        self.allowed = np.full(n_agents, most - 1)
        if not free:
            self.allowed = generator.integers(1, most, n_agents)
        self.stream = np.array([seed], np.uint64)
        choices = [[a for a in range(N_ACTIONS) if bits >> a & 1] for bits in self.allowed]
        self.all_payoffs = {joint: self.sum_at(joint) for joint in product(*choices)}
        self.optimum = max(self.all_payoffs.values())

    def sum_at(self, joint):
        return sum(
            payoff[joint[i], joint[j]]
            for (i, j), payoff in zip(self.edges, self.payoffs, strict=True)
        )

    def solve(self, solver, rounds=50):
        eliminates = solver == ELIMINATION
        graph = make_graph(self.n_agents, N_ACTIONS, self.edges, solver, rounds, eliminates)
        scratch = make_scratch(graph, N_ACTIONS)
        scratch.values[: self.payoffs.size] = self.payoffs.ravel()
        plain, plain_stream = make_scratch(graph, N_ACTIONS), self.stream.copy()
        plain.values[:] = scratch.values
        payoff = maximize(graph, scratch, self.allowed, self.stream)
        # Compiled or not, the solvers do the same bit for bit.
        assert payoff == maximize.py_func(graph, plain, self.allowed, plain_stream)
        assert np.array_equal(scratch.best, plain.best)
        assert np.array_equal(scratch.values, plain.values)
        assert np.array_equal(self.stream, plain_stream)
        joint = tuple(scratch.best.tolist())
        assert joint in self.all_payoffs  # nothing vetoed
        assert payoff == pytest.approx(self.all_payoffs[joint], abs=1e-12)
        assert payoff == compute_payoff(graph, scratch.values, scratch.best)
        assert np.array_equal(scratch.values[: self.payoffs.size], self.payoffs.ravel())
        return joint, payoff


@pytest.mark.parametrize("n_agents", [2, 3, 4, 5])
@pytest.mark.parametrize("integers", [False, True])
def test_variable_elimination_is_exact(n_agents, integers):
    for seed in range(8):
        problem = Problem(seed, n_agents, integers=integers)
        assert problem.solve(ELIMINATION)[1] == pytest.approx(problem.optimum, abs=1e-12)


@pytest.mark.parametrize("n_agents", [2, 4, 6])
@pytest.mark.parametrize("integers", [False, True])
def test_max_plus_is_exact_on_trees(n_agents, integers):
    for seed in range(8):
        problem = Problem(seed, n_agents, tree=True, integers=integers)
        # As many rounds as the longest path has edges.
        payoff = problem.solve(MAX_PLUS, rounds=n_agents - 1)[1]
        assert payoff == pytest.approx(problem.optimum, abs=1e-12)


def test_coordinate_ascent_ends_where_no_agent_can_do_better_alone():
    n_suboptimal = 0
    for seed in range(30):
        problem = Problem(seed, 4)
        joint, payoff = problem.solve(ASCENT, rounds=1)
        n_suboptimal += payoff < problem.optimum - 1e-12
        for agent, action in product(range(4), range(N_ACTIONS)):
            changed = (*joint[:agent], action, *joint[agent + 1 :])
            assert problem.all_payoffs.get(changed, -np.inf) <= payoff + 1e-12
    assert n_suboptimal > 0  # of one start; of very many the best one is found:
    for seed in range(5):
        problem = Problem(seed, 3)
        assert problem.solve(ASCENT, rounds=200)[1] == pytest.approx(problem.optimum, abs=1e-12)


def test_max_plus_keeps_the_best_that_it_has_seen():
    n_improved = 0
    for seed in range(20):
        problem = Problem(seed, 5, free=True)
        payoffs = [problem.solve(MAX_PLUS, rounds)[1] for rounds in (1, 2, 4, 8, 16)]
        assert payoffs == sorted(payoffs)
        assert payoffs[-1] <= problem.optimum + 1e-12
        n_improved += payoffs[-1] > payoffs[0]
    assert n_improved > 0


@pytest.mark.parametrize("solver", [ELIMINATION, ASCENT, MAX_PLUS])
def test_ties_are_open_and_seeded(solver):
    problem = Problem(1, 3, integers=True, free=True)
    best = {joint for joint, payoff in problem.all_payoffs.items() if payoff == problem.optimum}
    assert len(best) > 1
    found = [problem.solve(solver)[0] for _ in range(60)]
    assert len(set(found)) > 1
    if solver == ELIMINATION:
        assert set(found) == best
    problem.stream[0] = 1
    assert [problem.solve(solver)[0] for _ in range(60)] == found


def test_edges_are_read_from_text():
    assert read_edges("chain", 4) == [(0, 1), (1, 2), (2, 3)]
    assert read_edges("complete", 3) == [(0, 1), (0, 2), (1, 2)]
    assert read_edges("2-0 0-1 0-2", 3) == [(0, 1), (0, 2)]
    for text in ("", "0-1", "0-0 1-2", "0-1 1-3", "0-1-2", "0 1 2", "a-b"):
        with pytest.raises(InputError, match="graph is"):
            read_edges(text, 3)


def test_leaves_are_eliminated_first():
    order, neighbours = order_elimination(5, [(0, 1), (1, 2), (1, 3), (3, 4)])
    assert all(len(around) <= 1 for around in neighbours)
    assert sorted(order) == list(range(5))
    # In a ring of four, the first agent's neighbours are joined by what it leaves.
    order, neighbours = order_elimination(4, [(0, 1), (1, 2), (2, 3), (0, 3)])
    assert (order[0], neighbours[0]) == (0, (1, 3))
    assert [len(around) for around in neighbours] == [2, 2, 1, 0]


def test_too_large_an_elimination_is_refused_before_it_is_tried():
    edges = read_edges("complete", 8)
    with pytest.raises(InputError, match="edges is"):
        make_graph(8, 8, edges, ELIMINATION, 20, eliminates=True)
    assert make_graph(8, 8, edges, MAX_PLUS, 20, eliminates=False).sizes.sum() == 28 * 64
