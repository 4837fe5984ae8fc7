"""Partially constrained models (thesis chapter 7): Definition 11 and what follows from it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from scipy.sparse import csr_array

from hose_learning.mdp import explicit_mdp
from hose_learning.mdp.explicit_mdp import MarkovModel, WrittenTask
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import TURN, Floats, Integers
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task

ABSENT = -1  # the projection of a target state that the source does not have
PROPERTIES = {
    1: "each target state projects onto a source state",
    2: "the transition probabilities are kept",
    3: "goal and transition states have the same reward",
    4: "undesired states are as bad in the source, or transition states there",
}
Reading = Literal["equal", "signs"]
TOLERANCE = 1e-9


@dataclass(frozen=True)
class PcmViolation:
    """A property of Definition 11 that does not hold."""

    number: int  # 1 to 4, a key of `PROPERTIES`
    count: int  # states, or states and actions, at which it does not
    state: int  # number of the first such target state
    action: int | None  # the action there; None where the property is about states
    source: str  # what the source says there, in words
    target: str  # what the target says there

    def __str__(self) -> str:
        return f"property {self.number} ({PROPERTIES[self.number]}) has exceptions: {self.count}"


def find_violations(
    source: MarkovModel, target: MarkovModel, projection: Integers, reading: Reading = "equal"
) -> list[PcmViolation]:
    """Checks Definition 11 in every state and action; no violation means: a PCM.

    Terminal states have no actions, so property 2 is asked of the target's other states. States
    that are not reached do not exist here, so property 1's S_t = S_s x S_Y is read as: dropping
    variables takes each target state to a source state. Y may be empty.

    Args:
        source: the source task.
        target: the target task, with the same actions.
        projection: [s], the source state of each target state, or `ABSENT` (n_target_states,).
        reading: how property 4 compares undesired states: their rewards are "equal", as printed, or
            only their "signs", as its sentence says (a move that breaks two constraints of which
            the source has one costs twice as much in the target).

    Raises:
        InputError: tasks of different actions, or a projection that does not fit them.
    """
    if source.actions != target.actions:
        raise InputError("actions of the target", target.actions, f"the source's, {source.actions}")
    if projection.shape != (target.n_states,):
        raise InputError("shape of the projection", projection.shape, f"({target.n_states},)")
    if projection.min() < ABSENT or projection.max() >= source.n_states:
        raise InputError("projection", projection.tolist(), f"-1 to {source.n_states - 1}")
    checks = (
        _check_states(target, projection),
        _check_transitions(source, target, projection),
        *_check_rewards(source, target, projection, reading),
    )
    return [violation for violation in checks if violation is not None]


def _check_states(target: MarkovModel, projection: Integers) -> PcmViolation | None:
    """Property 1."""
    lost = np.flatnonzero(projection == ABSENT)
    if len(lost) == 0:
        return None
    return PcmViolation(1, len(lost), int(lost[0]), None, "no such state", target.names[lost[0]])


def _check_transitions(
    source: MarkovModel, target: MarkovModel, projection: Integers
) -> PcmViolation | None:
    """Property 2: sum over [t] = [s'] of P_t(s, a, t) equals P_s([s], a, [s'])."""
    kept = np.flatnonzero(projection != ABSENT)
    shape = (target.n_states, source.n_states)
    onto = csr_array((np.ones(len(kept)), (kept, projection[kept])), shape=shape)
    asked = kept[~target.terminal[kept]]
    n_actions = target.n_actions
    actions = np.arange(n_actions)
    rows = (asked[:, None] * n_actions + actions).ravel()
    source_rows = (projection[asked][:, None] * n_actions + actions).ravel()
    # Rows that lead to a state which the source lacks are what property 1 is about.
    lost = (target.transitions[rows] @ (projection == ABSENT)) > 0.0
    difference = abs(target.transitions[rows] @ onto - source.transitions[source_rows])
    wrong = np.flatnonzero((difference.max(axis=1).toarray().ravel() > TOLERANCE) & ~lost)
    if len(wrong) == 0:
        return None
    state, action = divmod(int(rows[wrong[0]]), n_actions)
    move = describe_move(source, int(projection[state]), action)
    return PcmViolation(2, len(wrong), state, action, move, describe_move(target, state, action))


def _check_rewards(
    source: MarkovModel, target: MarkovModel, projection: Integers, reading: Reading
) -> Iterator[PcmViolation | None]:
    """Properties 3 and 4: R_t(s) against R_s([s])."""
    kept = projection != ABSENT
    in_source = np.where(kept, source.rewards[projection], 0.0)
    equal = np.abs(target.rewards - in_source) <= TOLERANCE
    undesired = target.rewards < 0.0
    as_bad = equal if reading == "equal" else in_source < 0.0
    for number, asked, holds in (
        (3, ~undesired, equal),
        (4, undesired, as_bad | (in_source == 0.0)),
    ):
        wrong = np.flatnonzero(kept & asked & ~holds)
        if len(wrong) == 0:
            yield None
            continue
        state = int(wrong[0])
        ours = f"{source.names[projection[state]]}: reward {in_source[state]:g}"
        theirs = f"{target.names[state]}: reward {target.rewards[state]:g}"
        yield PcmViolation(number, len(wrong), state, None, ours, theirs)


def describe_move(model: MarkovModel, state: int, action: int) -> str:
    """Returns a move in words: the state, the action, and where it leads with which probability."""
    row = model.transitions[[state * model.n_actions + action]]
    ends = [
        model.names[column] + ("" if p == 1.0 else f" with probability {p:g}")
        for column, p in zip(row.indices, row.data, strict=True)
    ]
    leads_to = " or ".join(ends) if ends else "the end of the episode, before this move"
    return f"{model.names[state]} -- {model.actions[action]} -> {leads_to}"


@dataclass(frozen=True, eq=False)
class Propositions:
    """What chapter 7 concludes, measured on one pair of tasks, in the target's n states."""

    # Actions that are safe in the target and not in the source; Proposition 4 says that there are
    # none.
    unsafe_in_source: int
    bounds: Floats  # max_a Q_s*([s], a) (n,)
    best: Floats  # V_t*(s) (n,)
    # V of the greedy policy among the target's safe actions, transferred by equations 7.1 and 7.2
    # (n,).
    greedy: Floats

    @property
    def excess(self) -> float:
        """Largest V_t*(s) - max_a Q_s*([s], a); the corrected Proposition 5: at most 0.

        It is so if a PCM's source is worth nothing less than 0 wherever the target's episode ends.
        """
        return float((self.best - self.bounds).max())

    @property
    def shortfall(self) -> float:
        """Largest V_t*(s) - V_t^g(s); 0 is what Proposition 5 as printed claims.

        It cannot be negative, as no policy has more than V_t*.
        """
        return float((self.best - self.greedy).max())

    @property
    def shortfall_state(self) -> int:
        """The target state of the largest shortfall."""
        return int((self.best - self.greedy).argmax())


