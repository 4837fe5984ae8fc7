"""`hose-mj transfer`: what is learned on one task as a start on another one (chapter 7)."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.checks import Check
from hose_mj.cli.progress import show_progress
from hose_mj.cli.results import check_counts, finish, print_table
from hose_mj.cli.task_options import read_options
from hose_mj.errors import InputError

if TYPE_CHECKING:
    from hose_learning.transfer import TransferOutcome


@dataclass(frozen=True)
class Args:
    """Train on a source task, go on with greedy episodes on a target task, and compare.

    The target sees all that the source sees, and may see more and forbid more. Each configuration
    is learned anew; line tasks get a random start and goal each, the same for both. The control
    explores the target from scratch for the same cost.
    """

    source: Annotated[str, tyro.conf.Positional]  # Id of the task to learn on first.
    target: Annotated[str, tyro.conf.Positional]  # Id of the task that it is for.
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Options of both tasks, or of one: source.NAME=VALUE, target.NAME=VALUE."""
    moves: int = 300_000  # Moves of single agents on the source.
    episodes: int = 3  # Greedy learning episodes on the target.
    configurations: int = 30  # How often all this is done.
    values: str = "goal"
    """What the goal modules see: goal (on a line, all robots' formation), local or monolithic."""
    exchange: tuple[float, ...] = (390_000.0, 1.0)
    """What a move on the target costs, in moves on the source; the thesis's, and equal cost."""
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of all that is left to chance.


def run(args: Args) -> int:
    """Runs all configurations; 1 if a veto was lost or the first control did better."""
    check_counts(args, moves=1, episodes=1, configurations=1, seed=0)
    if not args.exchange or min(args.exchange) <= 0.0:
        raise InputError("exchange", args.exchange, "numbers above 0, at least one")
    begun = time.perf_counter()
    outcomes = _run_all(args)
    rows = summarize(outcomes, args.exchange)
    ahead = rows[args.episodes]["reached"] - rows[-len(args.exchange)]["reached"]
    checks = [
        Check("transferred vetoes that were lost", sum(o.vetoes_lost for o in outcomes), 0, "=="),
        Check("goals after transfer, less the first control's", ahead, 0, ">="),
    ]
    results = {"summary": rows, "outcomes": [asdict(outcome) for outcome in outcomes]}
    show = partial(_print, args, outcomes, rows)
    return finish("transfer", args, checks, results, show, begun=begun)


def _run_all(args: Args) -> list[TransferOutcome]:
    """Runs one configuration after the other, each with a generator of its own."""
    import numpy as np
    from hose_learning.transfer import TransferPlan, run_trial

    from hose_mj.jit import compile_notice

    options = read_options(args.set, ("source", "target"))
    plan = TransferPlan(
        source=args.source,
        target=args.target,
        source_options=options[""] | options["source"],
        target_options=options[""] | options["target"],
        moves=args.moves,
        episodes=args.episodes,
        exchange=args.exchange,
        values=args.values,
    )
    with compile_notice("learner's kernels"):  # a short trial has everything compiled
        run_trial(replace(plan, moves=1), np.random.default_rng(0))
    outcomes = []
    with show_progress("configurations", args.configurations) as advance:
        for generator in np.random.default_rng(args.seed).spawn(args.configurations):
            outcomes.append(run_trial(plan, generator))
            advance(1)
    return outcomes


def summarize(outcomes: list[TransferOutcome], exchange: tuple[float, ...]) -> list[dict[str, Any]]:
    """Counts the configurations whose goal was reached, in all ways there are, with intervals.

    One row for each greedy episode (the goal was reached in it for the first time), one for any of
    them, one for the greedy policy on the source, one for each control.
    """
    from hose_learning.study.statistics import compute_rate_interval

    def first(outcome: TransferOutcome) -> int | None:
        return outcome.reached.index(True) if any(outcome.reached) else None

    n_episodes = max(len(outcome.reached) for outcome in outcomes)
    found: list[tuple[str, list[bool]]] = [
        (f"after transfer, first in episode {k + 1}", [first(o) == k for o in outcomes])
        for k in range(n_episodes)
    ]
    found.append(("after transfer, in any of them", [any(o.reached) for o in outcomes]))
    found.append(("greedy on the source", [o.source_reached for o in outcomes]))
    for k, rate in enumerate(exchange):
        name = f"exploring, at rate {rate:,.6g}"
        found.append((name, [o.controls[k][1] for o in outcomes]))
    rows = []
    for name, which in found:
        interval = compute_rate_interval(sum(which), len(which))
        rows.append({"what": name, "reached": sum(which), "of": len(which), "interval": interval})
    return rows


def _print(args: Args, outcomes: list[TransferOutcome], rows: list[dict[str, Any]]) -> None:
    title = f"{args.source} to {args.target}: {', '.join(outcomes[0].modules)}"
    cells = [
        (row["what"], f"{row['reached']} of {row['of']}", f"{100 * low:.0f} to {100 * high:.0f} %")
        for row in rows
        for low, high in (row["interval"],)
    ]
    print_table(title, ("goal reached", ">configurations", ">95 % interval"), cells)
    new = sum(o.vetoes_after - o.vetoes_before for o in outcomes)
    kept = sum(o.vetoes_before for o in outcomes)
    print(f"vetoes: {kept:,} transferred, {new:,} added on the target")
