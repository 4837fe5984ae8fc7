"""`hose-mj train`: a learner on a task, with a run folder that can be continued."""

from __future__ import annotations

import itertools
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.cli.progress import defer_interrupt, show_progress
from hose_mj.cli.results import check_counts, print_table
from hose_mj.cli.task_options import parse_options
from hose_mj.errors import check_choice
from hose_mj.extras import require
from hose_mj.recording.document import make_document, print_document
from hose_mj.tasks.registry import list_tasks, make_task

if TYPE_CHECKING:
    from hose_learning.settings import Exploration
    from hose_learning.study.run_folder import RunFolder
    from hose_learning.study.training import Episodes, Training

    from hose_mj.tasks.task import Task

DEFAULT_EPISODES = {"line": 100_000, "line-non-cooperative": 100_000, "line-2015": 20_000}
"""Where the default of 2,000 episodes is too few."""
SAVE_SECONDS = 60.0


@dataclass(frozen=True)
class LearnerArgs:
    """What every command that trains lets a user set about task and learner."""

    set: tuple[str, ...] = ()  # Options of the task, as n_robots=3 goal=(2,1).
    epsilon: float | None = None  # Share of random choices at the start.
    epsilon_per_episode: float | None = None
    """What epsilon falls by after each episode; by default it reaches 0 after half of them."""
    epsilon_per_success: float | None = None  # What epsilon falls by after each success.
    learning_rate: float | None = None  # Alpha.
    discount: float | None = None  # Gamma.
    values: str | None = None
    """What the value modules see: goal, local or monolithic; the default depends on the learner."""
    vetoes: str | None = None
    """What vetoes: none, modules, monolithic, thresholds or values; likewise."""


@dataclass(frozen=True)
class Args(LearnerArgs):
    """Train a learner on a task, test it greedily, and keep both in a run folder.

    A run that was stopped, by Ctrl-C or otherwise, goes on with --resume from its last checkpoint,
    exactly as if it had not been stopped.
    """

    task: Annotated[str, tyro.conf.Positional] = "line"
    """A task: line, taxi, corridor, maze, ... (--list names all)."""
    learner: str | None = None
    """A learner; by default thresholded-msav on the line tasks and d-rr-ql on the others."""
    list: bool = False  # List tasks and learners and stop.
    options: tuple[str, ...] = ()  # Options of the learner's own, as trace_decay=0.8.
    episodes: int | None = None
    """Episodes to train for, counted from the start of the run; the default depends on the task, or
    with --resume on what the run was to end after."""
    moves: int | None = None
    """Moves of single agents after which training ends, if that comes first."""
    tests: int = 200  # Greedy episodes after training.
    out: Path | None = None  # Run folder; by default a new one, out/train/TASK-LEARNER-seedN.
    resume: Path | None = None
    """Run folder to go on with; its settings replace all that describe a run."""
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of everything that is left to chance.


def run(args: Args) -> int:
    """Trains; 0 when done."""
    from hose_learning.presets import VALUES, VETOES

    from hose_mj.jit import compile_notice

    if args.list:
        _list(args)
        return 0
    check_counts(args, episodes=1, moves=1, tests=1, seed=0)
    if args.values is not None:
        check_choice("values", args.values, VALUES)
    if args.vetoes is not None:
        check_choice("vetoes", args.vetoes, VETOES)
    require("report", "hose-mj train")
    folder, training, seed, args = _resume(args) if args.resume else _begin(args)
    before = training.moves
    begun = time.perf_counter()
    with compile_notice("learner's kernels"):
        _compile(training)
    compiled = time.perf_counter()
    ended = _train(training, folder, args)
    seconds = time.perf_counter() - compiled
    tests = training.test(args.tests)
    summary = _summarize(training, folder, ended, tests)
    summary |= {"moves_per_s": (training.moves - before) / seconds if seconds > 0 else None}
    summary |= {"wall_s": time.perf_counter() - begun}
    folder.summarize(summary)
    if args.json:
        print_document(make_document("train", args, seed=seed, results=summary))
    else:
        _print(summary)
    return 0


def make_training(args: Args) -> Training:
    """Makes the training that the arguments describe, before its first move.

    Raises:
        InputError: an unknown task or learner, or a setting that it does not allow.
    """
    import numpy as np
    from hose_learning.learners import catalog
    from hose_learning.study.training import Training

    task = make_task(args.task, **parse_options(args.set))
    id = args.learner or ("thresholded-msav" if args.task.startswith("line") else "d-rr-ql")
    catalog.find_learner(id)
    settings = catalog.make_settings(
        id, task, args.values, args.vetoes, exploration=_explore(args, task), **_given(args)
    )
    return Training(task, id, settings, np.random.default_rng(args.seed))


def _begin(args: Args) -> tuple[RunFolder, Training, int, Args]:
    from hose_learning.study.run_folder import RunFolder

    training = make_training(args)
    name = f"{training.task.id}-{training.learner_id}-seed{args.seed}"
    folder = RunFolder(args.out or find_free(Path("out") / "train" / name))
    args = replace(args, episodes=_count_episodes(args, training.task))
    folder.create(training, args.seed, {"episodes": args.episodes, "moves": args.moves})
    return folder, training, args.seed, args


def find_free(path: Path) -> Path:
    """Returns the path, or the first of path-2, path-3, ... where nothing is yet."""
    names = (path.name if n == 1 else f"{path.name}-{n}" for n in itertools.count(1))
    return next(path.with_name(name) for name in names if not path.with_name(name).exists())


