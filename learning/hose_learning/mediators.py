"""Mediators: one score for each action from the Q-values of several modules (section 3.5.1)."""

import math

from hose_learning.records import Learner, Memory
from hose_learning.tables import find
from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats

GREATEST_MASS, BEST_HAPPINESS, WORST_UNHAPPINESS = 0, 1, 2
MEDIATORS = {
    "greatest-mass": GREATEST_MASS,
    "collective-happiness": GREATEST_MASS,
    "best-happiness": BEST_HAPPINESS,
    "worst-unhappiness": WORST_UNHAPPINESS,
}
"""By name. Collective happiness is the sum of what all modules expect: the greatest mass."""


@jitable
def compute_highest(rows: Floats, row: int) -> float:
    """Returns the highest value of a row."""
    highest = rows[row, 0]
    for k in range(1, rows.shape[1]):
        highest = max(highest, rows[row, k])
    return highest


@jitable
def mediate(learner: Learner, memory: Memory, agent: int) -> None:
    """Writes the score of each action in the state that the agent's modules see."""
    scores, table = memory.scores, memory.table
    if learner.mediator == GREATEST_MASS:
        scores[:] = 0.0
    else:
        scores[:] = -math.inf
    for module in range(learner.bases.shape[0]):
        row = find(table, memory.keys[agent, module])
        if learner.mediator == GREATEST_MASS:
            # eq. 3.7: arg max_a sum_i Q_i(s_i, a).
            for action in range(scores.shape[0]):
                scores[action] += table.rows[row, action]
        elif learner.mediator == BEST_HAPPINESS:
            # arg max_a max_i Q_i(s_i, a).
            for action in range(scores.shape[0]):
                scores[action] = max(scores[action], table.rows[row, action])
        else:
            # arg min_a max_i (max_b Q_i(s_i, b) - Q_i(s_i, a)); scores hold the loss meanwhile.
            highest = compute_highest(table.rows, row)
            for action in range(scores.shape[0]):
                scores[action] = max(scores[action], highest - table.rows[row, action])
    if learner.mediator == WORST_UNHAPPINESS:
        for action in range(scores.shape[0]):
            scores[action] = -scores[action]


@jitable
def compute_above_thresholds(learner: Learner, memory: Memory, agent: int, n_actions: int) -> int:
    """Returns, as bits, the actions that no module values below its threshold (Definition 4)."""
    above = 0
    for action in range(n_actions):
        above |= 1 << action
    for module in range(learner.bases.shape[0]):
        row = find(memory.table, memory.keys[agent, module])
        for action in range(n_actions):
            if memory.table.rows[row, action] < learner.thresholds[module]:
                above &= ~(1 << action)
    return above
