"""Small tasks written out state by state and solved by value iteration: the truth for tests."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import NOT_FOUND, STEPS, TOO_MANY, TURN, Floats, Integers
from hose_mj.tasks.task import Task

OVER = -1  # the successor of a move that ends the episode


@dataclass(frozen=True)
class Model:
    """A task written out. The step limit plays no part in it."""

    states: Integers  # the states that can be reached, step count 0 (n_states, state_size)
    successors: Integers  # index of the next state, or `OVER` (n_states, n_actions)
    events: Integers  # events of each move (n_states, n_actions)
    rewards: Floats  # what each agent gets, all signals added up (n_states, n_actions, n_agents)

    @property
    def turns(self) -> Integers:
        """Returns the agent to move in each state (n_states,)."""
        return self.states[:, TURN]

    def find(self, state: Integers) -> int:
        """Returns the index of a state, whatever its step count.

        Raises:
            InputError: a state that cannot be reached.
        """
        same = (self.states[:, STEPS + 1 :] == state[STEPS + 1 :]).all(axis=1)
        places = np.flatnonzero(same & (self.states[:, TURN] == state[TURN]))
        if len(places) == 0:
            raise InputError("state", state.tolist(), "one that can be reached from the starts")
        return int(places[0])


def enumerate_turns(task: Task, starts: Iterable[Integers], limit: int = 10**6) -> Model:
    """Writes out what agents that move in turn, or a single one, can reach from the starts.

    `InputError` is raised for more states than the limit.
    """
    rewards = np.zeros(len(task.rewards))

    def play(state: Integers, action: int) -> tuple[int, list[float]]:
        mover = int(state[TURN])
        events = kernels.apply(task.kernel, state, mover, action)
        got = []
        for agent in range(task.n_agents):
            kernels.compute_rewards(task.kernel, events, mover, agent, rewards)
            got.append(float(rewards.sum()))
        return events, got

    return _enumerate(task, starts, limit, task.n_actions, play)


def enumerate_joint(task: Task, starts: Iterable[Integers], limit: int = 10**6) -> Model:
    """Writes out what agents that move at once can reach.

    Joint actions are numbered as `itertools.product` lists them, the last agent's running fastest.
    Arguments and errors are those of `enumerate_turns`.
    """
    joint_actions = np.array(list(product(range(task.n_actions), repeat=task.n_agents)), np.int64)
    rewards = np.zeros(len(task.rewards))
    caused_events = np.zeros(task.n_agents, np.int64)

    def play(state: Integers, action: int) -> tuple[int, list[float]]:
        events = kernels.apply_joint(task.kernel, state, joint_actions[action], caused_events)
        got = []
        for agent in range(task.n_agents):
            kernels.compute_joint_rewards(task.kernel, caused_events, agent, rewards)
            got.append(float(rewards.sum()))
        return events, got

    return _enumerate(task, starts, limit, len(joint_actions), play)


def _enumerate(
    task: Task,
    starts: Iterable[Integers],
    limit: int,
    n_actions: int,
    play: Callable[[Integers, int], tuple[int, list[float]]],
) -> Model:
    """Follows every action from every state met; `play` moves a state and tells what came of it."""
    states: list[Integers] = []
    numbers: dict[bytes, int] = {}

    def number(state: Integers) -> int:
        state[STEPS] = 0
        key = state.tobytes()
        if key not in numbers:
            if len(states) == limit:
                raise InputError("task", task.id, f"a task of at most {limit} states")
            numbers[key] = len(states)
            states.append(state)
        return numbers[key]

    for start in starts:
        number(start.copy())
    successors, all_events, all_rewards = [], [], []
    done = 0
    while done < len(states):
        for action in range(n_actions):
            state = states[done].copy()
            events, rewards = play(state, action)
            is_over = kernels.is_over(task.kernel, events)
            successors.append(OVER if is_over else number(state))
            all_events.append(events)
            all_rewards.append(rewards)
        done += 1
    shape = (len(states), n_actions)
    return Model(
        states=np.array(states),
        successors=np.array(successors, np.int64).reshape(shape),
        events=np.array(all_events, np.int64).reshape(shape),
        rewards=np.array(all_rewards).reshape(*shape, task.n_agents),
    )


def solve(
    model: Model, rewards: npt.ArrayLike, discount: npt.ArrayLike, tolerance: float = 1e-12
) -> Floats:
    """Returns the optimal state-action values (n_states, n_actions) by value iteration.

    Args:
        model: the task; with turns it is one decision problem whose state knows who moves.
        rewards: of each move (n_states, n_actions), as one slice of `model.rewards` or their sum.
        discount: of what follows a move; one number, or one for each state (n_states,).
        tolerance: largest change of a value in the last sweep.
    """
    rewards = np.asarray(rewards, float)
    factors = np.broadcast_to(np.asarray(discount, float), len(model.states))[:, None]
    goes_on = model.successors != OVER
    q_values = np.zeros_like(rewards)
    change = np.inf
    while change > tolerance:
        following = np.where(goes_on, q_values.max(axis=1)[model.successors], 0.0)
        new = rewards + factors * following
        change = float(np.abs(new - q_values).max())
        q_values = new
    return q_values


def find_shortest(task: Task, state: Integers, limit: int = 4_000_000) -> int | None:
    """Returns the fewest moves of single agents, in turns, from a state to the goal, or None.

    The task is compiled and without chance; the state's turn counts, the step limit plays no part.
    `InputError` is raised for more states than the limit.
    """
    width = len(state)
    slots = 1 << int(np.ceil(np.log2(2 * limit)))
    states = np.zeros((limit, width), np.int16)
    moves = kernels.search(
        task.kernel, state.copy(), states, np.full(slots, -1, np.int32), np.zeros(width, np.int64)
    )
    if moves == TOO_MANY:
        raise InputError("task", task.id, f"one that {limit} states are enough for")
    return None if moves == NOT_FOUND else int(moves)
