"""How an action is chosen among those that are allowed, given as bits of one integer."""

import math

from hose_mj.jit import jitable
from hose_mj.tasks.kernels import Floats
from hose_mj.tasks.stream import Stream, draw_below, draw_unit

GREEDY, SOFT_MAX = 0, 1  # epsilon-greedy (eq. 3.6) and soft max (eq. 3.5)


@jitable
def count_allowed(allowed: int) -> int:
    """Returns how many actions are allowed."""
    count = 0
    while allowed:
        allowed &= allowed - 1
        count += 1
    return count


@jitable
def find_allowed(allowed: int, number: int) -> int:
    """Returns the allowed action of that number, counted from 0."""
    for _ in range(number):
        allowed &= allowed - 1
    action = 0
    while allowed >> action & 1 == 0:
        action += 1
    return action


@jitable
def find_lowest_bit(bits: int) -> int:
    """Returns the first of some actions given as bits."""
    return find_allowed(bits, 0)


@jitable
def draw_allowed(allowed: int, stream: Stream) -> int:
    """Draws an allowed action, all equally likely."""
    count = count_allowed(allowed)
    return find_allowed(allowed, draw_below(stream, count) if count > 1 else 0)


@jitable
def compute_best(scores: Floats, allowed: int) -> int:
    """Returns, as bits, the allowed actions with the highest score (n_actions,).

    All of them where no score is a number, as after rewards beyond the range of floats.
    """
    best = 0
    highest = -math.inf
    for action in range(scores.shape[0]):
        if allowed >> action & 1:
            if scores[action] > highest:
                highest = scores[action]
                best = 0
            if scores[action] == highest:
                best |= 1 << action
    return best if best else allowed


@jitable
def draw_soft_max(scores: Floats, allowed: int, temperature: float, stream: Stream) -> int:
    """Draws an allowed action with probability proportional to exp(score / temperature)."""
    highest = -math.inf
    for action in range(scores.shape[0]):
        if allowed >> action & 1:
            highest = max(highest, scores[action])
    total = 0.0
    for action in range(scores.shape[0]):
        if allowed >> action & 1:
            scores[action] = math.exp((scores[action] - highest) / temperature)
            total += scores[action]
    left = draw_unit(stream) * total
    chosen = find_allowed(allowed, count_allowed(allowed) - 1)
    for action in range(scores.shape[0]):
        if allowed >> action & 1:
            left -= scores[action]
            if left < 0.0:
                return action
    return chosen
