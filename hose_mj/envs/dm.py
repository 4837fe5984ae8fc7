"""`DmEnv`: a task behind the interface dm_env, made of `TaskEnv`."""

from typing import Any

import dm_env
import numpy as np
from dm_env import specs
from gymnasium import spaces

from hose_mj.envs.gym import TaskEnv
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task


class DmEnv(dm_env.Environment):
    """All agents of a task as one actor; arguments are those of `TaskEnv`.

    The observation is a dict of `observation`, as in `TaskEnv`, and `action_mask`. The discount is
    0 where an event has ended the episode, and 1 where the step limit has. The seed is that of the
    first episode; the random numbers go on from one episode to the next.
    """

    def __init__(self, task: str | Task, seed: int | None = None, **options: Any) -> None:
        self.env = TaskEnv(task, **options)
        self._seed = seed
        self._actions = make_spec(self.env.action_space, "action")
        n_agents, n_actions = self.env.task.n_agents, self.env.task.n_actions
        shape = (n_agents, n_actions) if n_agents > 1 else (n_actions,)
        self._observations = {
            "observation": make_spec(self.env.observation_space, "observation"),
            "action_mask": specs.BoundedArray(shape, np.int8, 0, 1, "action_mask"),
        }

    def reset(self) -> dm_env.TimeStep:
        """Starts an episode."""
        observation, info = self.env.reset(seed=self._seed)
        self._seed = None
        return dm_env.restart(_observe(observation, info))

    def step(self, action: Any) -> dm_env.TimeStep:
        """Lets all agents move, or starts an episode where none runs.

        `InputError` is raised for an action out of range.
        """
        if not self.env.episode.is_running:
            return self.reset()
        observation, reward, terminated, truncated, info = self.env.step(action)
        seen = _observe(observation, info)
        if terminated:
            return dm_env.termination(reward, seen)
        return dm_env.truncation(reward, seen) if truncated else dm_env.transition(reward, seen)

    def observation_spec(self) -> dict[str, Any]:
        """Returns what is observed."""
        return dict(self._observations)

    def action_spec(self) -> Any:
        """Returns what may be done."""
        return self._actions

    def state(self) -> Integers:
        """Returns a copy of the task's state, with turn and step count before it."""
        return self.env.state()


def make_spec(space: spaces.Space[Any], name: str) -> Any:
    """Makes the spec of a Discrete, MultiDiscrete or Dict space."""
    if isinstance(space, spaces.Dict):
        return {key: make_spec(part, key) for key, part in space.items()}
    if isinstance(space, spaces.MultiDiscrete):
        return specs.BoundedArray(space.shape, space.dtype, 0, space.nvec - 1, name)
    assert isinstance(space, spaces.Discrete)
    return specs.DiscreteArray(int(space.n), space.dtype, name)


def _observe(observation: Any, info: dict[str, Any]) -> dict[str, Any]:
    return {"observation": observation, "action_mask": info["action_mask"]}
