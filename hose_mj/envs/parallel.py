"""`JointEnv`: a task as a PettingZoo Parallel environment: all agents choose, then all move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from hose_mj.envs.drawing import RENDER_MODES, Renderer
from hose_mj.envs.episode import Episode, check_moves, sum_signals
from hose_mj.envs.options import build_task
from hose_mj.envs.turns import make_agent_space
from hose_mj.envs.view import Form, View
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task


class JointEnv(ParallelEnv[str, Any, Any]):
    """The agents of a task, one action of each at a step.

    `infos[agent]` holds `action_mask` (int8), `events` (names of all that happened in the step),
    `charged` (names of those that the agent caused), `signals` (what it got, by reward signal) and
    `cycle_rewards` (what it got for each agent's move, in the order of the turns).

    Args:
        task: id of a task, or a task.
        moves: "joint": all move at once; "turns": one after the other, as in `TurnsEnv`.
        observe: names of the variables to show; None for all.
        form: "array" (a Box of integers), "dict" (Dict of Discrete by name) or "index" (one
            Discrete).
        rewards: reward signals whose sum is the reward; None for all.
        render_mode: one of `RENDER_MODES`, or None.
        max_cycles: steps after which an episode is cut off, in place of the task's `step_limit`.
        options: options of the task.

    Raises:
        InputError: an unknown task, option or name, or a value outside its valid set.
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        task: str | Task,
        *,
        moves: str = "joint",
        observe: Sequence[str] | None = None,
        form: Form = "array",
        rewards: Sequence[str] | None = None,
        render_mode: str | None = None,
        max_cycles: int | None = None,
        **options: Any,
    ) -> None:
        super().__init__()
        self.task = build_task(task, options, max_cycles)
        self.metadata = {**self.metadata, "name": self.task.id}
        self.episode = Episode(self.task, rewards)
        self.render_mode = render_mode
        self._renderer = Renderer(self.task, render_mode)
        self._at_once = check_moves(moves)
        self.possible_agents = list(self.task.agents)
        self.agents: list[str] = []
        self._views = [View(self.task, observe, form, [i]) for i in range(self.task.n_agents)]
        self._numbers = {agent: number for number, agent in enumerate(self.task.agents)}
        self._spaces = [make_agent_space(view) for view in self._views]
        self._actions = [spaces.Discrete(self.task.n_actions) for _ in self.task.agents]
        self._generator, _ = seeding.np_random()

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Returns what the agent may see."""
        return self._spaces[self._numbers[agent]]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Returns what the agent may do."""
        return self._actions[self._numbers[agent]]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Starts an episode; `options` are ignored, for there are none."""
        if seed is not None:
            self._generator, _ = seeding.np_random(seed)
        self.episode.reset(self._generator)
        self.agents = list(self.possible_agents)
        self._renderer.follow(self.episode)
        return self._observe(), self._make_infos()

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[
        dict[str, Any],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
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

    def state(self) -> Integers:
        """Returns a copy of the task's state, with turn and step count before it."""
        return self.episode.state.copy()

    def render(self) -> Any:
        """Returns the picture that `render_mode` asks for; None without one."""
        return self._renderer.render(self.episode)

    def close(self) -> None:
        """Ends the rendering; may be called again."""
        self._renderer.close()

    def _observe(self) -> dict[str, Any]:
        record, state = self.task.kernel, self.episode.state
        views = zip(self.possible_agents, self._views, strict=True)
        return {agent: view.shape(view.look(record, state)) for agent, view in views}

    def _make_infos(self) -> dict[str, dict[str, Any]]:
        task, episode = self.task, self.episode
        masks, signals = episode.make_masks(), episode.felt.sum(axis=0).tolist()
        per_mover = sum_signals(episode.felt, episode.chosen)  # (movers, agents)
        return {
            agent: {
                "action_mask": masks[number].copy(),
                "events": task.name_events(episode.events),
                "charged": task.name_events(int(episode.charged[number])),
                "signals": dict(zip(task.rewards, signals[number], strict=True)),
                "cycle_rewards": per_mover[:, number].copy(),
            }
            for number, agent in enumerate(self.possible_agents)
        }
