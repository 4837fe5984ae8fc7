from itertools import product

import numpy as np
import pytest
from hose_learning import rules
from hose_learning.learners.team_q import draw_best, make, number_joint, write_joint
from hose_learning.modules import Module
from hose_learning.settings import Exploration, LearnerSettings
from hose_learning.tables import DENSE_WIDTH, LARGEST_DENSE, make_table

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import solve
from hose_mj.tasks.registry import make_task

GAMMA = 0.9


def compute_team_rewards(task, model):
    """Returns what each joint move is worth, every mover's events counted once."""
    rewards = np.zeros(model.events.shape)
    charged = np.zeros(task.n_agents, np.int64)
    actions = list(product(range(task.n_actions), repeat=task.n_agents))
    for place, (state, joint) in enumerate(product(model.states, actions)):
        kernels.apply_joint(task.kernel, state.copy(), np.array(joint), charged)
        rewards.flat[place] = task.kernel.reward_table[charged].sum()
    return rewards


@pytest.mark.parametrize("number", range(5))
def test_values_are_those_of_the_joint_game(small_tasks, make_trainee, number):
    task, model = small_tasks[number]
    trainee = make_trainee("team_q", task, learning_rate=1.0)
    trainee.sweep(model)
    exact = solve(model, compute_team_rewards(task, model), GAMMA)
    assert trainee.read(model) == pytest.approx(exact, abs=1e-9)


def test_joint_actions_are_numbered_as_product_lists_them():
    actions = np.zeros(3, np.int64)
    for joint, each in enumerate(product(range(4), repeat=3)):
        assert number_joint(np.array(each), 4) == joint
        write_joint(joint, 4, actions)
        assert tuple(actions) == each


def test_the_best_are_drawn_alike():
    scores = np.array([1.0, -np.inf, 3.0, 3.0, 2.0, 3.0])
    stream = np.array([7], np.uint64)
    counts = np.bincount([draw_best(scores, stream) for _ in range(3000)], minlength=6)
    assert counts[[0, 1, 4]].sum() == 0
    assert counts[[2, 3, 5]] == pytest.approx(1000, abs=5 * 1000**0.5)
    assert draw_best(np.full(3, -np.inf), stream) == -1


@pytest.mark.parametrize("explores", [True, False])
def test_joint_actions_below_a_threshold_are_vetoed(corridor, make_trainee, explores):
    module = Module(name="all", variables=("p_0", "p_1"), signals=("goal",), threshold=-1.0)
    trainee = make_trainee("team_q", corridor, modules=(module,))
    start = corridor.reset(np.array([1], np.uint64))
    trainee.look(start)
    row = trainee.memory.table.rows[trainee.memory.keys[0, 0]]
    row[:] = [-1.0, -2.0, 0.5, -1.5, -1.0, -9.0, 0.5, -1.1, 0.2]
    chosen = set()
    for _ in range(100):
        trainee.look(start)
        rule, kernel = trainee.learner.rule, corridor.kernel
        rules.choose_joint(rule, kernel, trainee.learner, trainee.memory, explores)
        chosen.add(number_joint(trainee.memory.actions, 3))
    assert chosen == ({0, 2, 4, 6, 8} if explores else {2, 6})
    row[:] = -5.0
    rules.choose_joint(rule, kernel, trainee.learner, trainee.memory, explores)
    assert trainee.memory.actions.tolist() == [2, 2]


def test_the_team_needs_one_view_and_few_joint_actions(make_trainee):
    task = make_task("line", n_robots=2)
    module = Module(name="goal", variables=("d_g", "r_n_1"), signals=("goal",))
    with pytest.raises(InputError, match=r"module 'goal' is \['d_g'\]"):
        make_trainee("team_q", task, modules=(module,))
    seen = Module(name="goal", variables=("r_n_1",), signals=("goal",))
    with pytest.raises(InputError, match="number of joint actions is 3125"):
        make_trainee("team_q", make_task("line", n_robots=5), modules=(seen,))


def test_a_team_does_not_choose_by_soft_max(corridor):
    module = Module(name="goal", variables=("p_0",), signals=("goal",))
    settings = LearnerSettings(modules=(module,), exploration=Exploration(policy="soft-max"))
    with pytest.raises(InputError, match="policy is 'soft-max'"):
        make(corridor, settings, np.random.default_rng(0))


def test_a_table_of_long_rows_is_hashed_sooner():
    most = LARGEST_DENSE * DENSE_WIDTH
    for width in (5, DENSE_WIDTH, 625):
        dense = min(LARGEST_DENSE, most // width)
        assert len(make_table(dense, width, np.float64).keys) == 0
        assert len(make_table(dense + 1, width, np.float64).keys) > 0
