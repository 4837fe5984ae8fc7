from itertools import product

import numpy as np
import pytest
from hose_learning import rules
from hose_learning.modules import Module

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import solve
from hose_mj.tasks.registry import make_task

GAMMA = 0.9
RIGHT, LEFT, NONE = 1, 0, 2


def project(q_values, task, agent):
    """Returns max over the others' actions of Q*(s, joint), but no less than 0, where D-QL starts.

    A value below 0 of the state cannot occur: doing nothing is worth 0 in all of these tasks.
    """
    shape = (len(q_values), *[task.n_actions] * task.n_agents)
    others = tuple(1 + other for other in range(task.n_agents) if other != agent)
    return np.maximum(q_values.reshape(shape).max(axis=others), 0.0)


@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize("keeps_policy", ["no", "yes"])
def test_values_are_the_projection_of_the_joint_optimum(
    small_tasks, make_trainee, number, keeps_policy
):
    task, model = small_tasks[number]
    trainee = make_trainee("distributed_q", task, options={"keeps_policy": keeps_policy})
    trainee.sweep(model)
    for agent in range(task.n_agents):
        # Rewards of one's own apart, the agents play the same game.
        exact = project(solve(model, model.rewards[:, :, agent], GAMMA), task, agent)
        values = trainee.read(model, agent)[:, : task.n_actions]
        assert values == pytest.approx(exact, abs=1e-9)
        assert exact.max() > 50.0


def test_experience_leads_there_too(corridor, small_tasks, make_trainee):
    task, model = small_tasks[2]
    trainee = make_trainee("distributed_q", task)
    trainee.run(12_000)
    exact = project(solve(model, model.rewards[:, :, 0], GAMMA), task, 0)
    assert trainee.read(model) == pytest.approx(exact, abs=1e-9)


def test_each_module_learns_its_own_rewards(small_tasks, make_trainee):
    task, model = small_tasks[2]
    state = ("p_0", "p_1")
    goal = Module(name="goal", variables=state, signals=("goal",))
    collision = Module(name="collision", variables=state, signals=("collision",))
    trainee = make_trainee("distributed_q", task, modules=(collision, goal))
    trainee.sweep(model)
    of_goal = np.zeros(model.events.shape)
    charged = np.zeros(2, np.int64)
    for place, (state, joint) in enumerate(product(model.states, product(range(3), repeat=2))):
        kernels.apply_joint(task.kernel, state.copy(), np.array(joint), charged)
        of_goal.flat[place] = 100.0 * ((charged >> task.events.index("goal")) & 1).sum()
    for agent in range(2):
        exact = project(solve(model, of_goal, GAMMA), task, agent)
        assert trainee.read(model, agent, 1) == pytest.approx(exact, abs=1e-9)
        assert not trainee.read(model, agent, 0).any()


def test_the_kept_policy_agrees_where_joint_actions_tie(make_trainee):
    # Example 1: {right, none} and {none, left} are worth 100, {none, none} nothing.
    task = make_task("corridor")
    start = task.reset(np.array([1], np.uint64))
    chosen = {}
    for keeps_policy in ("no", "yes"):
        trainee = make_trainee(
            "distributed_q", task, options={"keeps_policy": keeps_policy}, seed=4
        )
        for joint in [(NONE, NONE), (NONE, LEFT), (RIGHT, NONE)] * 2:
            trainee.play(start, joint)
        chosen[keeps_policy] = set()
        for _ in range(40):
            trainee.look(start)
            rule, kernel = trainee.learner.rule, task.kernel
            rules.choose_joint(rule, kernel, trainee.learner, trainee.memory, False)
            chosen[keeps_policy].add(tuple(trainee.memory.actions.tolist()))
    assert (NONE, NONE) in chosen["no"]
    # Agent 0 found 100 with `none` first, and `right` is no better.
    assert chosen["yes"] == {(NONE, LEFT)}


def test_one_policy_cannot_be_kept_by_several_modules(corridor, make_trainee):
    module = Module(name="goal", variables=("p_0",), signals=("goal",))
    with pytest.raises(InputError, match="keeps_policy"):
        make_trainee(
            "distributed_q", corridor, modules=(module, module), options={"keeps_policy": "yes"}
        )
