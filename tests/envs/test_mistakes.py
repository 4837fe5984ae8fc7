"""A user's mistake is one `InputError` that names the thing, the value and what is valid."""

from __future__ import annotations

import gymnasium
import numpy as np
import pettingzoo
import pytest

import hose_mj.envs  # noqa: F401  (registers the ids)
from hose_mj.envs.dm import DmEnv
from hose_mj.envs.gym import TaskEnv
from hose_mj.envs.parallel import JointEnv
from hose_mj.envs.turns import TurnsEnv
from hose_mj.envs.vector import VectorTaskEnv
from hose_mj.errors import InputError
from hose_mj.tasks.registry import make_task

MAKERS = {
    "gymnasium": lambda **options: gymnasium.make("hose_mj/Line-v0", **options),
    "make_vec": lambda **options: gymnasium.make_vec("hose_mj/Line-v0", 3, **options),
    "turns": lambda **options: pettingzoo.make("aec", "hose_mj/Line-v0", **options),
    "parallel": lambda **options: pettingzoo.make("parallel", "hose_mj/Line-v0", **options),
    "dm": lambda **options: DmEnv("line", **options),
}


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize(
    ("options", "thing"),
    [
        ({"n_robots": 0}, "n_robots"),
        ({"n_robots": 9}, "n_robots"),
        ({"n_robots": 2, "goal": (10, 10), "hose_length": 12}, "goal"),
        ({"n_robots": 4, "hose_length": 3}, "hose_length"),
        ({"n_robos": 4}, "option of line"),
        ({"observe": ("r_q",)}, "observe"),
        ({"observe": ()}, "observe"),
        ({"observe": "r_n"}, "observe"),
        ({"observe": ("r_n", "r_n")}, "observe"),
        ({"form": "tensor"}, "form"),
        ({"form": "index", "n_robots": 8}, "observe"),
        ({"rewards": ("gold",)}, "rewards"),
        ({"rewards": ("goal", "goal")}, "rewards"),
        ({"rewards": "goal"}, "rewards"),
    ],
)
def test_wrong_options(maker, options, thing):
    with pytest.raises(InputError) as caught:
        MAKERS[maker](**options)
    assert caught.value.thing == thing


@pytest.mark.parametrize("make", [TaskEnv, JointEnv, DmEnv, TurnsEnv])
def test_an_unknown_task_and_render_mode(make):
    with pytest.raises(InputError, match=r"task is 'lime'; valid: one of .*line"):
        make("lime")
    with pytest.raises(
        InputError, match=r"render_mode is 'oil'; valid: None or one of .*rgb_array"
    ):
        make("line", render_mode="oil")


@pytest.mark.parametrize("make", [TaskEnv, JointEnv, lambda task, **o: VectorTaskEnv(task, 2, **o)])
def test_an_unknown_way_to_move(make):
    with pytest.raises(InputError, match="moves is 'both'; valid: one of joint, turns"):
        make("line", moves="both")


@pytest.mark.parametrize("action", [-1, 5, 1.0, "up", None, True, np.array([1]), np.float64(1)])
def test_an_action_out_of_range(action):
    turns = TurnsEnv("line", n_robots=2)
    turns.reset(seed=0)
    before = turns.state()
    with pytest.raises(InputError, match=r"action of robot_0 .*from 0 to 4 \(up, down,"):
        turns.step(action)
    assert np.array_equal(turns.state(), before)
    joint = JointEnv("line", n_robots=2)
    joint.reset(seed=0)
    with pytest.raises(InputError, match=r"action of robot_1"):
        joint.step({"robot_0": 4, "robot_1": action})
    team = TaskEnv("line", n_robots=2)
    team.reset(seed=0)
    with pytest.raises(InputError, match=r"action of robot_1"):
        team.step((4, action))
    assert np.array_equal(team.state(), before)


