"""`hose-mj relevance`: which state variables matter for which constraint (Algorithm 5.1)."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.checks import Check
from hose_mj.cli.results import check_counts, finish, print_table
from hose_mj.cli.task_options import parse_options
from hose_mj.tasks.registry import make_task

if TYPE_CHECKING:
    from hose_learning.relevance import Relevance

WIDEST = 6  # most signals that stand side by side


@dataclass(frozen=True)
class Args:
    """Log random moves, and find which state variables matter for which broken constraint.

    What matters is what a veto module has to see. A log can be too short to show it: so the
    variables found are checked against a fresh log, in which they must tell every event.
    """

    task: Annotated[str, tyro.conf.Positional]  # Id of the task.
    moves: int = 10_000  # Random moves of single agents to log.
    set: tuple[str, ...] = ()  # Options of the task, as n_robots=3 goal=(2,1).
    variables: tuple[str, ...] = ()
    """Variables to test; by default all but the copies of an agent's own."""
    pooled: bool = False
    """Compare moves of different agents too, as if their vetoes shared one table."""
    logs: int = 1
    """Logs, each with a seed of its own; with several the matrix shows how many agree."""
    fresh: int = 100_000  # Moves of the log that the first log's result is checked against.
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of the moves.


def run(args: Args) -> int:
    """Runs the algorithm; 1 if a fresh log contradicts what it found."""
    import numpy as np
    from hose_learning import relevance
    from hose_learning.experience import record_experience

    check_counts(args, moves=1, logs=1, fresh=1, seed=0)
    begun = time.perf_counter()
    task = make_task(args.task, **parse_options(args.set))
    signals = relevance.list_signals(task)
    *generators, last = np.random.default_rng(args.seed).spawn(args.logs + 1)
    logs = [record_experience(task, args.moves, generator) for generator in generators]
    variables = args.variables or relevance.list_candidates(task, logs[0])
    found = [relevance.find_relevance(log, signals, variables, args.pooled) for log in logs]
    fresh = record_experience(task, args.fresh, last)
    untold = {s.name: relevance.count_unexplained(found[0], s, fresh, args.pooled) for s in signals}
    what = "moves of a fresh log that are not told"
    checks = [Check(f"{name}: {what}", number, 0, "==") for name, number in untold.items()]
    title = f"{args.task}, {args.moves:,} random moves"
    show = partial(_print, found, title)
    return finish("relevance", args, checks, _list(found), show, begun=begun)


def _list(found: list[Relevance]) -> dict[str, Any]:
    """The signals, what matters for them in the first log, and in which share of all logs."""
    import numpy as np

    first = found[0]
    share = np.mean([each.relevant for each in found], axis=0)
    return {
        "variables": first.variables,
        "signals": [
            {
                "name": signal.name,
                "event": signal.event,
                "actions": signal.actions,
                "seen": int(first.n_seen[place]),
                "relevant": first.list_relevant(signal),
                "share_of_logs": dict(zip(first.variables, share[:, place], strict=True)),
                "most_common": _find_most_common(found, place),
            }
            for place, signal in enumerate(first.signals)
        ],
    }


def _find_most_common(found: list[Relevance], place: int) -> dict[str, Any]:
    """The variables that most logs agree on for a signal, and how many do."""
    signal = found[0].signals[place]
    sets = Counter(each.list_relevant(signal) for each in found)
    relevant, logs = sets.most_common(1)[0]
    return {"relevant": relevant, "logs": logs}


def _print(found: list[Relevance], title: str) -> None:
    """Prints variables by signals, or a row for each signal where there are many."""
    first = found[0]
    title += f", {len(found)} logs" if len(found) > 1 else ""
    if len(first.signals) > WIDEST:
        many = zip(first.signals, first.n_seen.tolist(), strict=True)
        rows = [(s.name, ", ".join(first.list_relevant(s)), f"{n_seen:,}") for s, n_seen in many]
        print_table(title, ("signal", "variables that matter", "moves with it"), rows)
    else:
        _print_matrix(found, title)
    for place, signal in enumerate(first.signals if len(found) > 1 else ()):
        most = _find_most_common(found, place)
        print(f"{signal.name}: {', '.join(most['relevant'])} in {most['logs']} of {len(found)}")


def _print_matrix(found: list[Relevance], title: str) -> None:
    """Prints variables by signals: a checkmark, or in how many logs one matters."""
    import numpy as np
    from rich.console import Console
    from rich.table import Table

    first, n_logs = found[0], len(found)
    table = Table("variable", title=title)
    for signal in first.signals:
        table.add_column(signal.name, justify="center")
    counts = np.sum([each.relevant for each in found], axis=0)
    for variable, row in zip(first.variables, counts.tolist(), strict=True):
        texts = ("✓" if n_logs == 1 else f"{count} of {n_logs}" for count in row)
        cells = (text if count else "" for text, count in zip(texts, row, strict=True))
        table.add_row(variable, *cells)
    table.add_section()
    table.add_row("moves with it", *(f"{int(n):,}" for n in first.n_seen))
    Console().print(table)
