"""`SharedPolicyEnv`: agents in turns as a Gymnasium environment of one policy that all share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from hose_mj.envs.episode import Episode, sum_signals
from hose_mj.envs.interface import build_task, refuse_reset_options
from hose_mj.envs.view import View
from hose_mj.tasks.task import Task


class SharedPolicyEnv(gymnasium.Env[Any, Any]):
    """Round-robin play by one policy: each step is a move of the agent whose turn it is.

    The observation is that agent's number and what it sees; the reward is the team's for the move,
    an event that all agents feel counting once. So one learner with the turn in its state learns
    for all (as Algorithm 6.1 does), through the eyes of each.

    `info` holds `action_mask` (int8, of the agent whose turn it is) and `events` (names).

    Args:
        task: id of a task, or a task.
        observe: names of the variables to show; None for all.
        rewards: reward signals whose sum is the reward; None for all.
        options: options of the task.

    Attributes:
        task, episode: what is played.

    Raises:
        InputError: an unknown task, option or name, or a value outside its valid set.
    """

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        task: str | Task,
        *,
        observe: Sequence[str] | None = None,
        rewards: Sequence[str] | None = None,
        **options: Any,
    ) -> None:
        self.task = build_task(task, options)
        self.episode = Episode(self.task, rewards)
        n_agents = self.task.n_agents
        self._views = [View(self.task, observe, "array", [i]) for i in range(n_agents)]
        seen = self._views[0].cardinalities
        self.observation_space = spaces.MultiDiscrete(np.concatenate([[n_agents], seen]))
        self.action_space = spaces.Discrete(self.task.n_actions)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode.

        Raises:
            InputError: options, of which there are none.
        """
        super().reset(seed=seed)
        refuse_reset_options(options)
        self.episode.reset(self.np_random)
        return self._observe(), self._make_info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Lets the agent move whose turn it is.

        Raises:
            InputError: an action out of range, or an episode that is over.
        """
        episode = self.episode
        episode.play_turn(action)
        reward = float(sum_signals(episode.compute_team_signals(), episode.chosen))
        return self._observe(), reward, episode.terminated, episode.truncated, self._make_info()

    def _observe(self) -> Any:
        turn = self.episode.turn
        seen = self._views[turn].look(self.task.kernel, self.episode.state)
        return np.concatenate([[turn], seen])

    def _make_info(self) -> dict[str, Any]:
        episode = self.episode
        return {
            "action_mask": episode.make_masks()[episode.turn],
            "events": self.task.name_events(episode.events),
        }
