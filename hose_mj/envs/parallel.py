"""`JointEnv`: a task as a PettingZoo Parallel environment: all agents choose, then all move."""

from collections.abc import Mapping
from typing import Any

from pettingzoo import ParallelEnv

from hose_mj.envs.episode import check_moves, sum_signals
from hose_mj.envs.interface import AgentsInterface
from hose_mj.errors import InputError
from hose_mj.tasks.task import Task

Named = dict[str, Any]


class JointEnv(AgentsInterface, ParallelEnv[str, Any, Any]):
    """The agents of a task, one action of each at a step.

    `infos[agent]` holds `action_mask` (int8), `events` (names of all that happened in the step),
    `caused_events` (names of those that the agent caused), `signals` (what it got, by reward
    signal) and `cycle_rewards` (what it got for each agent's move, in the order of the turns).

    With the moves "joint" all move at once, with "turns" one after the other, as in `TurnsEnv`. All
    other arguments are those of `AgentsInterface`.
    """

    def __init__(self, task: str | Task, *, moves: str = "joint", **options: Any) -> None:
        super().__init__(task, **options)
        self._at_once = check_moves(moves)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Named, dict[str, Named]]:
        """Starts an episode; `options` are ignored, for there are none."""
        self._start(seed)
        self._renderer.follow(self.episode)
        return self._observe(), self._make_infos()

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[Named, dict[str, float], dict[str, bool], dict[str, bool], dict[str, Named]]:
        """Lets all agents move.

        Raises:
            InputError: not one action for each agent, one out of range, or an episode that is over.
        """
        if self.episode.is_running and set(actions) != set(self.possible_agents):
            raise InputError("actions", dict(actions), f"one for each of {self.possible_agents}")
        episode = self.episode
        episode.play_all([actions.get(agent) for agent in self.possible_agents], self._at_once)
        agents = self.agents
        result = (
            self._observe(),
            dict(zip(agents, episode.compute_agent_rewards().tolist(), strict=True)),
            dict.fromkeys(agents, episode.terminated),
            dict.fromkeys(agents, episode.truncated),
            self._make_infos(),
        )
        self.agents = agents if episode.is_running else []
        self._renderer.follow(episode)
        return result

    def _observe(self) -> dict[str, Any]:
        return {agent: self.observe(agent) for agent in self.possible_agents}

    def _make_infos(self) -> dict[str, dict[str, Any]]:
        episode = self.episode
        masks, signals = episode.make_masks(), episode.reward_by_mover.sum(axis=0)
        per_mover = sum_signals(episode.reward_by_mover, episode.chosen)  # (movers, agents)
        return {
            agent: self._make_info(
                masks[number],
                episode.events,
                int(episode.caused_events[number]),
                signals[number],
                per_mover[:, number].copy(),
            )
            for number, agent in enumerate(self.possible_agents)
        }
