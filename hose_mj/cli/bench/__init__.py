"""Measures of speed, one file for each group of `hose-mj bench`, and what all groups share."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from hose_mj.checks import Check


@dataclass(frozen=True)
class Record:
    """One measured number.

    Attributes:
        group: the group it belongs to.
        name: what was measured; unique in its group.
        value: the number.
        unit: its unit.
        peer: what it is compared with, the name of another record; None without one.
        ratio: how many times faster than the peer; None without one.
    """

    group: str
    name: str
    value: float
    unit: str
    peer: str | None = None
    ratio: float | None = None


@dataclass
class Bench:
    """What a group measured."""

    records: list[Record] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)


def measure_rate(
    work: Callable[[], int],
    rounds: int,
    seconds: float,
    clock: Callable[[], float] = time.process_time,
) -> float:
    """Returns how many units of work are done a second: the best of several rounds.

    Args:
        work: does some units and returns how many; called once before the clock starts.
        rounds: how often to measure; other processes can only slow a round down.
        seconds: the least length of a round (s).
        clock: what tells the time (s). Processor time, for work on one core, leaves out the waiting
            for other processes; work on several cores wants `time.perf_counter`.
    """
    work()
    best = 0.0
    for _ in range(rounds):
        begun = clock()
        done, elapsed = 0, 0.0
        while elapsed < seconds:
            done += work()
            elapsed = clock() - begun
        best = max(best, done / elapsed)
    return best
