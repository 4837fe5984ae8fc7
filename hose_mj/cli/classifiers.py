"""`hose-mj classifiers`: which classifier predicts undesired moves best (thesis, chapter 8)."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from hose_mj.cli.progress import show_progress
from hose_mj.cli.results import finish, make_folder
from hose_mj.recording.document import make_document

if TYPE_CHECKING:
    from hose_learning.prediction.offline import Study


@dataclass(frozen=True)
class Args:
    """Measure how well twelve classifiers predict the moves that break a constraint.

    The agents of a task act at random for a while; each classifier learns from a part of the log
    which moves were undesired, and is tested on the rest. For the taxi the numbers stand beside
    those of the thesis (Table 8.2).
    """

    task: Annotated[str, tyro.conf.Positional] = "taxi"  # Id of the task.
    cycles: int = 2002  # Moves of each agent in a log.
    logs: int = 8
    """Logs: the first is measured in full, the others once, to see how much logs differ."""
    repeats: int = 10  # How often the folds of the first log are drawn anew.
    folds: int = 10  # Parts of the log, each of which is tested on once in every repeat.
    action: Literal["integer", "one-hot"] = "integer"
    """The action as one attribute, its number, or as an attribute for each action."""
    cells: Literal["coordinates", "number"] = "coordinates"
    """A cell of a grid as row and column, or as one number."""
    clusters: Literal["matched", "majority"] = "matched"
    """Clusters become classes one to one, or each by the majority of its instances."""
    out: Path | None = None
    """Folder for the log, the records and a plot; nothing is written without it."""
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of the moves, the folds and the classifiers.


def run(args: Args) -> int:
    """Runs the experiment; 1 if a check failed."""
    from hose_learning.prediction.attributes import Encoding
    from hose_learning.prediction.offline import (
        OfflinePlan,
        count_folds,
        list_checks,
        list_records,
        run_study,
    )
    from hose_learning.prediction.report import print_study, write_study

    begun = time.perf_counter()
    if args.out is not None:
        make_folder(args.out)
    plan = OfflinePlan(
        task=args.task,
        cycles=args.cycles,
        logs=args.logs,
        repeats=args.repeats,
        folds=args.folds,
        encoding=Encoding(action=args.action, cells=args.cells),
        cluster_rule=args.clusters,
        seed=args.seed,
    )
    with show_progress("folds", count_folds(plan)) as advance:
        study = run_study(plan, partial(advance, 1))
    checks = list_checks(study)
    results = {"log": describe_log(study), "records": list_records(study)}
    if args.out is not None:
        document = make_document("classifiers", args, checks=checks, results=results)
        write_study(study, document, args.out)
    show = partial(print_study, study)
    return finish("classifiers", args, checks, results, show, begun=begun)


def describe_log(study: Study) -> list[dict[str, object]]:
    """Returns for each agent its number of moves and the share of undesired ones."""
    experience = study.experience
    return [
        {
            "agent": name,
            "moves": len(own := experience.select(agent)),
            "undesired_share": float(own.undesired.mean()),
        }
        for agent, name in enumerate(experience.agent_names)
    ]
