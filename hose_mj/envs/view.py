"""`View`: the variables that are observed, as a Gymnasium space and as values in it."""

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from gymnasium import spaces

from hose_mj.envs import kernels
from hose_mj.envs.episode import check_names
from hose_mj.errors import InputError, check_choice
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task
from hose_mj.tasks.variables import LARGEST_SIZE, Variable

Form = Literal["array", "dict", "index"]
FORMS = get_args(Form)


class View:
    """What one agent sees, or what all see together.

    A variable that is the same for all agents stands once, before those of each agent.

    Args:
        task: whose variables they are.
        observe: names of the variables to show, in this order; None for all.
        form: "array" (MultiDiscrete), "dict" (Dict of Discrete by name) or "index" (one Discrete,
            mixed-radix with the last variable running fastest).
        agents: through whose eyes.

    Attributes:
        names: what each entry is called; "robot_0.o_up" for a variable of one among several agents.
        cardinalities: entry k lies in 0 .. cardinalities[k] - 1 (n_seen,).
        sight: the same for compiled code.

    Raises:
        InputError: an unknown or doubled variable, none at all, an unknown form, or an index beyond
            2^62.
    """

    def __init__(
        self, task: Task, observe: Sequence[str] | None, form: Form, agents: Sequence[int]
    ) -> None:
        known = {variable.name: variable for variable in task.variables}
        if observe is not None:
            check_names("observe", observe, tuple(known))
        check_choice("form", form, FORMS)
        chosen = [known[name] for name in (known if observe is None else observe)]
        entries = list_entries(chosen, agents)
        self.names = tuple(
            f"{task.agents[agent]}.{variable.name}"
            if variable.per_agent and len(agents) > 1
            else variable.name
            for agent, variable in entries
        )
        self.cardinalities = np.array([variable.cardinality for _, variable in entries], np.int64)
        seers = np.array([agent for agent, _ in entries], np.int64)
        columns = np.array([task.variables.index(variable) for _, variable in entries], np.int64)
        self.sight = kernels.Sight(seers, columns)
        self._values = np.zeros(len(task.variables), np.int64)
        self.form = form
        self._strides = np.ones(len(entries), np.int64)
        if form == "index":
            self._strides = self._make_strides(observe)

    def look(self, record: Any, state: Integers) -> Integers:
        """Returns the values seen in a state, a new array (n_seen,)."""
        seen = np.empty(len(self.names), np.int64)
        look = kernels.choose(kernels.look, record)
        look(record, state, self.sight, self._values, seen)
        return seen

    def make_space(self) -> spaces.Space[Any]:
        """Makes the space of the observations."""
        if self.form == "array":
            return spaces.MultiDiscrete(self.cardinalities)
        if self.form == "index":
            return spaces.Discrete(int(np.prod(self.cardinalities)))
        pairs = zip(self.names, self.cardinalities, strict=True)
        # A mapping would be sorted by name, a sequence of pairs keeps its order.
        return spaces.Dict([(name, spaces.Discrete(int(count))) for name, count in pairs])

    def make_agent_space(self) -> spaces.Space[Any]:
        """Makes the space for PettingZoo, whose tests want a Box for an array."""
        if self.form != "array":
            return self.make_space()
        high = np.maximum(self.cardinalities - 1, 1)
        return spaces.Box(np.zeros_like(high), high, dtype=np.int64)

    def shape(self, seen: Integers) -> Any:
        """Returns the observation made of the values seen (..., n_seen), of one state or many."""
        if self.form == "array":
            return seen
        if self.form == "index":
            return seen @ self._strides
        return dict(zip(self.names, seen.T, strict=True))

    def _make_strides(self, observe: Sequence[str] | None) -> Integers:
        size = float(np.prod(self.cardinalities.astype(float)))
        if size > LARGEST_SIZE:
            raise InputError("observe", observe, f"fewer variables: {size:.1e} states exceed 2^62")
        behind = np.append(self.cardinalities[1:], 1)
        return np.cumprod(behind[::-1])[::-1].copy()


def list_entries(chosen: Sequence[Variable], agents: Sequence[int]) -> list[tuple[int, Variable]]:
    """Lists who sees what: for several agents what they share first, seen by the first of them."""
    if len(agents) == 1:
        return [(agents[0], variable) for variable in chosen]
    shared = [(agents[0], variable) for variable in chosen if not variable.per_agent]
    own = [variable for variable in chosen if variable.per_agent]
    return shared + [(agent, variable) for agent in agents for variable in own]
