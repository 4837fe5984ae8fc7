"""The contract of every registered environment, checked by the checkers that people use."""

from __future__ import annotations

from types import SimpleNamespace

import gymnasium
import numba
import numpy as np
import pettingzoo
import pytest
from absl.testing import absltest
from dm_env import StepType, test_utils
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.utils.env_match import check_environments_match
from gymnasium.utils.passive_env_checker import data_shares_objects
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers import TimeLimit
from gymnasium.wrappers.vector import DictInfoToList, RecordEpisodeStatistics
from pettingzoo.test import (
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    render_test,
    seed_test,
)

from hose_mj.envs import ALONE, IDS
from hose_mj.envs.dm import DmEnv
from hose_mj.envs.gym import TaskEnv
from hose_mj.envs.vector import VectorTaskEnv
from hose_mj.tasks.registry import TASKS, make_task

TEAMS = [id for id in IDS if id not in ALONE]
FORMS = ("array", "dict", "index")
ENDLESS = {
    "hose_mj/Line-v0": {"goal": "none", "violations_end": False},
    "hose_mj/LineNonCooperative-v0": {"goal": "none", "violations_end": False},
    "hose_mj/Line2015-v0": {"violations_end": False},
    "hose_mj/Corridor-v0": {"n_cells": 99, "starts": (0, 98), "goal": 49},
}
"""Options with which no event can end an episode within four rounds."""

every_id = pytest.mark.parametrize("id", IDS)
every_team = pytest.mark.parametrize("id", TEAMS)


def make_small(id, form, **options):
    """An environment; an index takes few enough variables to fit in an integer."""
    env = gymnasium.make(id, **options)
    if form != "array":
        names = [variable.name for variable in env.unwrapped.task.variables][-2:]
        env = gymnasium.make(id, form=form, observe=names, **options)
    return env


def test_every_task_has_an_environment():
    assert set(IDS.values()) == set(TASKS)
    assert {id for id, task in IDS.items() if make_task(task).n_agents == 1} == ALONE
    assert set(IDS) <= set(gymnasium.registry)
    for registry in (pettingzoo.aec_registry, pettingzoo.parallel_registry):
        assert {id for id in registry if id.startswith("hose_mj/")} == set(TEAMS)


@every_id
@pytest.mark.parametrize("form", FORMS)
def test_gymnasium_check_env(id, form):
    check_env(make_small(id, form).unwrapped)


@every_id
@pytest.mark.parametrize("moves", ["joint", "turns"])
def test_gymnasium_check_env_wrapped_in_a_time_limit(id, moves):
    env = gymnasium.make(id, moves=moves, max_episode_steps=50)
    assert isinstance(env, TimeLimit)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(200):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()


@pytest.mark.parametrize("id", sorted(ALONE))
@pytest.mark.parametrize("form", FORMS)
def test_stable_baselines_checker(id, form):
    checker = pytest.importorskip(
        "stable_baselines3.common.env_checker", reason="the extra deep is not installed"
    )
    checker.check_env(make_small(id, form), skip_render_check=False)


@every_id
@pytest.mark.parametrize("form", FORMS)
def test_random_play_stays_in_the_spaces(id, form):
    env = make_small(id, form).unwrapped
    env.action_space.seed(1)
    observation, info = env.reset(seed=1)
    for _ in range(300):
        assert env.observation_space.contains(observation)
        assert info["action_mask"].dtype == np.int8
        assert info["action_mask"].any(axis=-1).all()
        action = env.action_space.sample()
        observation, reward, terminated, truncated, info = env.step(action)
        assert type(reward) is float
        assert type(terminated) is bool
        assert type(truncated) is bool
        assert isinstance(info["events"], tuple)
        assert reward == pytest.approx(sum(info["signals"].values()))
        if terminated or truncated:
            observation, info = env.reset()


@pytest.mark.parametrize("n_robots", range(1, 9))
@pytest.mark.parametrize("id", [id for id in IDS if "Line" in id and "2015" not in id])
def test_every_number_of_robots(id, n_robots):
    env = gymnasium.make(id, n_robots=n_robots).unwrapped
    assert env.task.n_agents == (1 if id in ALONE else n_robots)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(60):
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        if terminated or truncated:
            observation, _ = env.reset()
            assert env.observation_space.contains(observation)


@every_id
def test_two_of_a_kind_match(id):
    check_environments_match(
        gymnasium.make(id, render_mode="rgb_array"),
        gymnasium.make(id, render_mode="rgb_array"),
        num_steps=30,
        seed=5,
    )


