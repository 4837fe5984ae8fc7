"""Logs of random moves: every row is a move of the task, and a file gives the log back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hose_learning.experience import (
    Experience,
    make_rows,
    record_experience,
    write_experience,
)
from hose_learning.loop import Rows, fill_rows
from hose_learning.policies import draw_allowed

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import HEADER, begin, end_turn
from hose_mj.tasks.registry import TASKS, make_task
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task
from hose_mj.tasks.variables import Variable


def make_generator(seed=5):
    return np.random.default_rng(seed)


def check_equal(one, other):
    for field in dataclasses.fields(Experience):
        a, b = getattr(one, field.name), getattr(other, field.name)
        assert type(a) is type(b)
        assert np.array_equal(a, b), field.name


@pytest.mark.parametrize("id", TASKS)
def test_replayed_from_the_same_stream_every_row_is_a_move_of_the_task(id):
    task = make_task(id)
    log = record_experience(task, 300, make_generator())
    stream = make_stream(make_generator())
    state = task.reset(stream)
    rewards = np.zeros(len(task.rewards))
    for k in range(len(log)):
        agent = int(state[kernels.TURN])
        assert log.agents[k] == agent
        assert np.array_equal(log.values[k], task.observe(state, agent))
        available = kernels.mask(task.kernel, state, agent)
        assert draw_allowed(available, stream) == log.actions[k]
        events = kernels.apply(task.kernel, state, agent, int(log.actions[k]))
        assert log.events[k] == events
        assert log.undesired[k] == bool(events & task.kernel.violations)
        kernels.compute_rewards(task.kernel, events, agent, agent, rewards)
        assert np.array_equal(log.rewards[k], rewards)
        assert np.array_equal(log.next_values[k], task.observe(state, agent))
        if kernels.is_over(task.kernel, events) or kernels.is_cut_off(task.kernel, state):
            task_state = task.reset(stream)
            state[:] = task_state


@pytest.mark.parametrize("id", ["line", "taxi", "maze"])
def test_the_uncompiled_loop_writes_the_same(id):
    task = make_task(id)
    pairs = []
    for fill in (fill_rows, fill_rows.py_func):
        rows = make_rows(task, 200)
        stream = make_stream(make_generator())
        state = task.reset(stream)
        fill(task.kernel, state, stream, rows)
        pairs.append((rows, state, stream))
    for compiled, plain in zip(*pairs, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(compiled, plain, strict=True))


class Coin:
    """Two agents; only the actions 1 and 3 of 5 are available, and 3 breaks a constraint."""

    n_agents, n_actions, step_limit = 2, 5, 7
    terminal = success = shared = 0
    violations = 1
    reward_table = np.array([[0.0], [-2.0]])


@kernels.reset.register
def reset_coin(record: Coin, state, stream):
    begin(state)
    state[HEADER] = 0


@kernels.apply.register
def apply_coin(record: Coin, state, agent, action):
    state[HEADER] += action
    end_turn(record, state, agent)
    return int(action == 3)


@kernels.observe.register
def observe_coin(record: Coin, state, agent, values):
    values[0] = state[HEADER]


@kernels.mask.register
def mask_coin(record: Coin, state, agent):
    return 0b01010


def make_coin():
    return Task(
        id="coin",
        agents=("a", "b"),
        action_names=tuple("01234"),
        variables=(Variable("sum", 36, "sum of all actions"),),
        rewards=("violation",),
        events=("three",),
        schedule="turns",
        settings=None,
        kernel=Coin(),
        layout={},
        state_size=HEADER + 1,
    )


def test_a_task_in_plain_python_is_logged_too_with_its_mask_and_its_step_limit():
    log = record_experience(make_coin(), 7 * 40, make_generator())
    assert set(log.actions) == {1, 3}
    assert np.array_equal(log.undesired, log.actions == 3)
    assert np.array_equal(log.rewards[:, 0], np.where(log.undesired, -2.0, 0.0))
    assert np.array_equal(log.next_values[:, 0], log.values[:, 0] + log.actions)
    values = log.values[:, 0].reshape(40, 7)
    assert (values[:, 0] == 0).all()  # each episode of 7 moves starts anew
    assert (np.diff(values, axis=1) > 0).all()
    assert log.agents.reshape(40, 7).tolist() == [[0, 1, 0, 1, 0, 1, 0]] * 40


def test_selecting_an_agent_keeps_its_rows_in_order():
    log = record_experience(make_task("taxi"), 101, make_generator())
    own = [log.select(agent) for agent in range(2)]
    assert [len(part) for part in own] == [51, 50]
    for agent, part in enumerate(own):
        assert (part.agents == agent).all()
        for name in Rows._fields:
            assert np.array_equal(getattr(part, name), getattr(log, name)[agent::2])


def test_the_same_seed_gives_the_same_log_and_another_one_another():
    task = make_task("line")
    one, same, other = (record_experience(task, 500, make_generator(seed)) for seed in (1, 1, 2))
    check_equal(one, same)
    assert not np.array_equal(one.actions, other.actions)


def test_a_file_gives_the_log_back(tmp_path):
    log = record_experience(make_task("taxi"), 50, make_generator())
    write_experience(tmp_path / "log.npz", log)
    with np.load(tmp_path / "log.npz", allow_pickle=False) as archive:
        assert set(archive.files) == {field.name for field in dataclasses.fields(Experience)}
        for name in archive.files:
            assert np.array_equal(archive[name], getattr(log, name))


def test_a_log_has_a_move():
    with pytest.raises(InputError, match="n_moves is 0"):
        record_experience(make_task("taxi"), 0, make_generator())
