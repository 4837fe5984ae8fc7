"""Hysteretic Q-learning, distributed rewards and distributed values: learners that choose alone."""

import numpy as np
import pytest

from hose_mj.tasks import kernels

ALPHA, GAMMA = 0.5, 0.9
INDEPENDENT = [
    ("hysteretic_q", {"beta_ratio": 1.0}),
    ("distributed_rewards", {"neighbour_weight": 0.0}),
    ("distributed_values", {"neighbour_weight": 0.0}),
]


def learn_alone(task, trainee, experience):
    """Returns the tables of independent Q-learners that had this experience."""
    values = np.zeros_like(trainee.memory.table.rows[:-1]).reshape(
        task.n_agents, -1, task.n_actions
    )
    projection = task.make_projection(trainee.settings.modules[0].variables)
    for state, actions in experience:
        here = [kernels.project(projection, task.observe(state, i)) for i in range(task.n_agents)]
        after, charged = state.copy(), np.zeros(task.n_agents, np.int64)
        events = kernels.apply_joint(task.kernel, after, np.array(actions), charged)
        rewards = np.zeros(len(task.rewards))
        for i in range(task.n_agents):
            kernels.compute_joint_rewards(task.kernel, charged, i, rewards)
            td_target = rewards.sum()
            if not kernels.is_over(task.kernel, events):
                there = kernels.project(projection, task.observe(after, i))
                td_target += GAMMA * values[i, there].max()
            values[i, here[i], actions[i]] += ALPHA * (td_target - values[i, here[i], actions[i]])
    return values


def make_experience(task, n_moves, seed=0):
    """Makes random joint moves, episode after episode."""
    generator, charged = np.random.default_rng(seed), np.zeros(task.n_agents, np.int64)
    start = task.reset(np.array([1], np.uint64))
    state, experience = start.copy(), []
    for _ in range(n_moves):
        actions = generator.integers(0, task.n_actions, task.n_agents)
        experience.append((state.copy(), actions))
        events = kernels.apply_joint(task.kernel, state, actions, charged)
        if kernels.is_over(task.kernel, events):
            state = start.copy()
    return experience


@pytest.mark.parametrize(("file", "options"), INDEPENDENT)
def test_without_their_own_they_are_independent_q_learning(
    line_of_three, make_trainee, file, options
):
    trainee = make_trainee(file, line_of_three, options=options, learning_rate=ALPHA, hashed=False)
    experience = make_experience(line_of_three, 300)
    for state, actions in experience:
        trainee.play(state, actions)
    values = learn_alone(line_of_three, trainee, experience)
    assert trainee.memory.table.rows[:-1].reshape(values.shape) == pytest.approx(values, abs=1e-12)
    assert (values < 0.0).any()


def test_independent_learners_do_the_same_when_they_choose_themselves(corridor, make_trainee):
    rows = []
    for file, options in INDEPENDENT:
        trainee = make_trainee(file, corridor, options=options, epsilon=0.3, seed=1)
        trainee.run(1000)
        rows.append(trainee.memory.table.rows)
    assert rows[0].max() > 50.0
    assert np.array_equal(rows[0], rows[1])
    assert np.array_equal(rows[0], rows[2])


def test_a_hysteretic_learner_that_never_falls_is_d_ql(corridor, make_trainee):
    optimist = make_trainee(
        "hysteretic_q", corridor, options={"beta_ratio": 0.0}, learning_rate=1.0
    )
    distributed = make_trainee("distributed_q", corridor)
    for _ in range(40):
        optimist.run(50)
        distributed.run(50)
        rows = distributed.memory.table.rows
        assert optimist.memory.table.rows == pytest.approx(rows, abs=1e-9)
    assert rows.max() > 50.0


def test_a_hysteretic_value_rises_by_alpha_and_falls_by_beta(make_trainee, corridor):
    trainee = make_trainee(
        "hysteretic_q", corridor, options={"beta_ratio": 0.2}, learning_rate=ALPHA
    )
    start = corridor.reset(np.array([1], np.uint64))
    trainee.look(start)
    key = trainee.memory.keys[0, 0]
    rows = trainee.memory.table.rows
    for old, delta_rate in ((-30.0, ALPHA), (10.0, 0.2 * ALPHA)):
        rows[key] = [old, 0.0, 0.0]
        trainee.play(start, (0, 2))  # into the wall: -10, and 0 expected in the same state
        td_target = -10.0 + GAMMA * max(old, 0.0)
        assert rows[key, 0] == pytest.approx(old + delta_rate * (td_target - old), abs=1e-12)


@pytest.mark.parametrize("file", ["distributed_rewards", "distributed_values"])
def test_neighbours_along_the_hose_weigh_in(line_of_three, make_trainee, file):
    trainee = make_trainee(
        file,
        line_of_three,
        options={"neighbour_weight": 0.4},
        learning_rate=ALPHA,
        hashed=False,
    )
    weights = np.array([[0.6, 0.4, 0.0], [0.2, 0.6, 0.2], [0.0, 0.4, 0.6]])
    assert trainee.learner.rule.weights == pytest.approx(weights, abs=1e-15)
    generator, table = np.random.default_rng(1), trainee.memory.table
    rewards, charged = np.zeros(4), np.zeros(3, np.int64)
    n_over = 0
    for state, actions in make_experience(line_of_three, 40):
        table.rows[:-1] = generator.normal(size=table.rows[:-1].shape)
        values = table.rows[:-1].reshape(3, -1, 5).copy()
        after, each = state.copy(), []
        kernels.apply_joint(line_of_three.kernel, after, actions, charged)
        for i in range(3):
            kernels.compute_joint_rewards(line_of_three.kernel, charged, i, rewards)
            each.append(rewards.sum())
        is_over = trainee.play(state, actions)
        n_over += is_over
        expected = np.zeros(3)
        if not is_over:
            there = trainee.memory.keys[:, 0] % values.shape[1]
            expected = values[np.arange(3), there].max(axis=1)
        if file == "distributed_rewards":
            td_targets = weights @ each + GAMMA * expected
        else:
            td_targets = np.array(each) + GAMMA * weights @ expected
        here = trainee.memory.last_keys[:, 0] % values.shape[1]
        old = values[np.arange(3), here, actions]
        new = table.rows[:-1].reshape(values.shape)[np.arange(3), here, actions]
        assert new == pytest.approx(old + ALPHA * (td_targets - old), abs=1e-12)
    assert 0 < n_over < 40


def test_a_lone_agent_has_no_neighbours(small_tasks, make_trainee):
    task, _ = small_tasks[3]
    trainee = make_trainee("distributed_values", task, options={"neighbour_weight": 0.7})
    assert trainee.learner.rule.weights.tolist() == [[1.0]]
