"""Turns by consensus (thesis section 6.5): clocks that agree by messages, and who acts by them.

There is no controller. Each agent keeps a clock xi_i that counts turns, hears some of the others'
clocks once a round, and acts while its own clock says that the turn is its own. Real time is
measured in turns of a clock that is neither fast nor slow: 1/v is the unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from hose_mj.errors import InputError
from hose_mj.recording.palette import OTHERS, darken, format_hex

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
IDLE = -1  # the turn of an agent that is not acting


@dataclass(frozen=True, kw_only=True)
class ConsensusSettings:
    """A network of clocks; `InputError` for a value outside its range."""

    n_agents: int = 4  # N
    loss: float = 0.1  # probability that a message is lost, each on its own
    delay: int = 1  # largest delay of a message, in rounds; each has a uniform one of 0 .. delay
    # Largest relative error of a clock's rate; each has a uniform one of +- drift.
    drift: float = 0.02
    rounds: int = 50  # rounds of messages in one turn
    offset: float = 3.0  # the first clocks are uniform between 0 and this many turns
    # Turns before this one are left to the clocks to agree; nobody acts in them.
    first_turn: int = 6
    n_turns: int = 60  # turns that are played
    action_time: float = 0.5  # longest action, in turns; durations are uniform from 0 on
    # Whether an agent that is done gives the turn at once, xi_i <- t_i + 1, or lets it run out.
    early_finish: bool = True
    # Whether the mean with others' clocks may take a clock back below a turn that it has reached,
    # as the thesis has it; see `simulate`.
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
    """What arrives in one round."""

    # Whether agent i gets a message of agent j (N, N); none from itself.
    heard: npt.NDArray[np.bool_]
    ages: Integers  # rounds since agent j sent it (N, N)


class Action(NamedTuple):
    """One action of one agent, from `begin` to `end` (times in turns)."""

    turn: int
    agent: int
    begin: float
    end: float


@dataclass(frozen=True)
class Record:
    """What a simulation saw."""

    rates: Floats  # v_i (N,), turns per unit of time
    clocks: Floats  # xi_i at the beginning of each round (n_rounds, N)
    actions: tuple[Action, ...]  # as they began
    round_time: float  # between two rounds

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
    what its sender's clock showed when it left. `history` has the clocks of this round and of those
    before, newest first (n_kept, N); `increments` are v_i h (N,).
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


def compute_owner(turn: int, n_agents: int) -> int:
    """Returns delta(t), the agent whose turn it is."""
    return turn % n_agents


def _begin(
    settings: ConsensusSettings, random: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Draws the clocks' rates, what they show at first, and so what they showed before."""
    rates = draw_rates(settings, random)
    clocks = random.uniform(0.0, settings.offset, settings.n_agents)
    return rates, clocks, np.tile(clocks, (settings.delay + 1, 1))


def run_clocks(settings: ConsensusSettings, random: np.random.Generator, n_rounds: int) -> Record:
    """Lets clocks agree while nobody acts."""
    rates, clocks, history = _begin(settings, random)
    seen = []
    for _ in range(n_rounds):
        seen.append(clocks)
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
    rates, clocks, history = _begin(settings, random)
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
            own = compute_owner(turn, n_agents) == agent and settings.first_turn <= turn < last_turn
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


def count_overlaps(actions: tuple[Action, ...]) -> int:
    """Returns how many actions began before an earlier one had ended."""
    ends = np.maximum.accumulate([action.end for action in actions])
    begins = np.array([action.begin for action in actions])
    return int((begins[1:] < ends[:-1]).sum())


def count_disorder(actions: tuple[Action, ...], settings: ConsensusSettings) -> int:
    """Returns how many places of the sequence of turns are not what the order of turns wants."""
    wanted = range(settings.first_turn, settings.first_turn + settings.n_turns)
    got = [action.turn for action in actions]
    wrong = sum(a != b for a, b in zip(got, wanted, strict=False))
    return wrong + abs(len(got) - len(wanted))


def compute_leads(record: Record) -> Floats:
    """Returns how far clocks have got into its turn when each action begins (n_actions,), in turns.

    It is the furthest that any clock has been by then: late messages still tell of it.
    """
    furthest = np.maximum.accumulate(record.clocks.max(axis=1))
    rounds = [round(action.begin / record.round_time) for action in record.actions]
    turns = [action.turn for action in record.actions]
    return np.asarray(furthest[rounds] - turns, np.float64)