def compute_propositions(
    source: MarkovModel, target: MarkovModel, projection: Integers, discount: float = 0.9
) -> Propositions:
    """Measures Propositions 4 and 5 on a pair of tasks; `projection` has no `ABSENT` state."""
    safe = explicit_mdp.compute_safe_actions(target)
    unsafe_in_source = safe & ~explicit_mdp.compute_safe_actions(source)[projection]
    transferred = explicit_mdp.solve(source, discount)[
        projection
    ]  # Q_t(s, a) = Q_s*([s], a), equation 7.1
    return Propositions(
        unsafe_in_source=int(unsafe_in_source.sum()),
        # Nothing follows on a terminal state of the target, whatever does in the source.
        bounds=np.where(target.terminal, 0.0, transferred.max(axis=1)),
        best=explicit_mdp.solve(target, discount).max(axis=1),
        greedy=explicit_mdp.evaluate(target, choose_greedy(transferred, safe), discount),
    )


def choose_greedy(q_values: Floats, allowed: np.ndarray) -> Integers:
    """Returns the best allowed action of each state, the first of equals; any if none is."""
    masked = np.where(allowed, q_values, -np.inf)
    return np.asarray(np.where(allowed.any(axis=1), masked.argmax(axis=1), q_values.argmax(axis=1)))


@dataclass(frozen=True)
class Pair:
    """Two tasks by their ids and options."""

    meaning: str  # a line about the pair
    source: str
    target: str
    settings: Mapping[str, Any] = field(default_factory=dict)  # of both
    source_settings: Mapping[str, Any] = field(default_factory=dict)
    target_settings: Mapping[str, Any] = field(default_factory=dict)
    violated: tuple[int, ...] = ()  # properties of Definition 11 that do not hold


