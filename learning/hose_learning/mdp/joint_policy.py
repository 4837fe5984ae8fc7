"""Joint moves composed from what agents learned in turns (thesis section 6.4).

Each agent has its own Q-values and its own estimates of what its moves do, P^_i and R^_i, both from
playing in turns. For a joint move the agents pass a message around once: the states that the agents
so far may have brought about, each with its probability. All of it is plain Python on dicts.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hose_learning import rules
from hose_learning.evaluation import make_probe
from hose_learning.loop import see
from hose_learning.mediators import compute_above_thresholds
from hose_learning.study.training import Training
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import OVER, Model
from hose_mj.tasks.kernels import STEPS, TURN, Integers
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task

State = tuple[int, ...]
"""A task's state, its step count left out; it is nobody's turn (-1) in a terminal one."""
Message = Mapping[State, float]  # probability of each state, <s^j, P^_j>
Evaluate = Callable[[int, State], Mapping[int, float]]
"""Q^i(s, .) of an agent, for the actions that it may take."""
NOBODY = -1


class Estimates:
    """What one agent knows of its own moves.

    Attributes:
        counts: how often a move (s, a) led to each s'.
        rewards: S_i^r, the states whose entry was rewarded, and with what.
    """

    def __init__(self) -> None:
        self.counts: defaultdict[tuple[State, int], Counter[State]] = defaultdict(Counter)
        self.rewards: dict[State, float] = {}
        self._left: set[State] = set()

    def note(self, state: State, action: int, reward: float, following: State) -> None:
        """Notes one move <s, a, r, s'>."""
        self.counts[state, action][following] += 1
        self._left.add(state)
        if reward > 0.0:
            self.rewards[following] = reward

    def knows(self, state: State) -> bool:
        """Whether there is any transition information from a state; there is none if it is over."""
        return state in self._left

    def predict(self, state: State, action: int) -> Message:
        """Returns P^_i(s, a, .); nothing where the move was never seen."""
        seen = self.counts.get((state, action), Counter())
        total = sum(seen.values())
        return {following: count / total for following, count in seen.items()}

    def reward(self, state: State) -> float:
        """Returns R^_i(s), 0 where none was seen."""
        return self.rewards.get(state, 0.0)


@dataclass(frozen=True)
class Composition:
    """A joint move that agents agreed on."""

    actions: tuple[int, ...]  # one of each agent, in the order of their turns
    messages: tuple[Message, ...]  # what each agent got, and at last what the cycle leads to
    value: float  # what eqs 6.5 and 6.6 expect of it, rewards that are not positive left out


def compose(
    start: State, estimates: Sequence[Estimates], evaluate: Evaluate, discount: float, idle: int
) -> Composition:
    """Lets the agents agree on a joint move from s_0, agent 0's turn, one after the other.

    `evaluate` is asked only about states that its agent knows; `idle` is the action of an agent
    that expects nothing but terminal states.
    """
    messages: list[Message] = [{start: 1.0}]
    actions = []
    value = 0.0
    for agent, known in enumerate(estimates):
        action = choose(agent, messages[-1], known, evaluate, idle)
        sent: defaultdict[State, float] = defaultdict(float)
        for state, probability in messages[-1].items():
            predicted = known.predict(state, action)
            if not predicted:  # no transition information: the entry stays as it is
                sent[state] += probability
            for following, share in predicted.items():
                # P^(s_0, a_1..a_i, s_i) = sum_j P^(s_0, a_1..a_(i-1), s^j) P^_i(s^j, a_i, s_i)
                sent[following] += probability * share
                # eq. 6.6: + gamma^i R(s_i, a_(i+1), s_(i+1))
                value += discount**agent * probability * share * known.reward(following)
        actions.append(action)
        messages.append(dict(sent))
    # eq. 6.6: + gamma^N max_a' Q(s_N, a', delta(1))
    for state, probability in messages[-1].items():
        if estimates[0].knows(state):
            best = max(evaluate(0, state).values(), default=0.0)
            value += discount ** len(estimates) * probability * best
    return Composition(tuple(actions), tuple(messages), value)