def compute_longest_action(lead: float, drift: float) -> float:
    """Returns the longest action that surely ends before the next one begins, in turns.

    The agent after the owner of turn t begins when its clock reaches t + 1, so not before any clock
    does. The furthest that any has been is at most `lead` into a turn when its owner begins, and
    grows by at most 1 + drift per unit of time (a mean of what clocks show or showed puts none
    beyond it) until the owner itself, being done, gives the turn. So an action is over in time if
    lead + (1 + drift) A <= 1.

    The thesis's v = 1/T, a turn as long as the longest action, leaves no room for any disagreement.
    """
    return (1.0 - lead) / (1.0 + drift)


def compute_speed(settings: ConsensusSettings) -> float:
    """Returns how fast the agreed clock runs without drift, in turns per unit of time.

    A message of age d shows a clock d steps ago, and so holds its reader back:
    v' h = v h - q (N - 1) / N (delay / 2) v' h.
    """
    held = (1.0 - settings.loss) * (settings.n_agents - 1) / settings.n_agents
    return 1.0 / (1.0 + held * settings.delay / 2.0)


def compute_disagreement(settings: ConsensusSettings, rates: Floats, n_rounds: int = 400) -> float:
    """Returns the standard deviation of the clocks about their common mean, in turns.

    It is the square root of E[sum_i (xi_i - mean)^2] / N after `n_rounds` rounds from equal clocks
    with rates v_i (N,), agents that act left aside; it settles within some tens of rounds. Without
    delay the value is

        sqrt((1 + p) / ((1 - p) (1 - lambda))) h std(v_i), lambda = p^2 + 2 p (1 - p) (N - 1) / N^2.
    """
    n, kept = settings.n_agents, settings.delay + 1
    arrive = 1.0 - settings.loss
    # Clock j of age d stands at place d N + j of the vector of all kept clocks.
    step = np.eye(n * kept, k=-n)
    step[:n, :n] = np.eye(n) * (1.0 - arrive * (n - 1) / n)
    others = (np.ones((n, n)) - np.eye(n)) * arrive / (n * kept)
    for age in range(kept):
        step[:n, age * n : (age + 1) * n] += others
    push = np.zeros(n * kept)
    push[:n] = rates * settings.round_time
    mean, second = np.zeros(n * kept), np.zeros((n * kept, n * kept))
    for _ in range(n_rounds):
        moved = step @ mean
        noise = _compute_noise(settings, second)
        second = step @ second @ step.T + np.outer(moved, push) + np.outer(push, moved)
        second += np.outer(push, push)
        second[np.arange(n), np.arange(n)] += noise
        mean = moved + push
    newest = second[:n, :n]
    return float(np.sqrt(max((np.trace(newest) - newest.sum() / n) / n, 0.0)))


def _compute_noise(settings: ConsensusSettings, second: Floats) -> Floats:
    """Returns the variance that chance adds to each clock in a round (N,).

    Agent i adds up b (xi_j[age] - xi_i) / N over the others, with b = 1 where a message arrived;
    the variance of one term, given the clocks, is q E_age[D^2] - q^2 E_age[D]^2.
    """
    n, kept = settings.n_agents, settings.delay + 1
    arrive = 1.0 - settings.loss
    own = np.diag(second)[:n]
    told = np.diag(second).reshape(kept, n).mean(axis=0)
    cross = second[:n].reshape(n, kept, n).mean(axis=1)
    square = own[:, None] - 2.0 * cross + told[None, :]
    blocks = second.reshape(kept, n, kept, n).mean(axis=(0, 2))
    mean_square = own[:, None] - 2.0 * cross + np.diag(blocks)[None, :]
    terms = arrive * square - arrive**2 * mean_square
    np.fill_diagonal(terms, 0.0)
    return np.asarray(terms.sum(axis=1) / n**2)


# Trials: what clocks do at one loss of messages, measured and drawn

SETTLING_TURNS, MEASURED_TURNS = 10, 40
"""Turns after which clocks that run alone have agreed, and turns measured from then on."""
SHOWN_TURNS = 1.0  # time during which the agreement is shown, in turns
SHOWN_ACTIONS = 16


class ConsensusTrial(NamedTuple):
    """One loss: clocks that run alone, agents that act (`play`), and numbers for the document."""

    settings: ConsensusSettings
    clocks: Record
    play: Record
    record: dict[str, float]


