"""`Episode`: a task being played, one move or one round at a time; what all interfaces stand on."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import Any

import numpy as np

from hose_mj.envs import kernels
from hose_mj.errors import InputError, check_choice
from hose_mj.jit import compile_notice
from hose_mj.tasks.kernels import STEPS, TURN, Floats, Integers
from hose_mj.tasks.stream import Stream, make_stream
from hose_mj.tasks.task import Task

MOVES = ("joint", "turns")


class Episode:
    """One copy of a task, and what the last step did to it.

    Args:
        task: what is played.
        rewards: names of the reward signals that make the reward; None for all.

    Attributes:
        state: of the task, see `hose_mj.tasks.kernels`.
        caused_events: the events that each agent caused in the last step (n_agents,).
        reward_by_mover: what each agent got for each mover's events, by signal
            (movers, agents, n_signals).
        events: all events of the last step, as bits.
        terminated: an event has ended the episode.
        truncated: the step limit has.
        begun: it has been reset at least once.

    Raises:
        InputError: an unknown or doubled reward signal.
    """

    def __init__(self, task: Task, rewards: Sequence[str] | None = None) -> None:
        n_agents, n_signals = task.n_agents, len(task.rewards)
        self.task = task
        self.state = task.make_state()
        self.caused_events = np.zeros(n_agents, np.int64)
        self.reward_by_mover = np.zeros((n_agents, n_agents, n_signals))
        self.events = 0
        self.terminated = self.truncated = False
        self.chosen = choose_signals(task, rewards)
        self._stream: Stream | None = None
        self._generator: np.random.Generator | None = None
        self.begun = self._compiled = False

    @property
    def turn(self) -> int:
        """The agent whose turn it is."""
        return int(self.state[TURN])

    @property
    def steps(self) -> int:
        """Moves of single agents since the reset."""
        return int(self.state[STEPS])

    @property
    def is_running(self) -> bool:
        """Whether it has begun and not ended."""
        return self.begun and not (self.terminated or self.truncated)

    def reset(self, generator: np.random.Generator) -> None:
        """Starts anew. A generator seeds the stream of random numbers when it is first seen."""
        if generator is not self._generator or self._stream is None:
            self._generator, self._stream = generator, make_stream(generator)
        self.state = self.task.reset(self._stream)
        kernels.forget(self.caused_events, self.reward_by_mover)
        self.events, self.begun = 0, True
        self.terminated = self.truncated = False

    def play_turn(self, action: Any) -> None:
        """Lets the agent whose turn it is move.

        Raises:
            InputError: an action out of range, or an episode that is over.
        """
        self._check_running()
        number = self.check_action(action, self.turn)
        kernels.forget(self.caused_events, self.reward_by_mover)
        self._play(kernels.play_turn, number)

    def play_all(self, actions: Sequence[Any], at_once: bool) -> None:
        """Lets all agents move, at once or each in its turn until the episode ends.

        Raises:
            InputError: not one action for each agent, one out of range, or an episode that is over.
        """
        self._check_running()
        if len(actions) != self.task.n_agents:
            valid = f"{self.task.n_agents} actions, one for each agent"
            raise InputError("actions", actions, valid)
        numbers = np.array([self.check_action(a, i) for i, a in enumerate(actions)], np.int64)
        self._play(kernels.play_joint if at_once else kernels.play_round, numbers)

    def check_action(self, action: Any, agent: int) -> int:
        """Returns an action as a plain integer; `InputError` unless it is in range."""
        names = self.task.action_names
        is_whole = isinstance(action, int | np.integer) and not isinstance(action, bool)
        if isinstance(action, np.ndarray) and action.shape == () and action.dtype.kind in "iu":
            is_whole = True
        if not is_whole or not 0 <= action < len(names):
            valid = f"an integer from 0 to {len(names) - 1} ({', '.join(names)})"
            raise InputError(f"action of {self.task.agents[agent]}", action, valid)
        return int(action)

    def make_masks(self) -> kernels.Flags:
        """Returns the action masks, a new array (n_agents, n_actions)."""
        allowed = np.empty((self.task.n_agents, self.task.n_actions), np.int8)
        record = self.task.kernel
        kernels.choose(kernels.allow, record)(record, self.state, allowed)
        return allowed

    def compute_agent_rewards(self) -> Floats:
        """Returns the agents' rewards of the last step (n_agents,), the chosen signals summed."""
        return sum_signals(self.reward_by_mover.sum(axis=0), self.chosen)

    def compute_team_signals(self) -> Floats:
        """Returns the team's rewards of the last step, by signal; see `compute_team_signals`."""
        return compute_team_signals(self.reward_by_mover)

    def _check_running(self) -> None:
        if not self.is_running:
            found = "is over" if self.begun else "has not begun"
            raise InputError.about(f"cannot step an episode that {found}: call reset() first")

    def _play(self, play: Callable[..., Any], actions: int | Integers) -> None:
        record = self.task.kernel
        play = kernels.choose(play, record)
        with nullcontext() if self._compiled else compile_notice(f"task {self.task.id}"):
            events = play(record, self.state, actions, self.caused_events, self.reward_by_mover)
        self._compiled = True
        self.events = int(events)
        self.terminated = bool(self.events & self.task.kernel.terminal)
        self.truncated = not self.terminated and self.steps >= self.task.step_limit


def compute_team_signals(reward_by_mover: Floats) -> Floats:
    """Returns what a team gets, by signal (..., n_signals): each mover's own rewards, summed.

    So an event that all agents feel counts once, as in Table 6.1. `reward_by_mover` is
    (..., movers, agents, n_signals).
    """
    return np.asarray(np.einsum("...mms->...s", reward_by_mover))


def sum_signals(signals: Floats, chosen: Integers) -> Floats:
    """Returns the sum of the chosen signals; `signals` is (..., n_signals)."""
    total: Floats = signals[..., chosen].sum(axis=-1)
    return total


def choose_signals(task: Task, rewards: Sequence[str] | None) -> Integers:
    """Returns the places of the named reward signals; `InputError` for a wrong name."""
    names = task.rewards if rewards is None else rewards
    check_names("rewards", names, task.rewards)
    return np.array([task.rewards.index(name) for name in names], np.int64)


def check_names(thing: str, names: Sequence[str], known: Sequence[str]) -> None:
    """Raises `InputError` unless they are one or more of the known names, each only once."""
    valid = "names out of " + ", ".join(known)
    if isinstance(names, str) or not names:
        raise InputError(thing, names, f"one or more {valid}")
    for name in names:
        if name not in known:
            raise InputError(thing, name, valid)
    if len(set(names)) < len(names):
        raise InputError(thing, tuple(names), "each name only once")


def check_moves(moves: str) -> bool:
    """Returns whether all agents move at once; `InputError` for anything but a name in `MOVES`."""
    check_choice("moves", moves, MOVES)
    return moves == "joint"
