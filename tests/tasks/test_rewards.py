import numpy as np
import pytest

from hose_mj.tasks import kernels
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.task import make_reward_table

UP, DOWN, LEFT, RIGHT, NONE = range(5)


@pytest.fixture
def stream():
    return np.array([1], np.uint64)


def get_rewards(task, events, mover, agent):
    rewards = np.full(len(task.rewards), np.nan)
    kernels.compute_rewards(task.kernel, events, mover, agent, rewards)
    return {name: x for name, x in zip(task.rewards, rewards, strict=True) if x}


def test_a_set_of_events_is_worth_the_sum_of_its_events():
    table = make_reward_table(("a", "b", "c"), {"one": {"a": 1.0, "c": 5.0}, "two": {"b": -2.0}})
    assert table.tolist() == [
        [0, 0], [1, 0], [0, -2], [1, -2], [5, 0], [6, 0], [5, -2], [6, -2],
    ]  # fmt: skip


def test_the_goal_is_shared_and_violations_are_the_movers(stream):
    start = ((3, 0), (1, 0))
    task = make_task("line", n_robots=2, half_width=3, start=start, goal=(3, 1))
    events = kernels.apply(task.kernel, task.reset(stream), 0, UP)
    assert get_rewards(task, events, 0, 0) == {"goal": 100}
    assert get_rewards(task, events, 0, 1) == {"goal": 100}
    events = kernels.apply(task.kernel, task.reset(stream), 0, RIGHT)
    assert get_rewards(task, events, 0, 0) == {"out": -50}
    assert get_rewards(task, events, 0, 1) == {}


def test_a_robots_own_goal_is_its_own_and_ends_nothing(stream):
    start, goal = ((3, 0), (1, 0)), ((3, 1), (2, 0))
    task = make_task("line-non-cooperative", n_robots=2, start=start, goal=goal)
    state = task.reset(stream)
    events = kernels.apply(task.kernel, state, 0, UP)
    assert task.name_events(events) == ("goal",)
    assert get_rewards(task, events, 0, 0) == {"goal": 100}
    assert get_rewards(task, events, 0, 1) == {}
    assert not kernels.is_over(task.kernel, events)
    assert task.name_events(kernels.apply(task.kernel, state, 1, NONE)) == ()
    assert task.name_events(kernels.apply(task.kernel, state, 0, NONE)) == ("goal",)
    events = kernels.apply(task.kernel, state, 1, RIGHT)
    assert task.name_events(events) == ("goal", "all_goals")
    assert kernels.is_over(task.kernel, events)


def test_a_joint_move_adds_up_what_all_movers_caused(stream):
    # Both ends of a segment that the tip stretches are charged; the tip is also out.
    start = ((3, 0), (1, 0))
    options = {"hose_length": 4, "half_width": 3, "start": start, "goal": "none"}
    task = make_task("line", n_robots=2, **options)
    caused_events, rewards = np.zeros(2, np.int64), np.zeros(len(task.rewards))
    kernels.apply_joint(task.kernel, task.reset(stream), np.array([RIGHT, NONE]), caused_events)
    for agent, expected in enumerate(({"stretch": -50, "out": -50}, {"stretch": -50})):
        kernels.compute_joint_rewards(task.kernel, caused_events, agent, rewards)
        assert {n: x for n, x in zip(task.rewards, rewards, strict=True) if x} == expected


def test_a_single_agent_of_two_taxis_pays_for_each(stream):
    task = make_task("taxi-single-agent", starts=((0, 0), (0, 1)), misplaced_reward=-1.0)
    up_up = task.action_names.index("up_0+up_1")
    events = kernels.apply(task.kernel, task.reset(stream), 0, up_up)
    assert get_rewards(task, events, 0, 0) == {"collision": -20}
    drop_right = task.action_names.index("drop_0+right_1")
    events = kernels.apply(task.kernel, task.reset(stream), 0, drop_right)
    assert get_rewards(task, events, 0, 0) == {"collision": -10, "misplaced": -1}


def test_picking_and_dropping_out_of_place_costs_nothing_and_is_no_violation(stream):
    task = make_task("taxi")
    for action in ("pick", "drop"):
        state = task.reset(stream)
        events = kernels.apply(task.kernel, state, 0, task.action_names.index(action))
        assert task.name_events(events) == ("misplaced",)
        assert get_rewards(task, events, 0, 0) == {}
        assert events & task.kernel.violations == 0


def test_safe_actions_are_those_that_break_nothing(stream):
    start = ((3, 1), (3, 0), (1, 0))
    task = make_task("line", n_robots=3, half_width=3, start=start, goal="none")
    state = task.reset(stream)
    safe = kernels.compute_safe_mask(task.kernel, state, 0, task.make_state())
    # right leaves the grid, down meets robot 1
    assert [name for k, name in enumerate(task.action_names) if safe >> k & 1] == [
        "up", "left", "none",
    ]  # fmt: skip
    assert (state == task.reset(stream)).all()
