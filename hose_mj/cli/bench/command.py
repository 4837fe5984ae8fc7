"""`hose-mj bench`: how fast the parts are, each beside a peer that people know."""

from __future__ import annotations

import importlib
import time
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated

import tyro

from hose_mj.cli.results import check_choice, check_counts, finish, print_table

if TYPE_CHECKING:
    from hose_mj.cli.bench import Bench

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
    quick: bool = False
    """Fewer and shorter rounds."""
    json: bool = False
    """Print one JSON document on stdout; messages go to stderr."""
    seed: int = 0
    """Seed of the actions and states."""


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