_FLOOR = {"n_robots": 2, "hose_length": 20, "start": ((1, 1), (1, 0)), "goal": (2, 2)}
_HOSE = {"n_robots": 2, "hose_length": 4, "half_width": 3, "start": ((2, 0), (1, 0))}
PAIRS = {
    "wide-floor": Pair(
        "the source's floor is wider, so leaving it is noticed later",
        *("line", "line", _FLOOR, {"half_width": 3}, {"half_width": 2}),
    ),
    "hose-passes": Pair(
        "in the source only robots are in the way, in the target the hose too",
        *("line", "line", {**_HOSE, "goal": (3, 0)}, {"collision": "robots"}, {}),
    ),
    "narrow-source": Pair(
        "the target has cells that the source lacks or forbids",
        *("line", "line", _FLOOR, {"half_width": 2}, {"half_width": 3}, (1, 3)),
    ),
    "cancelled-moves": Pair(
        "the target cancels impossible moves, the source makes them",
        *("line", "line", {**_HOSE, "goal": (3, 0)}, {}, {"move_rule": "cancelling"}, (2,)),
    ),
    "dearer-goal": Pair(
        "the goal is worth more in the target",
        *("line", "line", {**_HOSE, "goal": (3, 0)}, {}, {"goal_reward": 200.0}, (3,)),
    ),
    "fewer-passengers": Pair(
        "the source's taxi is done while the target's second passenger waits",
        *("taxi", "taxi", {"starts": ((2, 2),)}, {"passengers": (("R", "B"),)}, {}, (1, 2, 3, 4)),
    ),
    "goal-under-the-hose": Pair(
        "as hose-passes, but the hose can lie on the goal: the source rewards a forbidden move",
        *("line", "line", {**_HOSE, "goal": (0, 1)}, {"collision": "robots"}, {}, (4,)),
    ),
}
"""Ready pairs: the first two are PCMs, the others each miss what `violated` says."""


@dataclass(frozen=True, eq=False)
class WrittenPair:
    """Two tasks written out, and [s], the source state of each target state (n_target_states,)."""

    source: WrittenTask
    target: WrittenTask
    projection: Integers


def make_tasks(pair: Pair) -> tuple[Task, Task]:
    """Makes source and target."""
    return (
        make_task(pair.source, **{**pair.settings, **pair.source_settings}),
        make_task(pair.target, **{**pair.settings, **pair.target_settings}),
    )


def write_pair(
    source: Task, target: Task, random: np.random.Generator, limit: int = 10**5
) -> WrittenPair:
    """Writes two tasks out from one start, drawn for the target.

    The source has the same agents and actions and the parts of the target's state, or fewer or
    shorter ones; `InputError` is raised if not, or for more states of a task than the limit.
    """
    for name, given, valid in (
        ("agents of the target", target.agents, source.agents),
        ("actions of the target", target.action_names, source.action_names),
    ):
        if given != valid:
            raise InputError(name, given, f"the source's, {valid}")
    sizes = {name: _measure(place) for name, place in target.layout.items()}
    for name, place in source.layout.items():
        if _measure(place) > sizes.get(name, 0):
            raise InputError(f"size of {name!r} in the source", _measure(place), "the target's")
    start = target.reset(make_stream(random))
    written_source = explicit_mdp.write_out(source, [project_state(source, target, start)], limit)
    written_target = explicit_mdp.write_out(target, [start], limit)
    return WrittenPair(
        written_source, written_target, _project_all(source, target, written_source, written_target)
    )


def _measure(place: slice) -> int:
    return int(place.stop - place.start)


def project_state(source: Task, target: Task, state: Integers) -> Integers:
    """Returns the source's state with the target state's turn and parts, the events left aside.

    Of a part that is longer in the target (two passengers, one in the source) the first are kept.
    """
    projected = source.make_state()
    projected[TURN] = state[TURN]
    for name, place in source.layout.items():
        projected[place] = state[target.layout[name]][: _measure(place)]
    return projected


def _project_all(
    source: Task, target: Task, written_source: WrittenTask, written_target: WrittenTask
) -> Integers:
    """Returns [s] of each target state.

    The events that led to a state are variables of it. Those that the source has in such a state
    are kept; where the source can only be there without them, they are among the variables removed.
    """
    projection = np.full(len(written_target.states), ABSENT)
    anywhere: dict[bytes, int] = {}
    for (place, _), number in written_source.numbers.items():
        anywhere.setdefault(place, number)
    bits = {name: 1 << bit for bit, name in enumerate(source.events)}
    for k, state in enumerate(written_target.states):
        key = project_state(source, target, state).tobytes()
        names = target.name_events(int(written_target.events[k]))
        known = sum(bits.get(name, 0) for name in names)
        found = (written_source.numbers.get((key, events)) for events in (known, 0))
        projection[k] = next((n for n in found if n is not None), anywhere.get(key, ABSENT))
    return projection
