"""What the tests of learners share: small tasks, trainings on them, and what their tables say."""

import importlib
from dataclasses import dataclass

import numpy as np
import pytest
from hose_learning import loop, tables
from hose_learning.evaluation import make_probe
from hose_learning.learners import catalog
from hose_learning.settings import Exploration
from hose_learning.study.run_folder import flatten
from hose_learning.study.training import Training
from hose_learning.tables import find

from hose_mj.tasks import kernels
from hose_mj.tasks.exact import OVER
from hose_mj.tasks.kernels import HEADER
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.task import Task, make_reward_table
from hose_mj.tasks.variables import Variable


class Chain:
    """Agents that move one token on a line of cells: a record in plain Python, nothing compiled."""

    def __init__(self, n_agents, moves, n_cells, start, cliff):
        self.n_agents, self.n_actions, self.step_limit = n_agents, len(moves), 1000
        self.terminal, self.violations, self.success, self.shared = 3, 2, 1, 3
        self.reward_table = make_reward_table(("goal", "fall"), {"goal": {"goal": 100.0}})
        self.moves, self.n_cells, self.start, self.cliff = moves, n_cells, start, cliff


@kernels.reset.register(Chain)
def reset_chain(record, state, stream):
    kernels.begin(state)
    state[HEADER] = record.start


@kernels.apply.register(Chain)
def apply_chain(record, state, agent, action):
    cell = state[HEADER] + record.moves[action]
    kernels.end_turn(record, state, agent)
    state[HEADER] = min(max(cell, 0), record.n_cells - 1)
    return int(cell >= record.n_cells - 1) | 2 * int(record.cliff and cell <= 0)


@kernels.observe.register(Chain)
def observe_chain(record, state, agent, values):
    values[0] = state[HEADER]


@pytest.fixture
def make_chain():
    """Makes a chain whose last cell is the goal, and whose first one may be a cliff."""

    def make(n_agents=2, moves=(-1, 1), n_cells=6, start=0, cliff=False):
        return Task(
            id="chain",
            agents=tuple(f"agent_{i}" for i in range(n_agents)),
            action_names=tuple(f"step{move:+d}" for move in moves),
            variables=(Variable("cell", n_cells, "where the token is"),),
            rewards=("goal",),
            events=("goal", "fall"),
            schedule="turns",
            settings=None,
            kernel=Chain(n_agents, moves, n_cells, start, cliff),
            layout={"token": slice(HEADER, HEADER + 1)},
            state_size=HEADER + 1,
        )

    return make


@pytest.fixture
def make_line():
    """Makes a tiny line task: two robots on 5 x 5 cells with a goal that stays."""

    def make(id="line", **settings):
        small = {"n_robots": 2, "half_width": 2, "hose_length": 4, "goal": (1, 1)}
        return make_task(id, **{**small, **settings})

    return make


@pytest.fixture
def make_training():
    """Makes a training, by default uncompiled and all by chance."""

    def make(task, id, seed=0, compiled=False, epsilon=1.0, values=None, vetoes=None, **settings):
        settings.setdefault("exploration", Exploration(epsilon=epsilon))
        made = catalog.make_settings(id, task, values, vetoes, **settings)
        return Training(task, id, made, np.random.default_rng(seed), compiled)

    return make


@pytest.fixture
def shrink_tables(monkeypatch):
    """Lets hashed tables begin small; rules that ask for their size are to know the real one."""
    importlib.import_module("hose_learning.learners.traces")
    return lambda capacity: monkeypatch.setattr(tables, "FIRST_CAPACITY", capacity)


@pytest.fixture
def check_same():
    """Checks that two trainings are equal, bit for bit."""

    def check(one, other):
        arrays, others = flatten(one.memory), flatten(other.memory)
        assert list(arrays) == list(others)
        for name, array in arrays.items():
            assert array.tobytes() == others[name].tobytes(), name

    return check


@pytest.fixture
def read_values():
    """Reads what each state's mover thinks of its actions (n_states, n_actions)."""

    def read(training, model, module=0):
        probe = make_probe(training.memory)
        rows = []
        for state, turn in zip(model.states, model.turns, strict=True):
            probe.state[:] = state
            loop.see(training.task.kernel, training.learner, probe, turn)
            rows.append(probe.table.rows[find(probe.table, probe.keys[turn, module])])
        return np.array(rows)

    return read


@dataclass
class Cycle:
    """One agent's decision problem when its teammates' behaviour is given.

    Attributes:
        model: the task written out.
        agent: whose problem it is.
        discounts: of rewards 0 .. N - 1 moves after its own, and of the state N moves after it.
        policies: probabilities of the movers' actions (n_states, n_actions).
        rewards: of each move (n_states, n_actions).
    """

    model: object
    agent: int
    discounts: np.ndarray
    policies: np.ndarray
    rewards: np.ndarray

    def expect(self, state, action, age, values):
        """What follows a move made `age` moves after the agent's own."""
        reward = self.discounts[age] * self.rewards[state, action]
        successor = self.model.successors[state, action]
        if successor == OVER:
            return reward
        if self.model.turns[successor] == self.agent:
            return reward + self.discounts[-1] * values[successor]
        chances = self.policies[successor]
        follow = [self.expect(successor, a, age + 1, values) for a in range(len(chances))]
        return reward + chances @ follow

    def solve(self, choose=lambda q_values: q_values.max(axis=1), tolerance=1e-10):
        """Returns the values of its actions; `choose` says what a state is worth to it."""
        mine = np.flatnonzero(self.model.turns == self.agent)
        q_values = np.zeros(self.rewards.shape)
        change = np.inf
        while change > tolerance:
            worth, new = choose(q_values), q_values.copy()
            for state in mine:
                for action in range(q_values.shape[1]):
                    new[state, action] = self.expect(state, action, 0, worth)
            change = np.abs(new - q_values).max()
            q_values = new
        return mine, q_values[mine]


@pytest.fixture
def solve_cycle():
    def solve(model, agent, discounts, policies, rewards=None, **options):
        rewards = model.rewards[:, :, agent] if rewards is None else rewards
        return Cycle(model, agent, np.asarray(discounts), policies, rewards).solve(**options)

    return solve
