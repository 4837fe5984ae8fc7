"""What all references have: Python's integers as random numbers, turns, the state as an array."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hose_mj.tasks.kernels import Integers

_MASK = 2**64 - 1


class ReferenceStream:
    """splitmix64 (Steele, Lea and Flood 2014) and Lemire's bounded integers (2019).

    Args:
        seed: the first state.
    """

    def __init__(self, seed: int) -> None:
        self.state = seed

    def draw_bits(self) -> int:
        """Draws 64 bits."""
        self.state = (self.state + 0x9E3779B97F4A7C15) & _MASK
        bits = self.state
        bits = (bits ^ bits >> 30) * 0xBF58476D1CE4E5B9 & _MASK
        bits = (bits ^ bits >> 27) * 0x94D049BB133111EB & _MASK
        return bits ^ bits >> 31

    def draw_below(self, count: int) -> int:
        """Draws an integer from 0 .. count - 1."""
        while True:
            whole, fraction = divmod((self.draw_bits() >> 32) * count, 2**32)
            if fraction >= 2**32 % count:
                return whole


class Reference:
    """Turns and steps, and the state as the kernels hold it."""

    n_agents: int
    turn = 0
    steps = 0

    def list_state(self) -> Sequence[int]:
        """Lists the task's own part of the state."""
        raise NotImplementedError

    def as_array(self) -> Integers:
        """Returns the state as the kernels hold it."""
        return np.array([self.turn, self.steps, *self.list_state()], np.int64)

    def begin(self) -> None:
        """Begins an episode."""
        self.turn = self.steps = 0

    def end_turn(self, agent: int) -> None:
        """Hands the turn to the next agent."""
        self.turn = (agent + 1) % self.n_agents
        self.steps += 1

    def end_joint(self) -> None:
        """Counts a move of every agent."""
        self.turn = 0
        self.steps += self.n_agents
