"""`hose-mj reproduce`: the thesis's experiments over seeds, beside what the thesis says."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.checks import Check
from hose_mj.cli.progress import show_progress
from hose_mj.cli.results import check_counts
from hose_mj.errors import check_choice
from hose_mj.recording.document import make_document, print_document

if TYPE_CHECKING:
    from hose_learning.study.experiments import Experiment, Finding


@dataclass(frozen=True)
class Args:
    """Repeat experiments of the thesis over several seeds, with intervals.

    Every run is kept in OUT by the hash of its settings, so that a command that was stopped goes
    on where it was, and one with more seeds does only what is new.
    """

    items: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """fig-4.2, fig-5.3, table-6.3, fig-6.4; all of them by default."""
    seeds: int = 10  # How many seeds, counted from --seed.
    quick: bool = False  # Two seeds.
    workers: int | None = None  # Processes; as many as there are cores by default.
    out: Path = Path("out/reproduce")  # Where the runs are kept.
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # The first seed.


def run(args: Args) -> int:
    """Runs the experiments; 1 if a check failed."""
    from hose_learning.study.experiments import EXPERIMENTS
    from hose_learning.study.jobs import do_all

    for item in args.items:
        check_choice("item", item, EXPERIMENTS)
    check_counts(args, seeds=1, seed=0, workers=1)
    begun = time.perf_counter()
    seeds = range(args.seed, args.seed + (2 if args.quick else args.seeds))
    found: list[tuple[str, Experiment, list[Finding]]] = []
    for item in args.items or EXPERIMENTS:
        experiment = EXPERIMENTS[item]
        jobs = experiment.list_jobs(seeds)
        with show_progress(item, len(jobs)) as done:
            results = do_all(jobs, args.workers or os.cpu_count() or 1, args.out / "runs", done)
        runs: dict[str, list[dict[str, Any]]] = {}
        for job, result in zip(jobs, results, strict=True):
            runs.setdefault(job.name, []).append(result)
        findings = experiment.conclude(runs, len(seeds))
        found.append((item, experiment, findings))
        if not args.json:
            _print(item, experiment, findings)
    checks = [f.check for _, _, findings in found for f in findings if f.check is not None]
    if args.json:
        items = [_record(item, e, f) for item, e, findings in found for f in findings]
        print_document(make_document("reproduce", args, checks=checks, results={"items": items}))
    passed = sum(check.ok for check in checks)
    seconds = time.perf_counter() - begun
    stream = sys.stderr if args.json else sys.stdout
    print(f"{passed} of {len(checks)} checks ok, {seconds:.0f} s", file=stream)
    return 0 if passed == len(checks) else 1


def _record(item: str, experiment: Experiment, finding: Finding) -> dict[str, Any]:
    return {
        "item": item,
        "claim": finding.claim,
        "thesis": finding.thesis,
        "ours": finding.ours,
        "interval": finding.interval,
        "n_seeds": finding.n_seeds,
        "verdict": _judge(finding.check),
        "reading": experiment.reading,
    }


def _judge(check: Check | None) -> str:
    if check is None:
        return "reported"
    return "holds" if check.ok else "fails"


def _print(item: str, experiment: Experiment, findings: list[Finding]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{item}: {experiment.title}", title_justify="left")
    for name in ("what", "thesis", "ours", "95 %", "", "limit"):
        table.add_column(name, justify="right" if name in ("ours", "95 %", "limit") else "left")
    for finding in findings:
        low, high = finding.interval
        check = finding.check
        mark = {"holds": "[green]ok[/]", "fails": "[red]fails[/]"}.get(_judge(check), "")
        limit = "" if check is None else f"{check.comparison} {check.limit:g}"
        numbers = (f"{finding.ours:.3g}", f"{low:.3g} to {high:.3g}")
        table.add_row(finding.claim, finding.thesis, *numbers, mark, limit)
    console = Console(width=None if sys.stdout.isatty() else 150)
    console.print(table)
    console.print(f"[dim]{experiment.reading}[/]")
