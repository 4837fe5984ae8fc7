"""`TurnsEnv`: a task as a PettingZoo AEC environment, the canonical form: agents move in turns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import AECEnv

from hose_mj.envs.drawing import RENDER_MODES, Renderer
from hose_mj.envs.episode import Episode, sum_signals
from hose_mj.envs.options import build_task
from hose_mj.envs.view import Form, View
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task


class TurnsEnv(AECEnv[str, Any, Any]):
    """The agents of a task, each moving in its turn.

    `infos[agent]` holds, about the moves since the agent's own last one (its own included):
    `action_mask` (int8), `events` (names of all that happened), `charged` (names of those that the
    agent caused), `signals` (what it got, by reward signal) and `cycle_rewards` (its reward of each
    of these moves, in order: equation 6.4 discounts within the cycle, `last()` does not).

    Args:
        task: id of a task, or a task.
        observe: names of the variables to show; None for all.
        form: "array" (a Box of integers), "dict" (Dict of Discrete by name) or "index" (one
            Discrete).
        rewards: reward signals whose sum is the reward; None for all.
        render_mode: one of `RENDER_MODES`, or None.
        max_cycles: rounds after which an episode is cut off, in place of the task's `step_limit`.
        options: options of the task.

    Raises:
        InputError: an unknown task, option or name, or a value outside its valid set.
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 10, "is_parallelizable": False}  # noqa: RUF012

    def __init__(
        self,
        task: str | Task,
        *,
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
        self.possible_agents = list(self.task.agents)
        self.agents: list[str] = []
        self._numbers = {agent: number for number, agent in enumerate(self.task.agents)}
        self._views = [View(self.task, observe, form, [i]) for i in range(self.task.n_agents)]
        self._spaces = [make_agent_space(view) for view in self._views]
        self._actions = [spaces.Discrete(self.task.n_actions) for _ in self.task.agents]
        self._generator, _ = seeding.np_random()

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Returns what the agent may see."""
        return self._spaces[self._numbers[agent]]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Returns what the agent may do."""
        return self._actions[self._numbers[agent]]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Starts an episode; `options` are ignored, for there are none."""
        if seed is not None:
            self._generator, _ = seeding.np_random(seed)
        self.episode.reset(self._generator)
        self.agents = list(self.possible_agents)
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
        felt = episode.felt[mover]  # (agents, n_signals)
        rewards = sum_signals(felt, episode.chosen).tolist()
        self.rewards = dict(zip(self.agents, rewards, strict=True))
        self.terminations = dict.fromkeys(self.agents, episode.terminated)
        self.truncations = dict.fromkeys(self.agents, episode.truncated)
        for number, cycle in enumerate(self._cycles):
            charged = episode.events if number == mover else 0
            cycle.add(rewards[number], felt[number], episode.events, charged)
        self._accumulate_rewards()
        self._write_infos()
        self.agent_selection = self.agents[episode.turn]
        self._renderer.follow(episode)

    def observe(self, agent: str) -> Any:
        """Returns what the agent sees now, in new arrays."""
        view = self._views[self._numbers[agent]]
        return view.shape(view.look(self.task.kernel, self.episode.state))

    def state(self) -> Integers:
        """Returns a copy of the task's state, with turn and step count before it."""
        return self.episode.state.copy()

    def render(self) -> Any:
        """Returns the picture that `render_mode` asks for; None without one."""
        return self._renderer.render(self.episode)

    def close(self) -> None:
        """Ends the rendering; may be called again."""
        self._renderer.close()

    def _write_infos(self) -> None:
        masks = self.episode.make_masks()
        self.infos: dict[str, dict[str, Any]] = {}
        for number, agent in enumerate(self.agents):
            cycle = self._cycles[number]
            self.infos[agent] = {
                "action_mask": masks[number].copy(),
                "events": self.task.name_events(cycle.events),
                "charged": self.task.name_events(cycle.charged),
                "signals": dict(zip(self.task.rewards, cycle.signals.tolist(), strict=True)),
                "cycle_rewards": np.array(cycle.rewards),
            }


class _Cycle:
    """What an agent got since its own last move began."""

    def __init__(self, n_signals: int) -> None:
        self.rewards: list[float] = []
        self.signals = np.zeros(n_signals)
        self.events = self.charged = 0

    def add(self, reward: float, felt: np.ndarray[Any, Any], events: int, charged: int) -> None:
        """Adds a move: what the agent got for it, what happened, what it caused itself."""
        self.rewards.append(reward)
        self.signals += felt
        self.events |= events
        self.charged |= charged


def make_agent_space(view: View) -> spaces.Space[Any]:
    """Makes an agent's space: a Box where PettingZoo's tests want one."""
    return view.make_box() if view.form == "array" else view.make_space()