def choose(agent: int, message: Message, known: Estimates, evaluate: Evaluate, idle: int) -> int:
    """Returns a_i = arg max_a sum_j P^_j (R^(s^j) + gamma Q^i(s^j, a)), the first of equal ones.

    The reward estimate is the same for all actions, so it and the factor gamma play no part. An
    action counts only if it is allowed in every state that the agent may have to act in.
    """
    live = {state: p for state, p in message.items() if known.knows(state)}
    values = {state: evaluate(agent, state) for state in live}
    allowed = set.intersection(*(set(q) for q in values.values())) if live else set()
    if not allowed:
        return idle
    return max(sorted(allowed), key=lambda a: sum(p * values[s][a] for s, p in live.items()))


def make_key(state: Integers, is_over: bool = False) -> State:
    """Returns a task's state as it stands in messages."""
    key = state.tolist()
    key[STEPS] = 0
    if is_over:
        key[TURN] = NOBODY
    return tuple(key)


def find_idle(task: Task) -> int:
    """Returns the number of the action "none", or 0 in a task that has no such action."""
    return task.action_names.index("none") if "none" in task.action_names else 0


def estimate(
    task: Task, evaluate: Evaluate, n_moves: int, generator: np.random.Generator
) -> list[Estimates]:
    """Plays in turns, each agent any action that it may take, and lets each note its own moves.

    The keys of `evaluate` are the actions that an agent may take; none at all leaves it idle.
    `n_moves` are moves of single agents; the generator decides actions and resets.
    """
    estimates = [Estimates() for _ in task.agents]
    stream = make_stream(generator)
    rewards = np.zeros(len(task.rewards))
    state = task.reset(stream)
    for _ in range(n_moves):
        agent, before = int(state[TURN]), make_key(state)
        allowed = sorted(evaluate(agent, before)) or [find_idle(task)]
        action = allowed[int(generator.integers(len(allowed)))]
        events = kernels.apply(task.kernel, state, agent, action)
        kernels.compute_rewards(task.kernel, events, agent, agent, rewards)
        is_over = kernels.is_over(task.kernel, events)
        after = make_key(state, is_over)
        estimates[agent].note(before, action, float(rewards.sum()), after)
        if is_over or kernels.is_cut_off(task.kernel, state):
            state = task.reset(stream)
    return estimates


@dataclass(frozen=True)
class JointMove:
    """One joint move of a composed policy, the state after it and the events that it caused."""

    composition: Composition
    state: Integers
    events: int


def play_composed(
    task: Task,
    start: Integers,
    estimates: Sequence[Estimates],
    evaluate: Evaluate,
    discount: float,
    max_moves: int,
) -> list[JointMove]:
    """Plays joint moves that `compose` makes until the episode is over, at most `max_moves`."""
    state, idle = start.copy(), find_idle(task)
    charged = np.zeros(task.n_agents, np.int64)
    moves: list[JointMove] = []
    while len(moves) < max_moves:
        composition = compose(make_key(state), estimates, evaluate, discount, idle)
        actions = np.array(composition.actions, np.int64)
        events = kernels.apply_joint(task.kernel, state, actions, charged)
        moves.append(JointMove(composition, state.copy(), events))
        if kernels.is_over(task.kernel, events):
            break
    return moves


def count_fewest_moves(model: Model, success: int) -> int | None:
    """Returns how many moves at least lead from the first state to a success; None if none do.

    The model is a task written out, as by `exact.enumerate_joint`; `success` are the events that
    mean it.
    """
    reached, frontier = {0}, [0]
    moves = 0
    while frontier:
        moves += 1
        if (model.events[frontier] & success).any():
            return moves
        following = set(model.successors[frontier].ravel().tolist()) - {OVER} - reached
        reached |= following
        frontier = sorted(following)
    return None


def make_evaluate(training: Training) -> Callable[[int, State], dict[int, float]]:
    """Makes a function of agent and state that returns the value of each action not vetoed."""
    task, learner, probe = training.task, training.learner, make_probe(training.memory)

    def evaluate(agent: int, state: State) -> dict[int, float]:
        probe.state[:] = np.array(state)
        allowed = see(task.kernel, learner, probe, agent)
        if learner.has_thresholds:
            allowed &= compute_above_thresholds(learner, probe, agent, task.n_actions)
        rules.score(learner.rule, learner, probe, agent)
        scores = probe.scores.tolist()
        return {action: scores[action] for action in range(task.n_actions) if allowed >> action & 1}

    return evaluate
