"""The same seed and the same actions give the same episodes through every interface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from hose_mj.envs import IDS
from hose_mj.envs.dm import DmEnv
from hose_mj.envs.gym import TaskEnv
from hose_mj.envs.parallel import JointEnv
from hose_mj.envs.turns import TurnsEnv
from hose_mj.envs.vector import VectorTaskEnv
from hose_mj.tasks.registry import make_task

SEED = 11
SHORT = {"step_limit": 30}
ROUNDS = 120


class Moment(NamedTuple):
    """After a reset or a round: the state, the rewards, whether an event or the limit ended it."""

    state: list
    team: float | None = None
    agents: list | None = None
    terminated: bool = False
    truncated: bool = False


def draw_actions(task):
    return np.random.default_rng(3).integers(0, task.n_actions, (ROUNDS, task.n_agents))


def play_turns(task, moves, actions):
    assert moves == "turns"
    env = TurnsEnv(task, **SHORT)
    env.reset(seed=SEED)
    yield Moment(env.state().tolist())
    for row in actions:
        team, agents = 0.0, np.zeros(len(env.possible_agents))
        for action in row:
            mover = env.agent_selection
            env.step(action)
            team += env.rewards[mover]
            agents += [env.rewards[agent] for agent in env.possible_agents]
            terminated, truncated = env.terminations[mover], env.truncations[mover]
            if terminated or truncated:
                break
        yield Moment(env.state().tolist(), team, agents.tolist(), terminated, truncated)
        if terminated or truncated:
            env.reset()
            yield Moment(env.state().tolist())


def play_parallel(task, moves, actions):
    env = JointEnv(task, moves=moves, **SHORT)
    env.reset(seed=SEED)
    yield Moment(env.state().tolist())
    for row in actions:
        _, rewards, terminated, truncated, _ = env.step(
            dict(zip(env.possible_agents, row, strict=True))
        )
        agents = [rewards[agent] for agent in env.possible_agents]
        ends = any(terminated.values()), any(truncated.values())
        yield Moment(env.state().tolist(), None, agents, *ends)
        if any(ends):
            env.reset()
            yield Moment(env.state().tolist())


def play_gymnasium(task, moves, actions):
    env = TaskEnv(task, moves=moves, **SHORT)
    env.reset(seed=SEED)
    yield Moment(env.state().tolist())
    for row in actions:
        _, team, *ends, info = env.step(row if len(row) > 1 else row[0])
        yield Moment(env.state().tolist(), team, info["agent_rewards"].tolist(), *ends)
        if any(ends):
            env.reset()
            yield Moment(env.state().tolist())


def play_vector(task, moves, actions):
    """Copy 2 of 4, the others playing something else."""
    env = VectorTaskEnv(task, 4, moves=moves, **SHORT)
    random = np.random.default_rng(8)
    env.reset(seed=SEED - 2)
    yield Moment(env.state()[2].tolist())
    for row in actions:
        batch = random.integers(0, env.task.n_actions, (4, env.task.n_agents))
        batch[2] = row
        _, team, terminated, truncated, infos = env.step(batch.reshape(env.action_space.shape))
        ends = bool(terminated[2]), bool(truncated[2])
        agents = infos["agent_rewards"][2].tolist()
        yield Moment(env.state()[2].tolist(), float(team[2]), agents, *ends)
        if any(ends):
            env.step(batch.reshape(env.action_space.shape))
            yield Moment(env.state()[2].tolist())


def play_dm(task, moves, actions):
    env = DmEnv(task, seed=SEED, moves=moves, **SHORT)
    env.reset()
    yield Moment(env.state().tolist())
    for row in actions:
        step = env.step(row if len(row) > 1 else row[0])
        terminated = step.last() and step.discount == 0.0
        truncated = step.last() and not terminated
        yield Moment(env.state().tolist(), step.reward, None, terminated, truncated)
        if step.last():
            env.reset()
            yield Moment(env.state().tolist())


PLAYERS = {
    "turns": (play_turns, play_parallel, play_gymnasium, play_vector, play_dm),
    "joint": (play_parallel, play_gymnasium, play_vector, play_dm),
}


@pytest.mark.parametrize("task", IDS.values())
@pytest.mark.parametrize("moves", PLAYERS)
def test_the_same_seed_gives_the_same_episodes(task, moves):
    actions = draw_actions(make_task(task))
    first, *others = [list(player(task, moves, actions)) for player in PLAYERS[moves]]
    assert any(moment.terminated or moment.truncated for moment in first)
    team = None
    for other in others:
        assert len(other) == len(first)
        for ours, theirs in zip(first, other, strict=True):
            assert ours.state == theirs.state
            assert (ours.terminated, ours.truncated) == (theirs.terminated, theirs.truncated)
            if None not in (ours.agents, theirs.agents):
                assert ours.agents == theirs.agents
        teams = [moment.team for moment in other]
        if any(reward is not None for reward in teams):
            team = teams if team is None else team
            assert teams == team
    if first[1].team is not None:
        assert [moment.team for moment in first] == team


def test_other_seeds_give_other_episodes():
    starts = {tuple(TaskEnv("line").reset(seed=seed)[0]) for seed in range(20)}
    assert len(starts) == 20


@pytest.mark.parametrize("moves", ["joint", "turns"])
def test_the_two_ways_to_move_are_the_thesis_tables(moves):
    """The corridor's {right, left}: Table 6.1 gives the cell to one, Table 6.2 too; -10 either way.

    The reward of the round is 90 in both (at gamma 1), and {left, right} costs 20.
    """
    env = TaskEnv("corridor", moves=moves)
    left, right, none = range(3)
    for actions, reward in (
        ((right, left), 90.0),
        ((left, right), -20.0),
        ((left, none), -10.0),
        ((right, none), 100.0),
        ((none, left), 100.0),
        ((none, none), 0.0),
    ):
        env.reset(seed=0)
        assert env.step(actions)[1] == reward
