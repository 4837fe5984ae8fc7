"""`TurnsEnv`: a task as a PettingZoo AEC environment, the canonical form: agents move in turns."""

from typing import Any

import numpy as np
from pettingzoo import AECEnv

from hose_mj.envs.episode import sum_signals
from hose_mj.envs.interface import AgentsInterface
from hose_mj.tasks.kernels import Floats


class TurnsEnv(AgentsInterface, AECEnv[str, Any, Any]):
    """The agents of a task, each moving in its turn; arguments are those of `AgentsInterface`.

    `infos[agent]` holds, about the moves since the agent's own last one (its own included):
    `action_mask` (int8), `events` (names of all that happened), `caused_events` (names of those
    that the agent caused), `signals` (what it got, by reward signal) and `cycle_rewards` (its
    reward of each of these moves, in order: equation 6.4 discounts within the cycle, `last()` does
    not).
    """

    metadata = {**AgentsInterface.metadata, "is_parallelizable": False}  # noqa: RUF012

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Starts an episode; `options` are ignored, for there are none."""
        self._start(seed)
        self.agent_selection = self.agents[self.episode.turn]
        self._skip_agent_selection = None
        self.rewards = dict.fromkeys(self.agents, 0.0)
        self._cumulative_rewards = dict.fromkeys(self.agents, 0.0)
        self.terminations = dict.fromkeys(self.agents, False)
        self.truncations = dict.fromkeys(self.agents, False)
        self._cycles = [_Cycle(len(self.task.rewards)) for _ in self.agents]
        self._write_infos()
        self._renderer.follow(self.episode)

    def step(self, action: Any) -> None:
        """Lets the agent move whose turn it is; None for an agent whose episode has ended.

        Raises:
            InputError: an action out of range, or an episode that is over.
        """
        episode = self.episode
        if self.agents and not episode.is_running and action is None:
            self._was_dead_step(None)
            return
        mover = episode.turn
        episode.play_turn(action)
        self._cycles[mover] = _Cycle(len(self.task.rewards))
        self._cumulative_rewards[self.agent_selection] = 0.0
        signals = episode.reward_by_mover[mover]  # (agents, n_signals)
        rewards = sum_signals(signals, episode.chosen).tolist()
        self.rewards = dict(zip(self.agents, rewards, strict=True))
        self.terminations = dict.fromkeys(self.agents, episode.terminated)
        self.truncations = dict.fromkeys(self.agents, episode.truncated)
        for number, cycle in enumerate(self._cycles):
            caused_events = episode.events if number == mover else 0
            cycle.add(rewards[number], signals[number], episode.events, caused_events)
        self._accumulate_rewards()
        self._write_infos()
        self.agent_selection = self.agents[episode.turn]
        self._renderer.follow(episode)

    def _write_infos(self) -> None:
        self.infos: dict[str, dict[str, Any]] = {}
        rows = zip(self.agents, self.episode.make_masks(), self._cycles, strict=True)
        for agent, mask, cycle in rows:
            self.infos[agent] = self._make_info(
                mask, cycle.events, cycle.caused_events, cycle.signals, np.array(cycle.rewards)
            )


class _Cycle:
    """What an agent got since its own last move began."""

    def __init__(self, n_signals: int) -> None:
        self.rewards: list[float] = []
        self.signals = np.zeros(n_signals)
        self.events = self.caused_events = 0

    def add(self, reward: float, signals: Floats, events: int, caused_events: int) -> None:
        """Adds a move: what the agent got for it, what happened, what it caused itself."""
        self.rewards.append(reward)
        self.signals += signals
        self.events |= events
        self.caused_events |= caused_events
