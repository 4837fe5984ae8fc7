"""`TaskEnv`: a task as a Gymnasium environment, where one actor chooses for all agents."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from hose_mj.envs.episode import check_moves, sum_signals
from hose_mj.envs.interface import Interface, build_task, refuse_reset_options
from hose_mj.envs.view import Form, View
from hose_mj.errors import InputError
from hose_mj.tasks.task import Task


class TaskEnv(Interface, gymnasium.Env[Any, Any]):
    """All agents of a task as one actor.

    The action is an integer for a task of one agent and one integer for each agent otherwise
    (MultiDiscrete). The observation has each variable that all agents share once, then those of
    each agent. The reward is the team's: what each agent gets for its own events, summed.

    `info` holds `action_mask` (int8, one row for each agent if there are several), `events`
    (names), `signals` (the team's reward by signal) and `agent_rewards` (what each agent gets).

    Args:
        task: id of a task, or a task.
        moves: "joint": all move at once; "turns": one after the other, as in `TurnsEnv`.
        observe: names of the variables to show; None for all.
        form: "array" (MultiDiscrete), "dict" (Dict of Discrete by name) or "index" (one Discrete).
        rewards: reward signals whose sum is the reward; None for all.
        render_mode: one of `RENDER_MODES`, or None.
        options: options of the task.

    Attributes:
        task, episode: what is played.
        at_once: whether all agents move at once, and not each in its turn.

    Raises:
        InputError: an unknown task, option or name, or a value outside its valid set.
    """

    def __init__(
        self,
        task: str | Task,
        *,
        moves: str = "joint",
        observe: Sequence[str] | None = None,
        form: Form = "array",
        rewards: Sequence[str] | None = None,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        super().__init__(build_task(task, options), rewards, render_mode)
        self.at_once = check_moves(moves)
        self._view = View(self.task, observe, form, range(self.task.n_agents))
        self.observation_space = self._view.make_space()
        self.action_space = make_action_space(self.task)

    @property
    def variable_names(self) -> tuple[str, ...]:
        """What each entry of the observation is called."""
        return self._view.names

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode; `InputError` for options, of which there are none."""
        gymnasium.Env.reset(self, seed=seed)
        refuse_reset_options(options)
        self.episode.reset(self.np_random)
        self._renderer.follow(self.episode)
        return self._observe(), self._make_info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Lets all agents move; `InputError` if it is over or an action is out of range."""
        episode = self.episode
        episode.play_all(split_action(self.task, action), self.at_once)
        reward = float(sum_signals(episode.compute_team_signals(), episode.chosen))
        self._renderer.follow(episode)
        return self._observe(), reward, episode.terminated, episode.truncated, self._make_info()

    def _observe(self) -> Any:
        return self._view.shape(self._view.look(self.task.kernel, self.episode.state))

    def _make_info(self) -> dict[str, Any]:
        task, episode = self.task, self.episode
        masks = episode.make_masks()
        signals = episode.compute_team_signals().tolist()
        return {
            "action_mask": masks if task.n_agents > 1 else masks[0],
            "events": task.name_events(episode.events),
            "signals": dict(zip(task.rewards, signals, strict=True)),
            "agent_rewards": episode.compute_agent_rewards(),
        }


def make_action_space(task: Task) -> spaces.Space[Any]:
    """Makes the space of one action for each agent, or of the only agent's."""
    if task.n_agents == 1:
        return spaces.Discrete(task.n_actions)
    return spaces.MultiDiscrete(np.full(task.n_agents, task.n_actions, np.int64))


def split_action(task: Task, action: Any) -> Sequence[Any]:
    """Returns the agents' actions; `InputError` for what is no sequence of them."""
    if task.n_agents == 1:
        return (action,)
    if isinstance(action, str) or not hasattr(action, "__len__"):
        raise InputError("action", action, f"{task.n_agents} integers, one for each agent")
    return action  # type: ignore[no-any-return]