def run_trial(settings: ConsensusSettings, seed: int) -> ConsensusTrial:
    """Simulates one loss, twice: clocks alone, and agents that act by them."""
    alone, playing = np.random.default_rng(seed).spawn(2)
    settling = SETTLING_TURNS * settings.rounds
    n_rounds = settling + MEASURED_TURNS * settings.rounds
    clocks = run_clocks(settings, alone, n_rounds)
    play = simulate(settings, playing)
    leads = compute_leads(play)
    lead = float(leads.max()) if len(leads) else 1.0  # clocks so coarse that they skip all turns
    reached = (play.clocks.max(axis=1) >= settings.first_turn).argmax()
    duration = (len(play.times) - reached) * settings.round_time  # the last round is over too
    record = {
        "loss": settings.loss,
        "first_spread": float(play.spreads[0]),
        "agreed_spread": float(play.spreads[reached]),
        "disagreement": float(np.sqrt(clocks.clocks[settling:].var(axis=1).mean())),
        "exact_disagreement": compute_disagreement(settings, clocks.rates),
        "actions": len(play.actions),
        "disorder": count_disorder(play.actions, settings),
        "overlaps": count_overlaps(play.actions),
        "longest_safe_action": compute_longest_action(lead, settings.drift),
        "turns_per_time": settings.n_turns / float(duration),
    }
    return ConsensusTrial(settings, clocks, play, record)


def draw_consensus(trials: Sequence[ConsensusTrial], own: ConsensusTrial) -> bytes:
    """Returns the PNG: disagreement of all trials over time above, the actions of one below."""
    from hose_mj.recording.plots.labels import label_line_ends
    from hose_mj.recording.plots.style import encode_png, make_figure

    n = own.settings.n_agents
    with make_figure((7.6, 5.6), f"{n} clocks agree on whose turn it is") as figure:
        above, below = figure.subplots(2, 1, height_ratios=(3, 2))
        ends = _draw_agreement(above, trials)
        _draw_actions(below, own)
        figure.draw_without_rendering()
        label_line_ends(above, ends)
        return encode_png(figure)


def _draw_agreement(axes: Axes, trials: Sequence[ConsensusTrial]) -> list[tuple[float, str, str]]:
    """Draws disagreement over time; returns where each line ends, its name and colour."""
    ends = []
    for place, trial in enumerate(trials):
        color = OTHERS[place % len(OTHERS)]
        clocks = trial.clocks
        shown = clocks.times <= SHOWN_TURNS
        deviations = clocks.clocks.std(axis=1)[shown]
        axes.plot(clocks.times[shown], deviations, color=format_hex(color), lw=1.3)
        exact = trial.record["exact_disagreement"]
        if exact > 0.0:
            axes.axhline(exact, color=format_hex(color), lw=0.9, ls=(0, (1.5, 1.5)))
        name = f"{100.0 * trial.settings.loss:g} % lost"
        ends.append((float(deviations[-1]), name, format_hex(darken(color))))
    axes.set_yscale("log")
    axes.set_xlim(0.0, SHOWN_TURNS)
    axes.set_xlabel("time (turns); dotted: the exact value in the long run")
    axes.set_ylabel("standard deviation\nof the clocks (turns)")
    return ends


def _draw_actions(axes: Axes, trial: ConsensusTrial) -> None:
    """Draws a bar for each action, with its turn, on the line of its agent."""
    from hose_mj.recording.plots.style import SOFT

    settings = trial.settings
    shown = trial.play.actions[:SHOWN_ACTIONS]
    for action in shown:
        color = OTHERS[action.agent % len(OTHERS)]
        width = action.end - action.begin
        axes.barh(action.agent, width, left=action.begin, height=0.55, color=format_hex(color))
        axes.axvline(action.begin, color=SOFT, lw=0.5, ls=(0, (1, 3)), zorder=0)
        axes.annotate(
            str(action.turn),
            (action.begin, action.agent - 0.3),
            xytext=(0, 1),
            textcoords="offset points",
            fontsize=7.0,
            color=SOFT,
            va="bottom",
        )
    axes.grid(False)
    axes.set_ylim(settings.n_agents - 0.5, -0.8)
    axes.set_yticks(range(settings.n_agents), [f"agent {i}" for i in range(settings.n_agents)])
    given = "given when the action is done" if settings.early_finish else "left to run out"
    lost = f"{100.0 * settings.loss:g} % of messages lost"
    axes.set_xlabel(f"time (turns); bars: who acts in which turn; {lost}, turns {given}")
