"""`Task`: a grid or physics task as data, with the record that selects its compiled functions."""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import HEADER, Floats, Integers, Projection
from hose_mj.tasks.stream import Stream
from hose_mj.tasks.variables import Variable, make_projection

Schedule = Literal["turns", "single"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """A task: names for everything, and the record of its rules.

    The rules themselves are the functions of `hose_mj.tasks.kernels`, called with `kernel`.
    """

    id: str  # its name in the registry
    agents: tuple[str, ...]  # names of the agents, in the order of their turns
    action_names: tuple[str, ...]  # actions of each agent, by number
    # State variables, in the order in which `kernels.observe` writes them.
    variables: tuple[Variable, ...]
    # Names of the reward signals, in the order of `kernels.compute_rewards`.
    rewards: tuple[str, ...]
    events: tuple[str, ...]  # names of the events; event k is bit k of an event set
    settings: Any  # the frozen dataclass of all options that the task was made with
    kernel: Any  # the record whose type selects the code; its fields are listed in `kernels`
    layout: Mapping[str, slice]  # the parts of the state after its header, by name
    state_size: int  # length of the state
    # "turns" (the agents move one after the other, or jointly) or "single".
    schedule: Schedule = "turns"

    @property
    def n_agents(self) -> int:
        """Number of agents."""
        return len(self.agents)

    @property
    def n_actions(self) -> int:
        """Number of actions of each agent."""
        return len(self.action_names)

    @property
    def step_limit(self) -> int:
        """Moves of single agents after which an episode is cut off."""
        return int(self.kernel.step_limit)

    def name_events(self, events: int) -> tuple[str, ...]:
        """Returns the names of the events in a set."""
        return tuple(name for bit, name in enumerate(self.events) if events >> bit & 1)

    def make_state(self) -> Integers:
        """Makes a state of zeros, to be written by a reset."""
        return np.zeros(self.state_size, np.int64)

    def reset(self, stream: Stream) -> Integers:
        """Makes an initial state."""
        state = self.make_state()
        kernels.reset(self.kernel, state, stream)
        return state

    def observe(self, state: Integers, agent: int) -> Integers:
        """Returns the values of all variables as the agent sees them (n_variables,)."""
        values = np.zeros(len(self.variables), np.int64)
        kernels.observe(self.kernel, state, agent, values)
        return values

    def make_projection(self, names: Iterable[str]) -> Projection:
        """Makes the projection onto the named variables; `InputError` for a wrong name."""
        return make_projection(self.variables, names)


def compose_task(
    record: Callable[..., Any],
    *,
    rewards: Mapping[str, Mapping[str, float]],
    sizes: Mapping[str, int],
    terminal: Collection[str],
    violations: Collection[str],
    success: Collection[str],
    shared: Collection[str],
    **names: Any,
) -> Task:
    """Makes a task and its record, the fields that every record has from names.

    Args:
        record: the NamedTuple with its own fields given (`functools.partial`).
        rewards: for each signal, what each event is worth, see `make_reward_table`.
        sizes: lengths of the parts of the state after its header, in order.
        terminal: the events that end an episode.
        violations: the events that break a constraint.
        success: the events that mean that the task is done.
        shared: the events that every agent is rewarded for.
        names: the other fields of the `Task`; its settings have a `step_limit`.
    """
    events = names["events"]
    layout, end = {}, HEADER
    for name, size in sizes.items():
        layout[name] = slice(end, end + size)
        end += size
    sets = {"terminal": terminal, "violations": violations, "success": success, "shared": shared}
    kernel = record(
        n_agents=len(names["agents"]),
        n_actions=len(names["action_names"]),
        step_limit=names["settings"].step_limit,
        reward_table=make_reward_table(events, rewards),
        **{kind: sum(1 << events.index(name) for name in chosen) for kind, chosen in sets.items()},
    )
    return Task(rewards=tuple(rewards), kernel=kernel, layout=layout, state_size=end, **names)


def make_reward_table(
    events: tuple[str, ...], rewards: Mapping[str, Mapping[str, float]]
) -> Floats:
    """Makes the reward of every set of events, by signal (2^n_events, n_signals).

    `rewards` has for each signal what an event (bit 0 first) is worth, 0 if it is not named; the
    reward of a set is the sum over its events.
    """
    values = np.array([[signal.get(name, 0.0) for signal in rewards.values()] for name in events])
    sets = np.array([bits[::-1] for bits in product((0.0, 1.0), repeat=len(events))])
    return np.ascontiguousarray(sets @ values)
