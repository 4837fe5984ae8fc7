"""Sequential realizations (thesis section 6.4): are moves in turn joint moves of one agent?

A cooperative game in turns realizes a game of joint moves if a joint action a_i, in which every
agent but the i-th is idle, does what agent i's action a_i does alone (Definition 10).
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hose_learning.mdp.explicit_mdp import describe_state
from hose_mj.errors import InputError, check_choice
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import enumerate_joint, enumerate_turns
from hose_mj.tasks.kernels import HEADER, TURN, Floats, Integers
from hose_mj.tasks.task import Task

Sharing = Literal["team", "each"]
PROPERTIES = {
    1: "the transitions are the same",
    2: "the rewards are the same",
    3: "the episode ends alike",
}
"""Definition 10's two, and the one that its terminal states imply."""
TOLERANCE = 1e-9


@dataclass(frozen=True)
class SequentialViolation:
    """A property of Definition 10 that does not hold."""

    number: int  # a key of `PROPERTIES`
    count: int  # states, agents and actions for which it does not
    state: str  # of the first of them, in words
    agent: str  # its name
    action: str  # its name
    alone: str  # what comes of the action alone
    jointly: str  # what comes of the joint action in which it alone is not idle

    def __str__(self) -> str:
        return f"property {self.number} ({PROPERTIES[self.number]}) has exceptions: {self.count}"


@dataclass(frozen=True)
class MoveOutcome:
    """What came of a move: the task's own part of the state, events, rewards, the end."""

    state: Integers
    events: int
    rewards: Floats
    over: bool


@dataclass(frozen=True)
class SequentialStudy:
    """What was compared, whosever turn it is, and the properties that do not hold."""

    n_states: int
    n_moves: int  # states times agents times actions
    violations: tuple[SequentialViolation, ...]


def study_sequential(
    task: Task,
    starts: Iterable[Integers],
    idle: str = "none",
    sharing: Sharing = "team",
    limit: int = 10**5,
) -> SequentialStudy:
    """Checks Definition 10 for every agent and action in every state that can be reached.

    States are those that moves in turn or joint moves reach, with the turn given to the agent that
    acts: Definition 10 asks of all agents in all states.

    Args:
        task: a task whose agents move in turn, or jointly.
        starts: initial states.
        idle: name of the action that stands for none.
        sharing: whether R is the "team"'s, the worth of all that happened, counted once (Definition
            9 has one scalar for all), or what "each" agent gets, compared agent by agent.
        limit: largest number of states.

    Raises:
        InputError: a single agent, no such action, or more states than the limit.
    """
    if task.schedule != "turns":
        raise InputError("task", task.id, "one whose agents move in turn")
    check_choice("idle action", idle, task.action_names)
    states = _list_states(task, list(starts), limit)
    nothing = task.action_names.index(idle)
    counts: Counter[int] = Counter()
    first: dict[int, SequentialViolation] = {}
    for state in states:
        for agent in range(task.n_agents):
            for action in range(task.n_actions):
                alone = move_alone(task, state, agent, action, sharing)
                jointly = move_jointly(task, state, agent, action, nothing, sharing)
                for number in compare(alone, jointly):
                    counts[number] += 1
                    if number not in first:
                        made = _make_violation(task, number, state, agent, action, alone, jointly)
                        first[number] = made
    violations = tuple(replace(first[n], count=counts[n]) for n in PROPERTIES if n in first)
    return SequentialStudy(len(states), len(states) * task.n_agents * task.n_actions, violations)


def _list_states(task: Task, starts: list[Integers], limit: int) -> list[Integers]:
    """Returns the states that moves in turn or joint moves reach, all with the turn of agent 0."""
    seen: dict[bytes, Integers] = {}
    for enumerate_moves in (enumerate_turns, enumerate_joint):
        for state in enumerate_moves(task, starts, limit).states:
            plain = state.copy()
            plain[TURN] = 0
            seen.setdefault(plain.tobytes(), plain)
    return list(seen.values())


def move_alone(
    task: Task, state: Integers, agent: int, action: int, sharing: Sharing
) -> MoveOutcome:
    """Returns P(s, a_i, .) and R(s, a_i, .): the agent acts in its turn."""
    after = state.copy()
    after[TURN] = agent
    events = int(kernels.apply(task.kernel, after, agent, action))
    rewards = np.zeros(len(task.rewards))
    got = []
    for other in range(task.n_agents):
        kernels.compute_rewards(task.kernel, events, agent, other, rewards)
        got.append(rewards.sum())
    return _make_outcome(task, after, events, got, sharing)


def move_jointly(
    task: Task, state: Integers, agent: int, action: int, idle: int, sharing: Sharing
) -> MoveOutcome:
    """Returns **P**(s, a_i, .) and **R**(s, a_i, .): all others are idle."""
    after = state.copy()
    actions = np.full(task.n_agents, idle)
    actions[agent] = action
    charged = np.zeros(task.n_agents, np.int64)
    events = int(kernels.apply_joint(task.kernel, after, actions, charged))
    rewards = np.zeros(len(task.rewards))
    got = []
    for other in range(task.n_agents):
        kernels.compute_joint_rewards(task.kernel, charged, other, rewards)
        got.append(rewards.sum())
    return _make_outcome(task, after, events, got, sharing)


def _make_outcome(
    task: Task, after: Integers, events: int, got: list[float], sharing: Sharing
) -> MoveOutcome:
    if sharing == "team":
        worth = np.zeros(len(task.rewards))
        kernels.compute_rewards(task.kernel, events, 0, 0, worth)
        got = [worth.sum()]
    over = bool(kernels.is_over(task.kernel, events))
    return MoveOutcome(after, events, np.array(got), over)


def compare(alone: MoveOutcome, jointly: MoveOutcome) -> list[int]:
    """Returns the numbers of the properties in which two outcomes differ."""
    holds = {
        1: (alone.state[HEADER:] == jointly.state[HEADER:]).all(),
        2: np.abs(alone.rewards - jointly.rewards).max() <= TOLERANCE,
        3: alone.over == jointly.over,
    }
    return [number for number, same in holds.items() if not same]


def _make_violation(
    task: Task, number: int, state: Integers, agent: int, action: int, *outcomes: MoveOutcome
) -> SequentialViolation:
    shown = state.copy()
    shown[TURN] = agent
    names = task.agents[agent], task.action_names[action]
    texts = (_describe(task, outcome) for outcome in outcomes)
    return SequentialViolation(number, 1, describe_state(task, shown), *names, *texts)


def _describe(task: Task, outcome: MoveOutcome) -> str:
    rewards = ", ".join(f"{reward:g}" for reward in outcome.rewards)
    after = describe_state(task, outcome.state, outcome.events)
    return f"{after}; rewards {rewards}" + "; the end" * outcome.over
