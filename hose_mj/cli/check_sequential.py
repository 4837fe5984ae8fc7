"""`hose-mj check-sequential`: do moves in turn realize joint moves (Definition 10)?"""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from hose_mj.checks import Check
from hose_mj.cli.check_table import print_checks
from hose_mj.cli.task_options import read_options
from hose_mj.errors import InputError
from hose_mj.recording.document import make_document, print_document

if TYPE_CHECKING:
    from hose_learning.mdp.sequential_realization import SequentialStudy


@dataclass(frozen=True)
class Args:
    """Check that a task played in turns is a sequential realization of its joint moves.

    In every state that can be reached, for every agent and action: the joint action in which only
    that agent is not idle has to do what the action does alone. What differs is named with a
    witness: the state, the action, and what comes of both.
    """

    task: Annotated[str, tyro.conf.Positional]
    """Id of the task."""
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Options of the task."""
    idle: str = "none"
    """The action that stands for none."""
    sharing: Literal["team", "each"] = "team"
    """Compare the team's reward, or what each agent gets."""
    limit: int = 100_000
    """Largest number of states."""
    json: bool = False
    """Print one JSON document on stdout; messages go to stderr."""
    seed: int = 0
    """Seed of the start, where it is random."""


def run(args: Args) -> int:
    """Checks a task; 1 if a property does not hold."""
    import numpy as np
    from hose_learning.mdp.sequential_realization import PROPERTIES, study_sequential

    from hose_mj.tasks.registry import make_task
    from hose_mj.tasks.stream import make_stream

    if args.seed < 0:
        raise InputError("seed", args.seed, "a whole number, at least 0")
    task = make_task(args.task, **read_options(args.set)[""])
    start = task.reset(make_stream(np.random.default_rng(args.seed)))
    study = study_sequential(task, [start], args.idle, args.sharing, args.limit)
    counts = {violation.number: violation.count for violation in study.violations}
    checks = [
        Check(f"property {number}: exceptions ({says})", counts.get(number, 0), 0, "==")
        for number, says in PROPERTIES.items()
    ]
    if args.json:
        print_document(
            make_document("check-sequential", args, checks=checks, results=asdict(study))
        )
    else:
        _summarize(study)
        print_checks(checks)
    stream = sys.stderr if args.json else sys.stdout
    realizes = not study.violations
    print("a sequential realization" if realizes else "not a sequential realization", file=stream)
    return 0 if realizes else 1


def _summarize(study: SequentialStudy) -> None:
    print(f"{study.n_states:,} states, {study.n_moves:,} moves of single agents")
    for violation in study.violations:
        print(f"\n{violation}, first:")
        print(f"  {violation.state} -- {violation.agent}: {violation.action}")
        print(f"  alone:   {violation.alone}\n  jointly: {violation.jointly}")
