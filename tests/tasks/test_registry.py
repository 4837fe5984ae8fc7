import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.registry import TASKS, make_task
from hose_mj.tasks.stream import make_stream


@pytest.mark.parametrize(
    ("id", "settings", "thing"),
    [
        ("lines", {}, "task"),
        ("line", {"n_robot": 3}, "option of line"),
        ("line", {"single_agent": True}, "option of line"),
        ("line", {"n_robots": 0}, "n_robots"),
        ("line", {"n_robots": 9}, "n_robots"),
        ("line", {"n_robots": 2.0}, "n_robots"),
        ("line", {"n_robots": True}, "n_robots"),
        ("line", {"hose_length": 3}, "hose_length"),
        ("line", {"goal": (10, 10, 0)}, "goal"),
        ("line", {"goal": (11, 0)}, "goal"),
        ("line", {"goal": (4, 4), "hose_length": 5}, "goal"),
        ("line", {"goal": "nowhere"}, "goal"),
        ("line", {"goal": (0, 0)}, "goal"),
        ("line", {"start": ((0, 0),)}, "start"),
        ("line", {"start": "anywhere"}, "start"),
        ("line", {"n_robots": 2, "start": ((5, 0), (0.5, 0))}, "start"),
        ("line", {"n_robots": 2, "start": ((9, 0), (0, 0))}, "start"),
        ("line", {"n_robots": 2, "start": ((3, 0), (3, 0))}, "start"),
        ("line", {"n_robots": 2, "start": ((1, 0), (2, 0))}, "start"),
        ("line", {"n_robots": 1, "start": ((3, 0),), "goal": (3, 0)}, "goal"),
        ("line", {"collision": "state"}, "collision"),
        ("line", {"move_rule": None}, "move_rule"),
        ("line", {"goal_reward": float("nan")}, "goal_reward"),
        ("line", {"violation_reward": "-1"}, "violation_reward"),
        ("line", {"step_limit": 0}, "step_limit"),
        ("line", {"violations_end": 1}, "violations_end"),
        ("line-non-cooperative", {"n_robots": 2, "goal": (3, 0)}, "goal"),
        ("line-non-cooperative", {"n_robots": 2, "goal": ((9, 0), (0, 0))}, "goal"),
        ("taxi", {"starts": ()}, "starts"),
        ("taxi", {"starts": ((0, 5),)}, "starts"),
        ("taxi", {"starts": ((1, 1), (1, 1))}, "starts"),
        ("taxi", {"passengers": (("R", "X"),)}, "passengers"),
        ("taxi", {"passengers": (("R", "R"),)}, "passengers"),
        ("taxi", {"passengers": ((["R"], "G"),)}, "passengers"),
        ("corridor", {"n_cells": 2}, "n_cells"),
        ("corridor", {"starts": (0, 1)}, "starts"),
        ("corridor", {"winner": "third"}, "winner"),
        ("corridor", {"goal_ends": "never"}, "goal_ends"),
        ("maze", {"goal": (4, 0)}, "goal"),
        ("maze", {"start": (0, 1)}, "start"),
        ("maze", {"actions": "down"}, "actions"),
    ],
)
def test_a_mistake_is_one_clear_error(id, settings, thing):
    with pytest.raises(InputError) as caught:
        make_task(id, **settings)
    assert caught.value.thing == thing


@pytest.mark.parametrize("id", TASKS)
def test_a_task_and_its_record_agree(id):
    task = make_task(id)
    record = task.kernel
    assert task.id == id
    assert (record.n_agents, record.n_actions) == (task.n_agents, task.n_actions)
    assert (task.schedule == "single") == (task.n_agents == 1)
    assert record.reward_table.shape == (2 ** len(task.events), len(task.rewards))
    for events in (record.terminal, record.violations, record.success, record.shared):
        assert 0 <= events < 2 ** len(task.events)
    assert record.success & record.violations == 0
    assert record.success & record.terminal == record.success
    assert kernels.mask(record, task.make_state(), 0) == 2**task.n_actions - 1
    assert task.state_size == max(part.stop for part in task.layout.values())
    names = [variable.name for variable in task.variables]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("id", TASKS)
def test_the_same_seed_gives_the_same_walk_compiled_or_not(id):
    task = make_task(id)
    walks = []
    for run in (kernels.run_random, kernels.run_random.py_func):
        stream = make_stream(np.random.default_rng(4))
        state = task.reset(stream)
        values = np.zeros(len(task.variables), np.int64)
        counts = np.zeros(4, np.int64)
        run(task.kernel, state, stream, 500, values, counts)
        walks.append((*state, *values, *counts, *stream))
    assert walks[0] == walks[1]


def test_the_episode_is_cut_off_at_the_step_limit():
    task = make_task("line", n_robots=2, step_limit=3)
    state = task.reset(make_stream(np.random.default_rng(1)))
    stay = np.array([4, 4])
    cut_off = []
    for _ in range(2):
        kernels.apply_joint(task.kernel, state, stay, np.zeros(2, np.int64))
        cut_off.append(kernels.is_cut_off(task.kernel, state))
    assert cut_off == [False, True]


class Countdown:
    """A task in plain Python: an agent counts down to 0."""

    n_agents, n_actions, step_limit = 1, 2, 10
    terminal = success = 1
    violations = shared = 0
    reward_table = np.array([[0.0], [1.0]])

    def reset(self, state, stream):
        kernels.begin(state)
        state[kernels.HEADER] = 3

    def apply(self, state, agent, action):
        state[kernels.HEADER] -= action
        kernels.end_turn(self, state, agent)
        return int(state[kernels.HEADER] == 0)

    def observe(self, state, agent, values):
        values[0] = state[kernels.HEADER]


def test_the_same_loop_runs_a_task_in_plain_python():
    kernels.reset.register(Countdown, Countdown.reset)
    kernels.apply.register(Countdown, Countdown.apply)
    kernels.observe.register(Countdown, Countdown.observe)
    state, values = np.zeros(3, np.int64), np.zeros(1, np.int64)
    counts, stream = np.zeros(4, np.int64), np.array([5], np.uint64)
    task = Countdown()
    kernels.reset(task, state, stream)
    kernels.run_random.py_func(task, state, stream, 200, values, counts)
    assert counts[0] == pytest.approx(200 / 6, rel=0.3)  # three steps down at 1/2 each
    assert 0 < counts[1] <= counts[0]
