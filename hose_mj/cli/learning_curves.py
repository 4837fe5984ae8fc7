"""`hose-mj curves`: how learners get better at a task, as a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import tyro

from hose_mj.cli import train
from hose_mj.cli.progress import show_progress
from hose_mj.cli.results import check_counts
from hose_mj.cli.task_options import read_options
from hose_mj.errors import InputError
from hose_mj.recording.document import make_document, print_document
from hose_mj.recording.files import write_atomically

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from hose_learning.study.training import Episodes

    from hose_mj.recording.plots.curves import Panel
    from hose_mj.tasks.task import Task

Measured: TypeAlias = "npt.NDArray[np.float64]"


@dataclass(frozen=True)
class Measure:
    """What is drawn: its words, its axis, and its value for each of some episodes."""

    words: str
    scale: Literal["share", "log", "linear"]
    compute: Callable[[Task, Episodes], npt.NDArray[Any]]


MEASURES = {
    "success": Measure(
        "episodes that reach the goal", "share", lambda task, ended: ended.find_successes(task)
    ),
    "moves": Measure("moves per episode", "log", lambda task, ended: ended.moves),
    "return": Measure("rewards per episode", "linear", lambda task, ended: ended.returns),
}


@dataclass(frozen=True)
class Args(train.LearnerArgs):
    """Train learners on a task with several seeds and draw what their training episodes came to.

    A line is the mean over the seeds, in bins of as many episodes each; the band around it goes
    from the lowest seed to the highest. All learners get the same seeds and settings; options that
    are not given are those of `hose-mj train`.
    """

    task: Annotated[str, tyro.conf.Positional] = "line"  # A task (hose-mj train --list names all).
    learners: tuple[str, ...] = ("d-rr-ql",)  # The learners to compare.
    measures: tuple[str, ...] = ("success",)  # What to draw, a panel each: success, moves, return.
    options: tuple[str, ...] = ()
    """Options of the learners' own: trace_decay=0.8 for all, usap.classifier=forest for one."""
    episodes: int = 2_000  # Episodes of each training.
    bins: int = 50  # Points of each line.
    seeds: int = 5  # Trainings of each learner.
    title: str | None = None  # Above the picture; by default the task and its options.
    save: Path = Path("out/curves.png")  # The picture (PNG).
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # The first seed; the others follow it.


def run(args: Args) -> int:
    """Trains and draws; 0 when done."""
    import numpy as np

    from hose_mj.recording.plots.curves import plot_learning

    check_arguments(args)
    measured: dict[str, list[dict[str, Measured]]] = {id: [] for id in args.learners}
    with show_progress(f"{args.task}", args.seeds * len(args.learners)) as show:
        for id, runs in measured.items():
            for seed in range(args.seed, args.seed + args.seeds):
                runs.append(measure(args, id, seed))
                show(1)
    x = np.arange(1, args.bins + 1, dtype=np.float64) * (args.episodes / args.bins)
    panels = [make_panel(name, x, measured) for name in args.measures]
    title = args.title or ", ".join([args.task, *args.set])
    write_atomically(args.save, plot_learning(title, "episodes", panels))
    records = list_records(args.measures, panels)
    results: dict[str, Any] = {"picture": str(args.save), "curves": records}
    if args.json:
        print_document(make_document("curves", args, seed=args.seed, results=results))
    else:
        for record in records:
            last = "nothing" if record["mean"][-1] is None else f"{record['mean'][-1]:.3g}"
            print(f"{record['learner']}: {record['measure']} {last} in the last bin")
        print(f"picture: {args.save}")
    return 0


def check_arguments(args: Args) -> None:
    """Raises `InputError` for a number or a name outside its valid set."""
    from hose_learning.learners import catalog

    check_counts(args, episodes=1, bins=1, seeds=1, seed=0)
    if args.bins > args.episodes:
        raise InputError("bins", args.bins, f"at most one for each of {args.episodes} episodes")
    for name, given, known in (
        ("learners", args.learners, list(catalog.list_learners())),
        ("measures", args.measures, list(MEASURES)),
    ):
        valid = "different names out of " + ", ".join(known)
        if not given or len(set(given)) < len(given) or not set(given) <= set(known):
            raise InputError(name, given, valid)
    read_options(args.options, args.learners)


def measure(args: Args, learner: str, seed: int) -> dict[str, Measured]:
    """Trains once; returns the mean of each measure in each bin (bins,)."""
    import numpy as np

    from hose_mj.jit import compile_notice

    given = {field.name: getattr(args, field.name) for field in fields(train.LearnerArgs)}
    # Its own options, without its name, and those that name none.
    ours = (word.removeprefix(f"{learner}.") for word in args.options)
    own = tuple(word for word in ours if "." not in word.partition("=")[0])
    given |= {"task": args.task, "learner": learner, "options": own}
    training = train.make_training(train.Args(**given, episodes=args.episodes, seed=seed))
    with compile_notice("learner's kernels"):
        training.advance(moves=0)
    ended = training.advance(episodes=args.episodes)
    values = (MEASURES[name].compute(training.task, ended) for name in args.measures)
    parts = (np.array_split(np.asarray(value, float), args.bins) for value in values)
    means = (np.array([part.mean() for part in split]) for split in parts)
    return dict(zip(args.measures, means, strict=True))


def make_panel(name: str, x: Measured, measured: dict[str, list[dict[str, Measured]]]) -> Panel:
    """Makes the panel of one measure: means over the seeds, from the lowest to the highest."""
    import numpy as np

    from hose_mj.recording.plots.curves import Curve, Panel

    curves = {}
    for learner, runs in measured.items():
        values = np.stack([run[name] for run in runs])  # (seeds, bins)
        curves[learner] = Curve(x, values.mean(axis=0), values.min(axis=0), values.max(axis=0))
    return Panel(MEASURES[name].words, curves, MEASURES[name].scale)


def list_records(measures: Sequence[str], panels: Sequence[Panel]) -> list[dict[str, Any]]:
    """Lists what was drawn as plain values, one record for each line."""
    import numpy as np

    return [
        {
            "measure": name,
            "learner": learner,
            "episodes": np.asarray(curve.x).tolist(),
            "mean": np.asarray(curve.middle).tolist(),
            "low": np.asarray(curve.low).tolist(),
            "high": np.asarray(curve.high).tolist(),
        }
        for name, panel in zip(measures, panels, strict=True)
        for learner, curve in panel.curves.items()
    ]
