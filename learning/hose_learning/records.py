"""The two records that loops work on: `Learner`, which does not change, and `Memory`, which does.

`hose_learning.learner.make_learner` makes both from settings.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hose_learning.tables import Table
from hose_mj.tasks.kernels import Floats, Integers

EPSILON, TEMPERATURE, RETURN, XI = 0, 1, 2, 3
"""Places in `Memory.numbers`: exploration, soft-max temperature, rewards of this episode so far,
and the weight of the goal against the risk (`risk_q`)."""
N_NUMBERS = 4
MOVES, EPISODES, SUCCESSES, FRESH = 0, 1, 2, 3
"""Places in `Memory.counters`: moves of single agents, episodes ended, those with success, and
whether the state has to be reset before the next move."""
N_COUNTERS = 4
N_LOGGED = 2  # logged of an episode: its moves, and the events that it ended with


class Learner(NamedTuple):
    """What a learner is: its modules, mediator, policy and rule."""

    rule: Any  # record of the update rule, whose type selects the code (`hose_learning.rules`)
    # columns, strides, bases: what the value modules see (`hose_learning.modules.Arrays`).
    columns: Integers
    strides: Integers
    bases: Integers
    rewards: Floats  # theirs (2^n_events, 2, n_modules), see `modules.make_module_rewards`
    thresholds: Floats  # a module vetoes values below it; -inf for none (n_modules,)
    has_thresholds: bool  # whether any module has one
    # veto_columns, veto_strides, veto_bases: what the veto modules see.
    veto_columns: Integers
    veto_strides: Integers
    veto_bases: Integers
    # veto_events, veto_actions: the events that each answers to, the actions that it is about
    # (n_vetoes,).
    veto_events: Integers
    veto_actions: Integers
    shares_vetoes: bool  # whether an event vetoes the last move of every agent of the cycle
    return_of_event: Floats  # sum of all signals by events, each counted once (2^n_events,)
    # mediator, policy: numbers of `hose_learning.mediators` and `hose_learning.policies`.
    mediator: int
    policy: int
    fallback: int  # action where everything is vetoed, or -1 for any
    learning_rate: float  # alpha, and by how much it decays: alpha / (1 + decay moves)
    learning_rate_decay: float  # see there
    # per_episode, per_success: what epsilon falls by at the end of an episode, and if it succeeded.
    per_episode: float
    per_success: float
    least_epsilon: float  # what it does not fall below
    temperature_factor: float  # temperature of the soft max over epsilon


class Memory(NamedTuple):
    """What a learner has learned, and where it stands; all of it is saved with it."""

    table: Table  # Q-values of all value modules (rows of n_actions, or what the rule says)
    vetoes: Table  # vetoed actions as bits of all veto modules (rows of 1)
    state: Integers  # the task's state
    values: Integers  # the variables last observed (n_variables,)
    scores: Floats  # of the actions, what the choice goes by (n_actions,)
    # keys, veto_keys: what each agent's modules last saw (n_agents, n_modules).
    keys: Integers
    veto_keys: Integers
    # last_keys, last_veto_keys: what they saw at its last move.
    last_keys: Integers
    last_veto_keys: Integers
    actions: Integers  # each agent's last action (n_agents,)
    allowed: Integers  # what each agent may do, as bits (n_agents,)
    rewards: Floats  # what each agent's modules got since its last move (n_agents, n_modules)
    # Moves since each agent's last one; -1 before its first (n_agents,).
    steps_since_action: Integers
    caused_events: Integers  # events that each agent caused in a joint move (n_agents,)
    # numbers, counters: see the constants of this file.
    numbers: Floats
    counters: Integers
    event_counts: Integers  # how often each event has happened (n_events,)
    stream: npt.NDArray[np.uint64]  # random numbers of the choices (1,)
    starts: npt.NDArray[np.uint64]  # random numbers of the resets (1,)
    own: Any  # what the rule keeps beside, a NamedTuple of arrays


class Log(NamedTuple):
    """One row for each episode, filled from the front."""

    used: Integers  # number of rows written (1,)
    episodes: Integers  # moves and last events (capacity, N_LOGGED)
    returns: Floats  # sums of all rewards (capacity,)


def make_log(capacity: int) -> Log:
    """Makes an empty log for that many episodes."""
    episodes = np.zeros((capacity, N_LOGGED), np.int64)
    return Log(np.zeros(1, np.int64), episodes, np.zeros(capacity))
