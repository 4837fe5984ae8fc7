"""Jobs: single training runs as data, done by several processes and kept by their hash.

What a job gives depends on nothing but the job, so the order of the workers does not matter.
"""

import dataclasses
import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hose_learning.learners import catalog
from hose_learning.settings import Exploration
from hose_learning.study.training import Manner, Training
from hose_mj.recording.files import write_atomically
from hose_mj.tasks.registry import make_task


@dataclass(frozen=True)
class Measures:
    """What section 6.6 measures. A step is a move in turns, or a joint move (footnote 2)."""

    n_g: int | None  # training steps until an episode first reaches the goal, or None
    n_f: int | None  # training steps until a greedy test first does, or None
    s_f: int | None  # steps of that test, or None
    s_b: int | None  # steps of the best test, or None
    steps: int  # training steps in all
    n_tests: int  # number of tests
    n_valid: int  # how many of them reached the goal


def measure(
    training: Training,
    max_steps: int,
    max_episodes: int | None = None,
    test_every: int = 100,
    manner: Manner | None = None,
) -> Measures:
    """Trains, tests the greedy policy after every so many episodes, and measures.

    The training begins with its first move; a step is a move in turns, or a joint move.
    `max_episodes` is no bound by default, and the agents' manner in a test is joint.
    """
    task = training.task
    joint = training.entry.schedule == "joint"
    if manner is None:
        manner = "joint" if joint else "composed"
    per_step = task.n_agents if joint else 1
    per_test_step = 1 if manner == "turns" else task.n_agents
    n_g = n_f = s_f = s_b = None
    n_tests = n_valid = 0
    left = max_episodes
    while training.moves < max_steps * per_step and left != 0:
        before = training.moves
        chunk = test_every if left is None else min(test_every, left)
        ended = training.advance(max_steps * per_step - before, chunk)
        left = None if left is None else left - len(ended)
        if n_g is None and ended.find_successes(task).any():
            first = int(np.argmax(ended.find_successes(task)))
            n_g = int(before + ended.moves[: first + 1].sum()) // per_step
        test = training.test(1, manner=manner)
        n_tests += 1
        if test.find_successes(task)[0]:
            n_valid += 1
            steps = int(test.moves[0]) // per_test_step
            if n_f is None:
                n_f, s_f = training.moves // per_step, steps
            s_b = steps if s_b is None else min(s_b, steps)
    return Measures(n_g, n_f, s_f, s_b, training.moves // per_step, n_tests, n_valid)


VERSION = 1  # raised when the same job would give something else than before
Result = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Job:
    """One training run."""

    name: str  # what it is a run of; runs of one name differ in seed or configuration alone
    task: str  # id of the task
    options: Mapping[str, Any] = field(default_factory=dict)  # the task's options
    learner: str  # id of the learner
    # Arguments of `catalog.make_settings`; those of `Exploration` under "exploration".
    settings: Mapping[str, Any] = field(default_factory=dict)
    seed: int  # seeds everything that is left to chance
    episodes: int | None = None  # most episodes
    steps: int | None = None  # most training steps (`measures.measure`)
    test_every: int = 0  # episodes between two greedy tests; 0 tests once, at the end

    @property
    def identity(self) -> str:
        """Returns a hash of all that the job is."""
        text = json.dumps([VERSION, dataclasses.asdict(self)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


def make_training(job: Job) -> Training:
    """Makes the training that a job describes, before its first move."""
    task = make_task(job.task, **job.options)
    settings = dict(job.settings)
    if "exploration" in settings:
        settings["exploration"] = Exploration(**settings["exploration"])
    made = catalog.make_settings(job.learner, task, **settings)
    return Training(task, job.learner, made, np.random.default_rng(job.seed))


def do(job: Job) -> Result:
    """Does a job.

    Returns:
        With `test_every`, the fields of `Measures`. Without, `success_rate` of the last tenth of
        the episodes, the `test_success` and `test_moves` of a greedy test at the end, and `moves`.
    """
    training = make_training(job)
    if job.test_every:
        most = 2**62 if job.steps is None else job.steps
        return dataclasses.asdict(measure(training, most, job.episodes, job.test_every))
    ended = training.advance(moves=job.steps, episodes=job.episodes)
    last = ended.find_successes(training.task)[-max(1, len(ended) // 10) :]
    test = training.test(1)
    return {
        "success_rate": float(last.mean()),
        "test_success": bool(test.find_successes(training.task)[0]),
        "test_moves": int(test.moves[0]),
        "moves": training.moves,
    }


def do_all(
    jobs: Sequence[Job],
    n_workers: int,
    folder: Path | None = None,
    done: Callable[[int], None] = lambda amount: None,
) -> list[Result]:
    """Does jobs in several processes and returns their results in the order of the jobs.

    With one worker this process does them. Results are kept in `folder`, one file each, and found
    again; None keeps nothing. `done` is called with 1 for each job that is done.
    """
    results: dict[str, Result] = {}
    for job in jobs:
        kept = _find(job, folder)
        if kept is not None:
            results[job.identity] = kept
            done(1)
    missing = list({j.identity: j for j in jobs if j.identity not in results}.values())
    for job, result in _work(missing, n_workers):
        results[job.identity] = result
        if folder is not None:
            kept = {"job": dataclasses.asdict(job), "result": result}
            write_atomically(_place(job, folder), json.dumps(kept, indent=1).encode())
        done(1)
    return [results[job.identity] for job in jobs]


def _work(jobs: Sequence[Job], n_workers: int) -> Iterator[tuple[Job, Result]]:
    if n_workers <= 1 or len(jobs) <= 1:
        yield from ((job, do(job)) for job in jobs)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(n_workers, mp_context=context) as pool:
        futures = {pool.submit(do, job): job for job in jobs}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            for future in futures:
                future.cancel()


def _place(job: Job, folder: Path) -> Path:
    return folder / f"{job.identity}.json"


def _find(job: Job, folder: Path | None) -> Result | None:
    """Returns a result that was kept, or None; a damaged file counts as none."""
    if folder is None or not _place(job, folder).is_file():
        return None
    try:
        result = json.loads(_place(job, folder).read_bytes())["result"]
    except (ValueError, KeyError, TypeError):
        return None
    return result if isinstance(result, dict) else None
