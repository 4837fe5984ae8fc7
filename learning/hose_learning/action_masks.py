"""Learned vetoes as action masks for other learners, deep ones above all.

`VetoMasks` is what a trained veto learner knows. `MaskedEnv` puts it around an environment and has
`action_masks()`, which sb3-contrib's MaskablePPO asks for.
"""

from collections.abc import Callable, Sequence
from typing import Any, cast

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from hose_learning.evaluation import make_probe
from hose_learning.loop import add_vetoes, compute_unvetoed
from hose_learning.study.training import Training
from hose_learning.tables import count_free, grow
from hose_mj.envs.episode import Episode, sum_signals
from hose_mj.envs.gym import TaskEnv, split_action
from hose_mj.envs.interface import build_task, refuse_reset_options
from hose_mj.envs.view import View
from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task


class SharedPolicyEnv(gymnasium.Env[Any, Any]):
    """Round-robin play by one policy: each step is a move of the agent whose turn it is.

    The observation is that agent's number and what it sees; the reward is the team's for the move,
    an event that all agents feel counting once. So one learner with the turn in its state learns
    for all (as Algorithm 6.1 does), through the eyes of each.

    `info` holds `action_mask` (int8, of the agent whose turn it is) and `events` (names).

    Arguments are those of `hose_mj.envs.gym.TaskEnv`; `task` and `episode` are what is played.

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
        """Starts an episode; `InputError` for options, of which there are none."""
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


Mask = npt.NDArray[np.bool_]


class VetoMasks:
    """What a veto learner forbids, as masks; it can go on learning.

    Vetoes are those of boolean modules (section 5.3) and of values below their thresholds (section
    4.5), of a training that may be trained or not. They are copied: the training stays as it is.
    Only the former can be learned here. Several environments may share one of these: what one of
    them runs into, all of them avoid.
    """

    def __init__(self, training: Training) -> None:
        self.task = training.task
        # Masks need no update rule; without its type the kernels serve all rules.
        self._learner = training.learner._replace(rule=())
        memory = make_probe(training.memory)
        table, vetoes = (
            known._replace(keys=known.keys.copy(), used=known.used.copy(), rows=known.rows.copy())
            for known in (memory.table, memory.vetoes)
        )
        self._memory = memory._replace(table=table, vetoes=vetoes, own=())

    def count_vetoes(self) -> int:
        """Returns how many actions the boolean modules have vetoed, over all that they see."""
        return int(np.bitwise_count(self._memory.vetoes.rows).sum())

    def compute_mask(self, state: Integers, agent: int, available: Mask | None = None) -> Mask:
        """Computes what an agent may do in a state (n_actions,), never nothing at all.

        Where everything is vetoed it is the learner's fallback ("none") if there is one, and else
        whatever is available. `available` (n_actions,) is what may be done at all, at least one
        action; None for what the task says.
        """
        self._memory.state[:] = state
        bits = int(self._call(compute_unvetoed, agent))
        actions = np.arange(self.task.n_actions)
        if available is None:
            record = self.task.kernel
            available = (kernels.mask(record, state, agent) >> actions & 1).astype(bool)
        allowed = available & (bits >> actions & 1).astype(bool)
        if not allowed.any():
            allowed = available & (actions == self._learner.fallback)
        return allowed if allowed.any() else available.copy()

    def learn(self, state: Integers, agent: int, action: int, events: int) -> None:
        """Vetoes what an agent did in a state, if its events break what a boolean module guards.

        Only the agent that caused the events (bits) is to be charged with them: vetoes for others
        would forbid innocent actions.
        """
        if count_free(self._memory.vetoes) <= len(self._learner.veto_bases):
            self._memory = self._memory._replace(vetoes=grow(self._memory.vetoes))
        self._memory.state[:] = state
        self._call(add_vetoes, agent, action, events)

    def _call(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        record = self.task.kernel
        run = kernel if isinstance(record, tuple) else cast(Any, kernel).py_func
        return run(record, self._learner, self._memory, *arguments)


class MaskedEnv(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """An environment that knows which actions are vetoed.

    Observations, rewards and infos are those of the environment, and a vetoed action that is taken
    all the same is played: the mask is advice for who asks.

    Args:
        env: a `TaskEnv` or a `SharedPolicyEnv`, or wrappers around one.
        masks: the vetoes.
        learns: whether an action that breaks a constraint is vetoed from then on.

    Raises:
        InputError: another environment; one of a task whose variables, actions or events differ
            from those of the masks; or one whose agents choose before those ahead of them moved.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], masks: VetoMasks, *, learns: bool = False
    ) -> None:
        # Kept as they are: what a copy of the masks learned would be lost.
        RecordConstructorArgs.__init__(self, masks=masks, learns=learns, _disable_deepcopy=True)
        gymnasium.Wrapper.__init__(self, env)
        inner = env.unwrapped
        if not isinstance(inner, TaskEnv | SharedPolicyEnv):
            raise InputError("env", type(inner).__name__, "a TaskEnv or a SharedPolicyEnv")
        check_same(masks.task, inner.task)
        if isinstance(inner, TaskEnv) and inner.task.n_agents > 1 and not inner.at_once:
            raise InputError("moves", "turns", "joint, or a SharedPolicyEnv, for several agents")
        self.masks, self.learns = masks, learns
        self._inner = inner
        self._available: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._available = info["action_mask"]
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Plays an action, and learns from it if it is to."""
        episode, actors = self._inner.episode, self._list_actors()
        before = episode.state.copy()
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._available = info["action_mask"]
        if self.learns:
            actions = (action,) if len(actors) == 1 else split_action(self._inner.task, action)
            for agent, chosen in zip(actors, actions, strict=True):
                if episode.caused_events[agent]:
                    self.masks.learn(before, agent, int(chosen), int(episode.caused_events[agent]))
        return observation, reward, terminated, truncated, info

    def action_masks(self) -> Mask:
        """Returns what may be done now: (n_actions,), of several agents one after the other.

        Raises:
            InputError: before the first reset.
        """
        if self._available is None:
            raise InputError("episode", "not begun", "one that has begun; call reset() first")
        actors, state = self._list_actors(), self._inner.episode.state
        available = np.reshape(self._available, (len(actors), -1)).astype(bool)
        pairs = zip(actors, available, strict=True)
        return np.concatenate([self.masks.compute_mask(state, a, row) for a, row in pairs])

    def _list_actors(self) -> list[int]:
        """The agents that the next action is for."""
        if isinstance(self._inner, SharedPolicyEnv):
            return [self._inner.episode.turn]
        return list(range(self._inner.task.n_agents))


def check_same(trained: Task, played: Task) -> None:
    """Raises `InputError` unless vetoes learned in one task mean the same in the other."""
    for name in ("agents", "variables", "action_names", "events"):
        if getattr(trained, name) != getattr(played, name):
            valid = f"one with the {name.replace('_', ' ')} of the task that the vetoes are from"
            raise InputError("task", played.id, valid)
