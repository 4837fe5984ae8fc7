"""Coordinated and sparse Q-learning against team Q-learning and against their equations."""

from itertools import product

import numpy as np
import pytest
from hose_learning import rules
from hose_learning.learners.coordination import compute_edge_key
from hose_learning.modules import Module
from hose_learning.records import EPISODES, FRESH

from hose_mj.tasks import kernels

ALPHA, GAMMA = 0.3, 0.9


@pytest.mark.parametrize(
    ("file", "options"),
    [("coordinated_q", {}), ("sparse_q", {}), ("sparse_q", {"update": "agent"})],
)
def test_on_one_edge_they_are_team_q_step_by_step(corridor, make_trainee, file, options):
    team = make_trainee("team_q", corridor, epsilon=0.3, learning_rate=ALPHA)
    other = make_trainee(file, corridor, learning_rate=ALPHA, options=options)
    # The other learner looks on, with values of its own.
    own = {name: getattr(other.memory, name) for name in ("table", "own", "scores", "stream")}
    memory = team.memory._replace(**own)
    for _ in range(500):
        team.run(2)
        events = team.log.episodes[team.log.used[0] - 1, 1] if memory.counters[FRESH] else 0
        is_over = bool(kernels.is_over(corridor.kernel, events))
        rules.learn_joint(other.learner.rule, other.learner, memory, is_over)
        if options:  # whose equation adds up two halves
            assert memory.table.rows == pytest.approx(team.memory.table.rows, abs=1e-9)
        else:
            assert np.array_equal(memory.table.rows, team.memory.table.rows)
    assert (team.memory.table.rows[:-1].any(axis=1)).sum() > 6
    assert team.memory.counters[EPISODES] > 20


class Reference:
    """One update on a graph, written with numpy and a search of all joint actions."""

    def __init__(self, trainee, edges, state, actions):
        task, memory, rule = trainee.task, trainee.memory, trainee.learner.rule
        self.edges, self.actions, n_actions = edges, actions, task.n_actions
        self.n_agents = task.n_agents
        assert rule.graph.edges.tolist() == [list(edge) for edge in edges]
        shape = (len(edges), -1, n_actions, n_actions)
        tables = memory.table.rows[:-1].reshape(shape)
        projection = task.make_projection(trainee.settings.modules[0].variables)
        here = kernels.project(projection, task.observe(state, 0))
        after, charged = state.copy(), np.zeros(task.n_agents, np.int64)
        events = kernels.apply_joint(task.kernel, after, np.array(actions), charged)
        self.rewards = task.kernel.reward_table[charged].sum(axis=1)
        self.before = self.pick(tables[:, here], actions)
        self.after = np.zeros(len(edges))
        if not kernels.is_over(task.kernel, events):
            there = kernels.project(projection, task.observe(after, 0))
            joints = list(product(range(n_actions), repeat=task.n_agents))
            best = max(joints, key=lambda joint: self.pick(tables[:, there], joint).sum())
            self.after = self.pick(tables[:, there], best)
        self.here, self.shape = here, shape

    def pick(self, values, joint):
        """Returns Q_ij(s, a_i, a_j) for each edge."""
        return np.array([values[e, joint[i], joint[j]] for e, (i, j) in enumerate(self.edges)])

    def compute_coordinated(self):
        delta = self.rewards.sum() + GAMMA * self.after.sum() - self.before.sum()
        return self.before + ALPHA * delta

    def compute_sparse(self):
        degrees = np.bincount(np.ravel(self.edges))
        shares = self.rewards / degrees
        rewards = np.array([shares[i] + shares[j] for i, j in self.edges])
        return self.before + ALPHA * (rewards + GAMMA * self.after - self.before)

    def compute_sparse_by_agent(self):
        ends = np.array([[agent in edge for agent in range(self.n_agents)] for edge in self.edges])
        errors = self.rewards + 0.5 * (GAMMA * self.after - self.before) @ ends
        return self.before + ALPHA * ends @ (errors / ends.sum(axis=0))


@pytest.mark.parametrize("graph", ["chain", "complete"])
@pytest.mark.parametrize(
    ("file", "options", "compute"),
    [
        ("coordinated_q", {}, Reference.compute_coordinated),
        ("sparse_q", {}, Reference.compute_sparse),
        ("sparse_q", {"update": "agent"}, Reference.compute_sparse_by_agent),
    ],
)
def test_an_update_is_its_equation(line_of_three, make_trainee, file, options, compute, graph):
    options = {"graph": graph, **options}
    trainee = make_trainee(file, line_of_three, learning_rate=ALPHA, options=options, hashed=False)
    generator, table = np.random.default_rng(2), trainee.memory.table
    edges = [(0, 1), (1, 2)] if graph == "chain" else [(0, 1), (0, 2), (1, 2)]
    start = line_of_three.reset(np.array([1], np.uint64))
    state, n_over = start, 0
    for _ in range(25):
        table.rows[:-1] = generator.normal(size=table.rows[:-1].shape)
        actions = generator.integers(0, 5, 3)
        reference = Reference(trainee, edges, state, actions)
        others = table.rows.copy()
        is_over = trainee.play(state, actions)
        after = table.rows[:-1].reshape(reference.shape)[:, reference.here]
        assert reference.pick(after, actions) == pytest.approx(compute(reference), abs=1e-12)
        assert (table.rows != others).sum() == len(edges)
        n_over += is_over
        state = start if is_over else trainee.memory.state.copy()
    assert 0 < n_over < 25


def test_the_greedy_joint_action_is_the_best_sum_of_all_modules(line_of_three, make_trainee):
    trainee = make_trainee("coordinated_q", line_of_three, options={"graph": "complete"})
    modules = (*trainee.settings.modules, *trainee.settings.modules)
    trainee = make_trainee(
        "coordinated_q", line_of_three, modules=modules, options={"graph": "complete"}
    )
    memory, learner = trainee.memory, trainee.learner
    memory.table.rows[:-1] = np.random.default_rng(0).normal(size=memory.table.rows[:-1].shape)
    tables = memory.table.rows[:-1].reshape(2, 3, -1, 5, 5)
    projection = line_of_three.make_projection(modules[0].variables)
    state = line_of_three.reset(np.array([1], np.uint64))
    trainee.look(state)
    rules.choose_joint(learner.rule, line_of_three.kernel, learner, memory, False)
    values = tables[:, :, kernels.project(projection, line_of_three.observe(state, 0))].sum(axis=0)
    total = (
        values[0][:, :, None] + values[1][:, None, :] + values[2][None, :, :]
    )  # edges 0-1, 0-2, 1-2
    assert tuple(memory.actions) == np.unravel_index(total.argmax(), total.shape)


def test_an_edge_sees_what_its_first_agent_sees(line_of_three, make_trainee):
    module = Module(name="goal", variables=("p",), signals=("goal",))
    options = {"graph": "0-2 1-2 0-1"}
    trainee = make_trainee("sparse_q", line_of_three, modules=(module,), options=options)
    state = line_of_three.reset(np.array([1], np.uint64))
    trainee.look(state)
    place = [variable.name for variable in line_of_three.variables].index("p")
    cells = [line_of_three.observe(state, agent)[place] for agent in range(3)]
    assert len(set(cells)) == 3
    graph, memory = trainee.learner.rule.graph, trainee.memory
    for edge, first in enumerate((0, 0, 1)):
        key = compute_edge_key(graph, trainee.learner, memory.keys, edge, 0)
        assert key == 49 * edge + cells[first]
