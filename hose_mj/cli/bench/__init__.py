"""`hose-mj bench`: how fast the parts are, each beside a peer that people know.

One file for each group, and here what all share.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Annotated

import tyro

from hose_mj.checks import Check
from hose_mj.cli.results import check_counts, finish, print_table
from hose_mj.errors import check_choice

GROUPS = {
    "env": "hose_mj.cli.bench.env",
    "hose": "hose_mj.cli.bench.hose",
    "learn": "hose_mj.cli.bench.learn",
    "world": "hose_mj.cli.bench.world",
}
"""The groups, each a module with a function `measure(quick, seed) -> Bench`."""


@dataclass(frozen=True)
class Args:
    """Measure speed: tasks and environments (env), hoses (hose), learners (learn), worlds (world).

    Every number is the best of several rounds on this machine, after compilation, in seconds of the
    processor where one core works and of the wall clock where several do.
    """

    group: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="{env,hose,learn,world}")]
    """What to measure."""
    quick: bool = False  # Fewer and shorter rounds.
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of the actions and states.


@dataclass(frozen=True)
class Record:
    """One measured number."""

    group: str  # the group it belongs to
    name: str  # what was measured; unique in its group
    value: float  # the number
    unit: str  # its unit
    # What it is compared with, the name of another record; None without one.
    peer: str | None = None
    ratio: float | None = None  # how many times faster than the peer; None without one


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


def run(args: Args) -> int:
    """Runs a group; 1 if a check failed."""
    check_choice("group", args.group, GROUPS)
    check_counts(args, seed=0)
    begun = time.perf_counter()
    bench: Bench = importlib.import_module(GROUPS[args.group]).measure(args.quick, args.seed)
    results = {"records": [asdict(record) for record in bench.records]}
    return finish("bench", args, bench.checks, results, partial(_summarize, bench), begun=begun)


def _summarize(bench: Bench) -> None:
    rows = [
        (
            *(record.name, f"{record.value:,.4g}", record.unit),
            *("" if record.ratio is None else f"{record.ratio:,.3g}", record.peer or ""),
        )
        for record in bench.records
    ]
    columns = ("what", ">value", "unit", ">times its peer", "peer")
    print_table("Speed on this machine", columns, rows)
