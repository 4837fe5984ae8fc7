"""`hose-mj bench`: how fast the parts are, each beside a peer that people know."""

from __future__ import annotations

import importlib
import sys
import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from hose_mj.cli.check_table import print_checks
from hose_mj.errors import InputError
from hose_mj.recording.document import make_document, print_document

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
    if args.group not in GROUPS:
        raise InputError("group", args.group, f"one of {', '.join(GROUPS)}")
    if args.seed < 0:
        raise InputError("seed", args.seed, "a whole number, at least 0")
    begun = time.perf_counter()
    bench: Bench = importlib.import_module(GROUPS[args.group]).measure(args.quick, args.seed)
    if args.json:
        results = {"records": [asdict(record) for record in bench.records]}
        print_document(make_document("bench", args, checks=bench.checks, results=results))
    else:
        _summarize(bench)
    passed = sum(check.ok for check in bench.checks)
    seconds = time.perf_counter() - begun
    stream = sys.stderr if args.json else sys.stdout
    print(f"{passed} of {len(bench.checks)} checks ok, {seconds:.0f} s", file=stream)
    return 0 if passed == len(bench.checks) else 1


def _summarize(bench: Bench) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    table = Table(title="Speed on this machine")
    for name in ("what", "value", "unit", "times its peer", "peer"):
        table.add_column(name, justify="right" if name in ("value", "times its peer") else "left")
    for record in bench.records:
        ratio = "" if record.ratio is None else f"{record.ratio:,.3g}"
        table.add_row(record.name, f"{record.value:,.4g}", record.unit, ratio, record.peer or "")
    console.print(table)
    print_checks(bench.checks)
