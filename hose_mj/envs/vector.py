"""`VectorTaskEnv`: many copies of a task, stepped by one compiled call over all cores."""

import functools
import os
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import numba
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from hose_mj.envs import kernels
from hose_mj.envs.episode import check_moves, choose_signals, compute_team_signals, sum_signals
from hose_mj.envs.gym import make_action_space
from hose_mj.envs.interface import build_task, refuse_reset_options
from hose_mj.envs.view import Form, View
from hose_mj.errors import InputError
from hose_mj.jit import compile_notice
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task

_LEAST_COPIES = 128
"""With fewer copies for each core, one core is faster than several that wait for each other."""
_PARTS = 4  # parts of the copies for each core: some episodes take longer to start than others

Booleans = np.ndarray[Any, np.dtype[np.bool_]]
Result = tuple[Any, Floats, Booleans, Booleans, dict[str, Any]]


class VectorTaskEnv(VectorEnv[Any, Any, Any]):
    """Copies of `TaskEnv`: copy i after `reset(seed=s)` is a `TaskEnv` after `reset(seed=s + i)`.

    Observations, rewards and infos are those of `TaskEnv`, gathered as Gymnasium's vector
    environments gather them. A copy whose episode has ended starts the next one at the next step,
    whose action it ignores (`AutoresetMode.NEXT_STEP`).

    Args:
        task, moves, observe, form, rewards, options: as in `TaskEnv`.
        num_envs: number of copies.
        cores: how many to use; None for as many as there are with at least 128 copies for each.
            With 1 no thread is started (threads do not survive a fork of the process).
        render_mode: None; draw a single copy with `TaskEnv`.

    Raises:
        InputError: an unknown task, option or name, or a value outside its valid set.
    """

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        task: str | Task,
        num_envs: int = 1,
        *,
        moves: str = "joint",
        observe: Sequence[str] | None = None,
        form: Form = "array",
        rewards: Sequence[str] | None = None,
        cores: int | None = None,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        if isinstance(num_envs, bool) or not isinstance(num_envs, int) or num_envs < 1:
            raise InputError("num_envs", num_envs, "an integer, at least 1")
        if render_mode is not None:
            raise InputError("render_mode", render_mode, "None for many copies at once")
        self.task = build_task(task, options)
        self.num_envs = num_envs
        self._at_once = check_moves(moves)
        self._chosen = choose_signals(self.task, rewards)
        self._cores = choose_cores(cores, num_envs)
        parts = min(_PARTS * self._cores, num_envs)
        self._bounds = np.linspace(0, num_envs, parts + 1).astype(np.int64)
        self._view = View(self.task, observe, form, range(self.task.n_agents))
        self._batch = make_batch(self.task, num_envs, len(self._view.names))
        sets = range(2 ** len(self.task.events))
        self._event_names = np.empty(len(sets), object)
        self._event_names[:] = [self.task.name_events(events) for events in sets]
        self._begun = False
        self.single_observation_space = self._view.make_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.single_action_space = make_action_space(self.task)
        self.action_space: spaces.Space[Any] = batch_space(self.single_action_space, num_envs)

    @property
    def variable_names(self) -> tuple[str, ...]:
        """What each entry of an observation is called."""
        return self._view.names

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode of every copy.

        Args:
            seed: of the first copy, and one more for each further one; or a seed for each. Without
                one the random numbers go on.
            options: none.

        Raises:
            InputError: as many seeds as there are no copies of, or options.
        """
        refuse_reset_options(options)
        self._seed(seed)
        self._batch.over[:] = 1
        with nullcontext() if self._begun else compile_notice(f"copies of task {self.task.id}"):
            self._play(np.zeros((self.num_envs, self.task.n_agents), np.int64))
        self._begun = True
        return self._observe(), self._make_infos()

    def step(self, actions: Any) -> Result:
        """Steps every copy, or starts its next episode; actions are of `action_space`.

        `InputError` is raised for actions of another shape or out of range, or no reset before.
        """
        if not self._begun:
            raise InputError.about("cannot step an episode that has not begun: call reset() first")
        self._play(self._check_actions(actions))
        batch = self._batch
        rewards = sum_signals(compute_team_signals(batch.reward_by_mover), self._chosen)
        ended = batch.terminated.astype(np.bool_), batch.truncated.astype(np.bool_)
        return self._observe(), rewards, *ended, self._make_infos()

    def state(self) -> Integers:
        """Returns a copy of the states of the task (num_envs, state_size)."""
        return self._batch.states.copy()

    def _seed(self, seed: int | Sequence[int | None] | None) -> None:
        streams = self._batch.streams
        if seed is None:
            if not self._begun:
                shape = streams.shape
                streams[:] = self.np_random.integers(0, 2**64, size=shape, dtype=np.uint64)
            return
        if isinstance(seed, int | np.integer):
            self._np_random, self._np_random_seed = seeding.np_random(int(seed))
            seeds: Sequence[int | None] = range(int(seed), int(seed) + self.num_envs)
        else:
            seeds = seed
        if len(seeds) != self.num_envs:
            raise InputError("seed", seed, f"an integer, or {self.num_envs} of them")
        for stream, one in zip(streams, seeds, strict=True):
            if one is not None or not self._begun:
                stream[:] = make_stream(seeding.np_random(one)[0])

    def _play(self, actions: Integers) -> None:
        record = self.task.kernel
        arguments = record, self._batch, self._view.sight, actions, self._at_once
        if self._cores == 1 or not isinstance(record, tuple):
            kernels.choose(kernels.play_some, record)(*arguments, 0, self.num_envs)
            return
        start_threads()
        before = numba.get_num_threads()
        numba.set_num_threads(self._cores)
        try:
            kernels.play_all(*arguments, self._bounds)
        finally:
            numba.set_num_threads(before)

    def _check_actions(self, actions: Any) -> Integers:
        shape, count = self.action_space.shape, self.task.n_actions
        numbers = np.asarray(actions)
        valid = f"integers from 0 to {count - 1} in the shape {shape}"
        if numbers.shape != shape or numbers.dtype.kind not in "iu":
            raise InputError("actions", actions, valid)
        if np.any((numbers < 0) | (numbers >= count)):
            first = np.argwhere((numbers < 0) | (numbers >= count))[0]
            raise InputError(f"actions{first.tolist()}", numbers[tuple(first)], valid)
        return numbers.astype(np.int64).reshape(self.num_envs, self.task.n_agents)

    def _observe(self) -> Any:
        return self._view.shape(self._batch.seen.copy())

    def _make_infos(self) -> dict[str, Any]:
        batch, n = self._batch, self.num_envs
        signals = compute_team_signals(batch.reward_by_mover)
        masks = batch.allowed.copy() if self.task.n_agents > 1 else batch.allowed[:, 0].copy()
        by_name: dict[str, Any] = {}
        for place, name in enumerate(self.task.rewards):
            by_name[name], by_name[f"_{name}"] = signals[:, place].copy(), np.ones(n, np.bool_)
        infos = {
            "action_mask": masks,
            "events": self._event_names[batch.events],
            "signals": by_name,
            "agent_rewards": sum_signals(batch.reward_by_mover.sum(axis=1), self._chosen),
        }
        return infos | {f"_{name}": np.ones(n, np.bool_) for name in infos}


def make_batch(task: Task, n: int, n_seen: int) -> kernels.Batch:
    """Makes the arrays of n copies."""
    n_agents, flags = task.n_agents, np.int8
    return kernels.Batch(
        states=np.zeros((n, task.state_size), np.int64),
        streams=np.zeros((n, 1), np.uint64),
        over=np.ones(n, flags),
        caused_events=np.zeros((n, n_agents), np.int64),
        reward_by_mover=np.zeros((n, n_agents, n_agents, len(task.rewards))),
        values=np.zeros((n, len(task.variables)), np.int64),
        seen=np.zeros((n, n_seen), np.int64),
        allowed=np.zeros((n, n_agents, task.n_actions), flags),
        events=np.zeros(n, np.int64),
        terminated=np.zeros(n, flags),
        truncated=np.zeros(n, flags),
    )


@functools.cache
def start_threads() -> None:
    """Starts numba's threads so that they sleep between calls instead of keeping cores busy.

    GNU OpenMP reads this from the environment once, when it is loaded. Where other processes want
    the cores too, threads that spin make a step ten times slower.
    """
    name = "OMP_WAIT_POLICY"
    chosen = os.environ.get(name)
    os.environ[name] = chosen or "passive"
    try:
        numba.get_num_threads()
    finally:
        if chosen is None:
            del os.environ[name]


def choose_cores(cores: int | None, num_envs: int) -> int:
    """Returns how many cores to use; `InputError` unless there are as many."""
    there = int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    if cores is None:
        return min(there, max(1, num_envs // _LEAST_COPIES))
    if isinstance(cores, bool) or not isinstance(cores, int) or not 1 <= cores <= there:
        raise InputError("cores", cores, f"None or an integer from 1 to {there}")
    return min(cores, num_envs)
