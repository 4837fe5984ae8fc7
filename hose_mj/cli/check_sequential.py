"""`hose-mj check-sequential`: do moves in turn realize joint moves (Definition 10)?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from hose_mj.checks import Check
from hose_mj.cli.results import check_counts, finish
from hose_mj.cli.task_options import parse_options
from hose_mj.tasks.registry import make_task

if TYPE_CHECKING:
    from hose_learning.mdp.sequential_realization import SequentialStudy


@dataclass(frozen=True)
class Args:
    """Check that a task played in turns is a sequential realization of its joint moves.

    In every state that can be reached, for every agent and action: the joint action in which only
    that agent is not idle has to do what the action does alone. What differs is named with a
    witness: the state, the action, and what comes of both.
    """

    task: Annotated[str, tyro.conf.Positional]  # Id of the task.
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Options of the task."""
    idle: str = "none"  # The action that stands for none.
    sharing: Literal["team", "each"] = "team"  # Compare the team's reward, or what each agent gets.
    limit: int = 100_000  # Largest number of states.
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of the start, where it is random.


def run(args: Args) -> int:
    """Checks a task; 1 if a property does not hold."""
    import numpy as np
    from hose_learning.mdp.sequential_realization import PROPERTIES, study_sequential

    from hose_mj.tasks.stream import make_stream

    check_counts(args, seed=0)
    task = make_task(args.task, **parse_options(args.set))
    start = task.reset(make_stream(np.random.default_rng(args.seed)))
    study = study_sequential(task, [start], args.idle, args.sharing, args.limit)
    counts = {violation.number: violation.count for violation in study.violations}
    checks = [
        Check(f"property {number}: exceptions ({says})", counts.get(number, 0), 0, "==")
        for number, says in PROPERTIES.items()
    ]
    ending = f"{'not ' * bool(study.violations)}a sequential realization"
    show = partial(_summarize, study)
    return finish("check-sequential", args, checks, asdict(study), show, ending=ending)


def _summarize(study: SequentialStudy) -> None:
    print(f"{study.n_states:,} states, {study.n_moves:,} moves of single agents")
    for violation in study.violations:
        print(f"\n{violation}, first:")
        print(f"  {violation.state} -- {violation.agent}: {violation.action}")
        print(f"  alone:   {violation.alone}\n  jointly: {violation.jointly}")