@pytest.mark.parametrize("action", [3, "up", (0,), (0, 0, 0), None])
def test_not_one_action_for_each_agent(action):
    env = TaskEnv("line", n_robots=2)
    env.reset(seed=0)
    with pytest.raises(InputError, match="action"):
        env.step(action)


def test_actions_of_unknown_or_missing_agents():
    env = JointEnv("line", n_robots=2)
    env.reset(seed=0)
    for actions in ({"robot_0": 0}, {"robot_0": 0, "robot_2": 0}, {}):
        with pytest.raises(InputError, match="one for each of"):
            env.step(actions)


@pytest.mark.parametrize(
    "actions",
    [
        np.full((3, 2), 5),
        np.full((3, 2), -1),
        np.zeros((2, 2), np.int64),
        np.zeros((3, 2)),
        [0, 1, 2],
        None,
    ],
)
def test_wrong_actions_of_many_copies(actions):
    env = VectorTaskEnv("line", 3, n_robots=2)
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"valid: integers from 0 to 4 in the shape \(3, 2\)"):
        env.step(actions)


def test_a_step_before_the_first_reset_and_after_the_end():
    for env, action in ((TaskEnv("maze"), 0), (TurnsEnv("maze"), 0), (JointEnv("maze"), None)):
        action = {"robot_0": 0} if action is None else action
        with pytest.raises(InputError, match=r"cannot step an episode that has not begun: .*reset"):
            env.step(action)
    with pytest.raises(InputError, match="episode that has not begun"):
        VectorTaskEnv("maze", 2).step(np.zeros(2, np.int64))
    env = TaskEnv("maze", step_limit=1)
    env.reset(seed=0)
    assert env.step(1)[3]
    with pytest.raises(InputError, match=r"cannot step an episode that is over: .*reset"):
        env.step(1)
    env.reset()
    env.step(1)


def test_a_step_of_turns_after_the_end():
    env = TurnsEnv("corridor", max_cycles=1)
    env.reset(seed=0)
    env.step(2)
    env.step(2)
    assert all(env.truncations.values())
    with pytest.raises(InputError, match="episode that is over"):
        env.step(2)
    env.step(None)
    env.step(None)
    assert env.agents == []
    with pytest.raises(InputError, match="episode that is over"):
        env.step(None)


def test_options_of_reset():
    for env in (TaskEnv("maze"), VectorTaskEnv("maze", 2)):
        with pytest.raises(InputError, match="options of reset"):
            env.reset(options={"start": (0, 0)})
        env.reset(options={})


@pytest.mark.parametrize("value", [0, -1, 2.0, True, None])
def test_a_wrong_number_of_copies(value):
    with pytest.raises(InputError, match="num_envs"):
        VectorTaskEnv("maze", value)


@pytest.mark.parametrize("value", [0, 10_000, 1.0, True])
def test_a_wrong_number_of_cores(value):
    with pytest.raises(InputError, match="cores"):
        VectorTaskEnv("maze", 2, cores=value)


def test_drawing_many_copies():
    with pytest.raises(InputError, match="render_mode"):
        VectorTaskEnv("maze", 2, render_mode="rgb_array")


@pytest.mark.parametrize("seed", [[1], [1, 2, 3]])
def test_not_one_seed_for_each_copy(seed):
    with pytest.raises(InputError, match="seed"):
        VectorTaskEnv("maze", 2).reset(seed=seed)


@pytest.mark.parametrize("value", [0, -3, 1.5, True])
def test_wrong_max_cycles(value):
    with pytest.raises(InputError, match="max_cycles"):
        TurnsEnv("line", max_cycles=value)


def test_limits_given_twice_and_options_beside_a_task():
    with pytest.raises(InputError, match="max_cycles"):
        TurnsEnv("line", max_cycles=3, step_limit=5)
    with pytest.raises(InputError, match=r"options .*max_cycles"):
        TurnsEnv(make_task("line"), max_cycles=3)
    with pytest.raises(InputError, match=r"options .*n_robots"):
        TaskEnv(make_task("line"), n_robots=3)
