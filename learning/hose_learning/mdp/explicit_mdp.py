"""Decision processes written out with their terminal states, as chapter 7 speaks of them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import HEADER, STEPS, TURN, Floats, Integers
from hose_mj.tasks.task import Task

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class MarkovModel:
    """A finite decision process <S, A, P, R> whose reward depends on the state that is entered.

    Raises:
        InputError: shapes that do not fit, or rows that are not distributions.
    """

    # P(s, a, s'), row s n_actions + a, (n_states n_actions, n_states); the rows of a terminal state
    # are empty.
    transitions: csr_array
    rewards: Floats  # R(s), received when s is entered (n_states,)
    terminal: Flags  # whether the episode ends there (n_states,)
    actions: tuple[str, ...]  # names of the actions
    names: tuple[str, ...]  # names of the states

    def __post_init__(self) -> None:
        n = self.n_states
        shapes = (self.transitions.shape, self.terminal.shape, len(self.names))
        wanted = ((n * self.n_actions, n), (n,), n)
        if shapes != wanted:
            raise InputError("shapes of the model", shapes, f"{wanted}")
        mass = self.transitions.sum(axis=1).reshape(n, self.n_actions)
        if self.transitions.nnz and self.transitions.data.min() < 0.0:
            raise InputError("transitions", self.transitions.data.min(), "probabilities")
        if not np.allclose(mass, ~self.terminal[:, None], atol=1e-9):
            raise InputError(
                "transitions", mass.tolist(), "rows of sum 1, and of sum 0 where terminal"
            )

    @property
    def n_states(self) -> int:
        """Number of states."""
        return len(self.rewards)

    @property
    def n_actions(self) -> int:
        """Number of actions."""
        return len(self.actions)


@dataclass(frozen=True, eq=False)
class WrittenTask:
    """A task as a decision process."""

    # The process. Its states are those of the task together with the events of the move that led
    # there, which is what rewards and ends depend on.
    model: MarkovModel
    states: Integers  # the task's states, step count 0 (n_states, state_size)
    events: Integers  # events of the move that led there (n_states,)
    numbers: dict[tuple[bytes, int], int]  # (state's bytes, events) to the number of the state


def write_out(task: Task, starts: Iterable[Integers], limit: int = 10**5) -> WrittenTask:
    """Writes a task out with all that agents moving in turn, or a single one, can reach.

    The reward of a state is what the mover feels, all signals added up: what the events are worth.
    No event led to `starts`. `InputError` is raised for more states than the limit.
    """
    states: list[Integers] = []
    events: list[int] = []
    numbers: dict[tuple[bytes, int], int] = {}

    def number(state: Integers, caused: int) -> int:
        state[STEPS] = 0
        key = (state.tobytes(), caused)
        if key not in numbers:
            if len(states) == limit:
                raise InputError("task", task.id, f"a task of at most {limit} states")
            numbers[key] = len(states)
            states.append(state)
            events.append(caused)
        return numbers[key]

    for start in starts:
        number(start.copy(), 0)
    rows, columns = [], []
    done = 0
    while done < len(states):
        if not kernels.is_over(task.kernel, events[done]):
            for action in range(task.n_actions):
                state = states[done].copy()
                caused = int(kernels.apply(task.kernel, state, int(state[TURN]), action))
                rows.append(done * task.n_actions + action)
                columns.append(number(state, caused))
        done += 1
    shape = (len(states) * task.n_actions, len(states))
    over = np.array([kernels.is_over(task.kernel, caused) for caused in events], bool)
    model = MarkovModel(
        transitions=csr_array((np.ones(len(rows)), (rows, columns)), shape=shape),
        rewards=np.array([compute_worth(task, caused) for caused in events]),
        terminal=over,
        actions=task.action_names,
        names=tuple(
            describe_state(task, state, caused)
            for state, caused in zip(states, events, strict=True)
        ),
    )
    return WrittenTask(model, np.array(states), np.array(events, np.int64), numbers)


def compute_worth(task: Task, events: int) -> float:
    """Returns what events are worth to the agent that caused them, all signals added up."""
    rewards = np.zeros(len(task.rewards))
    kernels.compute_rewards(task.kernel, events, 0, 0, rewards)
    return float(rewards.sum())


def describe_state(task: Task, state: Integers, events: int = 0) -> str:
    """Returns a state in words: whose turn, each part of the state, the events that led there."""
    parts = [f"{name} {state[place].tolist()}" for name, place in task.layout.items()]
    rest = set(range(HEADER, task.state_size))
    for place in task.layout.values():
        rest -= set(range(*place.indices(task.state_size)))
    parts += [f"rest {state[sorted(rest)].tolist()}"] * bool(rest)
    turn = [f"turn of {task.agents[int(state[TURN])]}"] * (task.n_agents > 1)
    return ", ".join([*turn, *parts, *task.name_events(events)])


def solve(model: MarkovModel, discount: float, tolerance: float = 1e-12) -> Floats:
    """Returns Q*(s, a) by value iteration (n_states, n_actions); 0 in terminal states.

    Q*(s, a) = sum_s' P(s, a, s') [R(s') + gamma max_a' Q*(s', a')]. `InputError` is raised for a
    discount outside [0, 1).
    """
    _check_discount(discount)
    q_values = np.zeros((model.n_states, model.n_actions))
    change = np.inf
    while change > tolerance:
        new = model.transitions @ (model.rewards + discount * q_values.max(axis=1))
        new = new.reshape(q_values.shape)
        change = float(np.abs(new - q_values).max())
        q_values = new
    return np.asarray(q_values)


def evaluate(
    model: MarkovModel, policy: Integers, discount: float, tolerance: float = 1e-12
) -> Floats:
    """Returns V of a deterministic policy (n_states,); 0 in terminal states.

    `policy` has an action for each state (n_states,); no value changes by more than `tolerance` in
    the last sweep. `InputError` is raised for a discount outside [0, 1).
    """
    _check_discount(discount)
    chosen = model.transitions[np.arange(model.n_states) * model.n_actions + policy]
    values = np.zeros(model.n_states)
    change = np.inf
    while change > tolerance:
        new = chosen @ (model.rewards + discount * values)
        change = float(np.abs(new - values).max())
        values = new
    return np.asarray(values)


def compute_safe_actions(model: MarkovModel) -> Flags:
    """Returns the effective action repertoires A^e (n_states, n_actions).

    An action is in A^e(s) if no state that it can lead to has a negative reward. A terminal state
    has no actions.
    """
    into_undesired = model.transitions @ (model.rewards < 0.0)
    safe = into_undesired.reshape(model.n_states, model.n_actions) == 0.0
    return np.asarray(safe & ~model.terminal[:, None])


def _check_discount(discount: float) -> None:
    if not 0.0 <= discount < 1.0:
        raise InputError("discount", discount, "a number from 0 up to, but not including, 1")
