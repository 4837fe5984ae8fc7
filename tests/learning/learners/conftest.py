import importlib
from itertools import product

import numpy as np
import pytest
from hose_learning import rules
from hose_learning.loop import accumulate_joint, keep_keys, run_joint, see
from hose_learning.modules import Module
from hose_learning.records import make_log
from hose_learning.settings import Exploration, LearnerSettings

from hose_mj.tasks import kernels
from hose_mj.tasks.exact import enumerate_joint
from hose_mj.tasks.registry import make_task

STATES = {
    "corridor": ("p_0", "p_1"),
    "taxi": ("taxi_0", "passenger_0"),
    "line": ("r_n_1", "r_n_2"),
    "line-3": ("r_n_1", "r_n_2", "r_n_3"),
}
"""Variables that tell everything about the tasks of these tests."""


class Trainee:
    """A learner of joint moves on a small task, with all that tests ask of it."""

    def __init__(self, file, task, modules=None, seed=0, epsilon=1.0, **settings):
        state = STATES["line-3" if task.n_agents == 3 else task.id]
        everything = Module(name="everything", variables=state, signals=task.rewards)
        make = importlib.import_module(f"hose_learning.learners.{file}").make
        self.task = task
        self.settings = LearnerSettings(
            modules=modules or (everything,),
            exploration=Exploration(epsilon=epsilon),
            **settings,
        )
        self.learner, self.memory = make(task, self.settings, np.random.default_rng(seed))
        self.log = make_log(10**5)

    def run(self, n_moves, run=run_joint.py_func):
        return run(self.task.kernel, self.learner, self.memory, self.log, n_moves, 10**9)

    def look(self, state):
        """Shows the agents a state; what they see is in `memory.keys`."""
        self.memory.state[:] = state
        for agent in range(self.task.n_agents):
            self.memory.allowed[agent] = see(self.task.kernel, self.learner, self.memory, agent)

    def play(self, state, actions):
        """Lets the agents make a given joint move and learn from it; whether it was the last."""
        memory, kernel = self.memory, self.task.kernel
        self.look(state)
        memory.actions[:] = actions
        for agent in range(self.task.n_agents):
            keep_keys(self.learner, memory, agent)
        events = kernels.apply_joint(kernel, memory.state, memory.actions, memory.caused_events)
        accumulate_joint(self.learner, memory)
        is_over = bool(kernels.is_over(kernel, events))
        if not is_over:
            self.look(memory.state.copy())
        rules.learn_joint(self.learner.rule, self.learner, memory, is_over)
        return is_over

    def sweep(self, model):
        """Plays every joint action in every state until nothing changes any more."""
        actions = list(product(range(self.task.n_actions), repeat=self.task.n_agents))
        before = None
        while before is None or (before != self.memory.table.rows).any():
            before = self.memory.table.rows.copy()
            for state in model.states:
                for joint in actions:
                    self.play(state, joint)

    def read(self, model, agent=0, module=0):
        """Returns the values of all states of a model, as the agent's module sees them."""
        rows = []
        for state in model.states:
            self.look(state)
            rows.append(self.memory.table.rows[self.memory.keys[agent, module]].copy())
        return np.array(rows)


@pytest.fixture(scope="session")
def make_trainee():
    return Trainee


@pytest.fixture(scope="session")
def small_tasks():
    """Tasks whose every state and joint action can be played, with their models."""
    line = {"half_width": 2, "hose_length": 4, "n_robots": 2, "goal": (1, 1)}
    tasks = [
        make_task("corridor"),
        make_task("corridor", winner="neither"),
        make_task("corridor", n_cells=5, goal=1, starts=(2, 4), goal_ends="move"),
        make_task("taxi", starts=((1, 1),), passengers=(("R", "Y"),)),
        make_task("line", start=((0, 2), (0, 1)), **line),
    ]
    start = np.array([1], np.uint64)
    return [(task, enumerate_joint(task, [task.reset(start)])) for task in tasks]


@pytest.fixture
def corridor():
    return make_task("corridor", n_cells=7, goal=3, starts=(0, 6), step_limit=41)


@pytest.fixture
def line_of_three():
    cells = ((1, 2), (1, 1), (1, 0))
    return make_task(
        "line", n_robots=3, half_width=3, hose_length=6, start=cells, goal=(-1, 1), step_limit=60
    )