def _resume(args: Args) -> tuple[RunFolder, Training, int, Args]:
    """Opens a run that goes on to where it was to end, or to where it is told to now."""
    from hose_learning.study.run_folder import RunFolder

    assert args.resume is not None
    folder = RunFolder(args.resume)
    training, seed = folder.open()
    if args.episodes is None and args.moves is None:
        ends = folder.read_ends()
        args = replace(args, episodes=ends.get("episodes"), moves=ends.get("moves"))
    return folder, training, seed, args


def _given(args: Args) -> dict[str, Any]:
    given = {"learning_rate": args.learning_rate, "discount": args.discount}
    settings: dict[str, Any] = {k: v for k, v in given.items() if v is not None}
    if args.options:
        settings["options"] = parse_options(args.options)
    return settings


def _explore(args: Args, task: Task) -> Exploration:
    """Epsilon as asked for; else .3 throughout on random line tasks (4.6.1.2), and falling."""
    from hose_learning.settings import Exploration

    is_random = task.id.startswith("line") and task.settings.goal == "random"
    if is_random and args.epsilon_per_episode is None and args.epsilon_per_success is None:
        return Exploration(epsilon=0.3 if args.epsilon is None else args.epsilon)
    epsilon = 1.0 if args.epsilon is None else args.epsilon
    fall = args.epsilon_per_episode
    if fall is None:
        half = 2.0 * epsilon / _count_episodes(args, task)
        fall = 0.0 if args.epsilon_per_success else min(half, 1.0)
    success = args.epsilon_per_success or 0.0
    return Exploration(epsilon=epsilon, per_episode=fall, per_success=success)


def _count_episodes(args: Args, task: Task) -> int:
    return args.episodes or DEFAULT_EPISODES.get(task.id, 2_000)


def _compile(training: Training) -> None:
    """Runs the loop and the test once on a training of its own, so that compiling is not timed."""
    import numpy as np

    parts = (training.task, training.learner_id, training.settings)
    trial = type(training)(*parts, np.random.default_rng(0))
    trial.advance(moves=1)
    trial.test(1, max_moves=1)


def _train(training: Training, folder: RunFolder, args: Args) -> Episodes:
    """Trains to the end, with a progress bar and checkpoints; returns what ended meanwhile."""
    from hose_learning.study.training import join

    episodes = max(0, _count_episodes(args, training.task) - training.episodes)
    moves = None if args.moves is None else max(0, args.moves - training.moves)
    parts: list[Episodes] = []
    unsaved: list[Episodes] = []
    saved = time.monotonic()
    what = f"{training.learner_id} on {training.task.id}"
    with show_progress(what, episodes) as show, defer_interrupt() as is_interrupted:
        for ended in training.advance_in_chunks(moves, episodes):
            parts.append(ended)
            unsaved.append(ended)
            show(len(ended))
            if is_interrupted():
                break
            if time.monotonic() - saved > SAVE_SECONDS:
                folder.save(training, join(unsaved))
                unsaved, saved = [], time.monotonic()
        folder.save(training, join(unsaved))
        if is_interrupted():
            raise KeyboardInterrupt
    return join(parts)


def _summarize(
    training: Training, folder: RunFolder, ended: Episodes, tests: Episodes
) -> dict[str, Any]:
    from hose_learning.study.statistics import compute_rate_interval

    task = training.task
    last = ended.find_successes(task)[-max(1, len(ended) // 10) :]
    success = tests.find_successes(task)
    return {
        "run": str(folder.path),
        "task": task.id,
        "model": None,
        "learner": training.learner_id,
        "moves": training.moves,
        "episodes": training.episodes,
        "training_success_rate": float(last.mean()) if len(last) else None,
        "training_interval": compute_rate_interval(int(last.sum()), len(last)),
        "success_rate": float(success.mean()),
        "interval": compute_rate_interval(int(success.sum()), len(success)),
        "steps_mean": float(tests.moves[success].mean()) if success.any() else None,
        "breaks": ended.count_breaks(task),
        "test_breaks": tests.count_breaks(task),
    }


def _list(args: Args) -> None:
    from hose_learning.learners import catalog

    style: dict[str, Any] = {"box": None, "title_justify": "left", "show_header": False}
    tasks = [(id, "", entry.description) for id, entry in list_tasks().items()]
    learners = [(id, e.section, e.description) for id, e in catalog.list_learners().items()]
    if args.json:
        results = {
            "tasks": [{"name": id, "description": text} for id, _, text in tasks],
            "learners": [{"name": id, "description": text} for id, _, text in learners],
        }
        print_document(make_document("train", args, seed=args.seed, results=results))
        return
    print_table("Tasks", ("", "", ""), tasks, **style)
    print_table("Learners", ("", "", ""), learners, **style)


def _print(summary: dict[str, Any]) -> None:
    low, high = summary["interval"]
    breaks = ", ".join(f"{name} {count:,}" for name, count in summary["breaks"].items()) or "none"
    speed = summary["moves_per_s"]
    lines = [
        f"{summary['learner']} on {summary['task']}: {summary['episodes']:,} episodes, "
        f"{summary['moves']:,} moves, {summary['wall_s']:.1f} s"
        + ("" if speed is None else f" ({speed / 1e6:.2f} M moves/s)"),
        f"greedy tests: {100 * summary['success_rate']:.1f} % reach the goal "
        f"(95 %: {100 * low:.1f} to {100 * high:.1f})"
        + ("" if summary["steps_mean"] is None else f", {summary['steps_mean']:.1f} moves"),
    ]
    if summary["training_success_rate"] is not None:
        share = 100 * summary["training_success_rate"]
        lines.append(f"last tenth of the training: {share:.1f} % reached the goal")
    lines += [f"episodes that a broken constraint ended: {breaks}", f"run: {summary['run']}"]
    print("\n".join(lines), file=sys.stdout)
