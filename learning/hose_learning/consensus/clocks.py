"""Turns by consensus (thesis section 6.5): clocks that agree by messages, and who acts by them.

There is no controller. Each agent keeps a clock xi_i that counts turns, hears some of the others'
clocks once a round, and acts while its own clock says that the turn is its own. Real time is
measured in turns of a clock that is neither fast nor slow: 1/v is the unit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hose_mj.errors import InputError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
IDLE = -1
"""The turn of an agent that is not acting."""


@dataclass(frozen=True, kw_only=True)
class ConsensusSettings:
    """A network of clocks.

    Attributes:
        n_agents: N.
        loss: probability that a message is lost, each on its own.
        delay: largest delay of a message, in rounds; each has a uniform one of 0 .. delay.
        drift: largest relative error of a clock's rate; each has a uniform one of +- drift.
        rounds: rounds of messages in one turn.
        offset: the first clocks are uniform between 0 and this many turns.
        first_turn: turns before this one are left to the clocks to agree; nobody acts in them.
        n_turns: turns that are played.
        action_time: longest action, in turns; durations are uniform from 0 on.
        early_finish: whether an agent that is done gives the turn at once, xi_i <- t_i + 1, or lets
            it run out.
        falls_back: whether the mean with others' clocks may take a clock back below a turn that it
            has reached, as the thesis has it; see `simulate`.

    Raises:
        InputError: a value outside its range.
    """

    n_agents: int = 4
    loss: float = 0.1
    delay: int = 1
    drift: float = 0.02
    rounds: int = 50
    offset: float = 3.0
    first_turn: int = 6
    n_turns: int = 60
    action_time: float = 0.5
    early_finish: bool = True
    falls_back: bool = False

    def __post_init__(self) -> None:
        for name, low, high in (("n_agents", 2, 20), ("delay", 0, 10), ("rounds", 1, 10**4)):
            _check_between(name, getattr(self, name), low, high, whole=True)
        for name in ("first_turn", "n_turns"):
            _check_between(name, getattr(self, name), 1, 10**5, whole=True)
        for name, below in (("loss", 0.95), ("drift", 0.5), ("offset", 100.0)):
            _check_between(name, getattr(self, name), 0.0, below)
        _check_between("action_time", self.action_time, 0.0, 1.0)
        if self.first_turn < self.offset:
            raise InputError("first_turn", self.first_turn, f"at least the offset, {self.offset:g}")

    @property
    def round_time(self) -> float:
        """Time between two rounds of messages, in turns."""
        return 1.0 / self.rounds


def _check_between(name: str, value: float, low: float, high: float, whole: bool = False) -> None:
    if not low <= value <= high or (whole and value != int(value)):
        raise InputError(name, value, f"a {'whole ' * whole}number from {low:g} to {high:g}")


class Messages(NamedTuple):
    """What arrives in one round.

    Attributes:
        heard: whether agent i gets a message of agent j (N, N); none from itself.
        ages: rounds since agent j sent it (N, N).
    """

    heard: npt.NDArray[np.bool_]
    ages: Integers


class Action(NamedTuple):
    """One action of one agent, from `begin` to `end` (times in turns)."""

    turn: int
    agent: int
    begin: float
    end: float


@dataclass(frozen=True)
class Record:
    """What a simulation saw.

    Attributes:
        rates: v_i of each clock (N,), turns per unit of time.
        clocks: xi_i at the beginning of each round (n_rounds, N).
        actions: in the order in which they began.
        round_time: time between two rows of `clocks`.
    """

    rates: Floats
    clocks: Floats
    actions: tuple[Action, ...]
    round_time: float

    @property
    def times(self) -> Floats:
        """The times of the rounds (n_rounds,)."""
        return np.arange(len(self.clocks), dtype=np.float64) * self.round_time

    @property
    def spreads(self) -> Floats:
        """Largest difference between two clocks (n_rounds,), in turns."""
        return np.asarray(np.ptp(self.clocks, axis=1), np.float64)


def draw_rates(settings: ConsensusSettings, random: np.random.Generator) -> Floats:
    """Returns the rates v_i of the clocks (N,), 1 but for their drift."""
    drifts = random.uniform(-settings.drift, settings.drift, settings.n_agents)
    return np.asarray(1.0 + drifts, np.float64)


def draw_messages(settings: ConsensusSettings, random: np.random.Generator) -> Messages:
    """Returns the messages that arrive in one round."""
    shape = (settings.n_agents, settings.n_agents)
    heard = random.random(shape) >= settings.loss
    np.fill_diagonal(heard, False)
    return Messages(heard, random.integers(0, settings.delay, shape, endpoint=True))


def compute_clocks(history: Floats, messages: Messages, increments: Floats) -> Floats:
    """Returns the clocks one round on, by the consensus of equation 6.7.

        xi_i <- xi_i - sum_j a_ij (xi_i - xi_j) + v_i h,   a_ij = 1/N if j was heard, else 0

    It is the equation's discrete form: what was heard is weighed once a round, and a message says
    what its sender's clock showed when it left.

    Args:
        history: the clocks of this round and of those before, newest first (n_kept, N).
        messages: what arrives.
        increments: v_i h of each clock (N,).
    """
    clocks = history[0]
    n_agents = len(clocks)
    told = history[messages.ages, np.arange(n_agents)]
    weights = messages.heard / n_agents
    pulls = (weights * (clocks[:, None] - told)).sum(axis=1)
    return np.asarray(clocks - pulls + increments)


def compute_turns(clocks: Floats) -> Integers:
    """Returns t_i = floor(xi_i), the turn that each agent takes it to be (equation 6.8)."""
    return np.floor(clocks).astype(np.int64)


def find_owner(turn: int, n_agents: int) -> int:
    """Returns delta(t), the agent whose turn it is."""
    return turn % n_agents


def run_clocks(settings: ConsensusSettings, random: np.random.Generator, n_rounds: int) -> Record:
    """Lets clocks agree while nobody acts."""
    rates = draw_rates(settings, random)
    clocks = random.uniform(0.0, settings.offset, settings.n_agents)
    history = np.tile(clocks, (settings.delay + 1, 1))
    seen = []
    for _ in range(n_rounds):
        seen.append(history[0])
        messages = draw_messages(settings, random)
        clocks = compute_clocks(history, messages, rates * settings.round_time)
        history = np.concatenate([clocks[None], history[:-1]])
    return Record(rates, np.array(seen), (), settings.round_time)


def simulate(settings: ConsensusSettings, random: np.random.Generator) -> Record:
    """Lets clocks agree and agents act by them, until the last turn is over for all.

    With `falls_back` off, a clock never falls below the turn that it has reached. Otherwise the
    mean draws the agent that gave its turn away, ahead of all others, back into that turn, and the
    others gain only an N-th of the time that was saved.
    """
    n_agents, h = settings.n_agents, settings.round_time
    last_turn = settings.first_turn + settings.n_turns
    rates = draw_rates(settings, random)
    clocks = random.uniform(0.0, settings.offset, n_agents)
    history = np.tile(clocks, (settings.delay + 1, 1))
    acting = np.full(n_agents, IDLE)
    acted = np.full(n_agents, IDLE)
    ends = np.zeros(n_agents)
    seen: list[Floats] = []
    actions: list[Action] = []
    while clocks.min() < last_turn:
        now = len(seen) * h
        seen.append(clocks)
        turns = compute_turns(clocks)
        messages = draw_messages(settings, random)
        following = compute_clocks(history, messages, rates * h)
        if not settings.falls_back:
            following = np.maximum(following, turns)
        for agent in range(n_agents):
            turn = int(turns[agent])
            own = find_owner(turn, n_agents) == agent and settings.first_turn <= turn < last_turn
            if acting[agent] == IDLE and own and acted[agent] < turn:  # wait turn
                ends[agent] = now + random.uniform(0.0, settings.action_time)
                acting[agent] = acted[agent] = turn
                actions.append(Action(turn, agent, now, float(ends[agent])))
            if acting[agent] != IDLE and ends[agent] <= now + h:
                if settings.early_finish:  # give turn: xi_i <- t_i + 1
                    following[agent] = max(following[agent], acting[agent] + 1)
                acting[agent] = IDLE
        clocks = following
        history = np.concatenate([clocks[None], history[:-1]])
    return Record(rates, np.array(seen), tuple(actions), h)