@every_id
@pytest.mark.parametrize(
    ("form", "cores"),
    [("array", 1), ("array", numba.config.NUMBA_NUM_THREADS), ("dict", 1), ("index", 1)],
    ids=["array", "array-all-cores", "dict", "index"],
)
def test_vector_is_the_synchronous_one_but_faster(id, form, cores):
    options = make_small(id, form).unwrapped.spec.kwargs
    del options["task"]
    ours = gymnasium.make_vec(id, 6, cores=cores, **options)
    theirs = gymnasium.make_vec(id, 6, vectorization_mode="sync", **options)
    assert isinstance(ours, VectorTaskEnv)
    assert isinstance(theirs, SyncVectorEnv)
    assert ours.metadata["autoreset_mode"] is theirs.metadata["autoreset_mode"]
    for name in ("observation_space", "action_space"):
        assert getattr(ours, name) == getattr(theirs, name)
        single = f"single_{name}"
        assert getattr(ours, single) == getattr(theirs, single)
    ours.action_space.seed(2)
    assert data_equivalence(ours.reset(seed=9), theirs.reset(seed=9), exact=True)
    ended = 0
    for _ in range(150):
        actions = ours.action_space.sample()
        step = ours.step(actions)
        assert data_equivalence(step, theirs.step(actions), exact=True)
        ended += int(np.sum(step[2] | step[3]))
    assert ended or id in ("hose_mj/Taxi-v0", "hose_mj/TaxiSingleAgent-v0", "hose_mj/Line2015-v0")


@every_id
def test_vector_keeps_to_the_vector_interface(id):
    env = gymnasium.make_vec(id, 4)
    assert isinstance(env, VectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert env.spec.id == id
    env.action_space.seed(3)
    calls = [env.reset(seed=3)]
    for _ in range(20):
        observations, rewards, terminated, truncated, infos = env.step(env.action_space.sample())
        assert env.observation_space.contains(observations)
        assert (rewards.shape, rewards.dtype) == ((4,), np.float64)
        assert terminated.dtype == truncated.dtype == np.bool_
        assert infos["action_mask"].dtype == np.int8
        calls.append((observations, infos))
    for k, (observations, infos) in enumerate(calls):
        for others, other_infos in calls[:k]:
            assert not data_shares_objects(observations, others)
            assert not data_shares_objects(infos, other_infos)
    env.close()
    env.close()


@every_id
def test_vector_wrappers_take_it(id):
    env = DictInfoToList(RecordEpisodeStatistics(gymnasium.make_vec(id, 3)))
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(20):
        *_, infos = env.step(env.action_space.sample())
        assert len(infos) == 3
        assert all("action_mask" in info for info in infos)


@every_team
@pytest.mark.parametrize("form", ["array"])
def test_pettingzoo_api(id, form):
    api_test(pettingzoo.make("aec", id, form=form), num_cycles=200)
    for moves in ("joint", "turns"):
        parallel_api_test(pettingzoo.make("parallel", id, form=form, moves=moves), num_cycles=200)


@every_team
def test_pettingzoo_seeds(id):
    seed_test(lambda: pettingzoo.make("aec", id), num_cycles=100)
    for moves in ("joint", "turns"):
        parallel_seed_test(lambda m=moves: pettingzoo.make("parallel", id, moves=m), 100)


@every_team
def test_pettingzoo_max_cycles(id):
    options = ENDLESS.get(id, {})
    max_cycles_test(
        SimpleNamespace(
            env=lambda **given: pettingzoo.make("aec", id, **options, **given),
            parallel_env=lambda **given: pettingzoo.make("parallel", id, **options, **given),
        )
    )


@every_team
def test_pettingzoo_render(id):
    render_test(lambda render_mode: pettingzoo.make("aec", id, render_mode=render_mode))


class DmContract(test_utils.EnvironmentTestMixin):
    """dm_env's own contract tests, over episodes that end."""

    options: dict

    def make_object_under_test(self):
        return DmEnv(seed=0, **self.options)

    def make_action_sequence(self):
        random = np.random.default_rng(4)
        spec = self.environment.action_spec()
        for _ in range(30):
            yield random.integers(0, spec.maximum + 1, spec.shape, spec.dtype)

    def test_an_episode_of_the_sequence_ends(self):
        self.reset_environment()
        steps = [self.step_environment(action) for action in self.make_action_sequence()]
        assert StepType.LAST in [step.step_type for step in steps]


for _id, _task in IDS.items():
    for _form in ("array", "dict"):
        _name = f"TestDm{_id.split('/')[1].removesuffix('-v0')}{_form.title()}"
        globals()[_name] = type(
            _name,
            (DmContract, absltest.TestCase),
            {"options": {"task": _task, "form": _form, "step_limit": 8}},
        )


@every_id
def test_copies_share_nothing(id):
    """An episode is the same whether or not another one is played, and tampered with, beside it."""

    def play(env, other):
        env.action_space.seed(7)
        if other is not None:
            other.reset(seed=8)
        seen = [env.reset(seed=7)[0]]
        for _ in range(40):
            observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
            seen.append((observation.copy(), reward, terminated, truncated, info["events"]))
            observation += 1000
            info["action_mask"][...] = 0
            info["signals"].clear()
            env.state()[:] = -5
            if other is not None:
                *_, other_terminated, other_truncated, _ = other.step(other.action_space.sample())
                if other_terminated or other_truncated:
                    other.reset()
            if terminated or truncated:
                seen.append(env.reset()[0])
        return seen

    alone = play(TaskEnv(IDS[id]), None)
    beside = play(TaskEnv(IDS[id]), TaskEnv(IDS[id]))
    assert data_equivalence(alone, beside, exact=True)
