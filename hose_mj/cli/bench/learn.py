"""The group `learn`: training with vetoes, beside the same source as plain Python."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from hose_learning.learners import catalog
from hose_learning.settings import Exploration
from hose_learning.study.training import Training

from hose_mj.checks import Check
from hose_mj.cli.bench import Bench, Record, measure_rate
from hose_mj.tasks.registry import make_task

PEER = "D-RR-QL, N = 3, its source as plain Python"
LEAST_MOVES = {2: 3e6, 3: 3e6, 4: 2e6, 6: 1e6}
LEAST_RATIO, MOST_SECONDS = 100.0, 10.0
"""Limits: moves/s by number of robots, times faster than plain Python, seconds for 1e7 moves."""
MAIN = 3
TEST_EVERY = 100
BLOCK = 200  # episodes that are timed at once, their tests included
PLAIN_MOVES = 20_000
_STARTS = {
    2: (((3, 2), (2, 0)), (5, 5)),
    3: (((3, 2), (2, 0), (1, 0)), (4, 6)),
    4: (((3, 2), (2, 1), (2, 0), (1, 0)), (4, 6)),
    6: (((3, 2), (2, 2), (2, 1), (1, 1), (1, 0), (0, 1)), (4, 5)),
}
"""First cells, the tip's first, and the goal."""


def measure(quick: bool, seed: int) -> Bench:
    """Times D-RR-QL with its goal module and three veto modules on the line task."""
    rounds, seconds = (3, 0.3) if quick else (7, 1.0)
    bench = Bench()
    # The same source where nothing at all is compiled.
    plain = _run_child("time_plain", seed, NUMBA_DISABLE_JIT="1")
    bench.records.append(Record("learn", PEER, plain, "moves/s"))
    for n_robots, least in LEAST_MOVES.items():
        moves = measure_rate(train_in_blocks(n_robots, seed), rounds, seconds)
        name = f"D-RR-QL, N = {n_robots}, exploration and tests"
        bench.records.append(Record("learn", name, moves, "moves/s", PEER, moves / plain))
        bench.checks.append(Check(f"{name}: moves/s", moves, least, ">="))
        if n_robots == MAIN:
            name = f"N = {MAIN}: times its own source as plain Python"
            bench.checks.append(Check(name, moves / plain, LEAST_RATIO, ">="))
    taken = _time_ten_million(seed)
    bench.records.append(Record("learn", f"1e7 moves, N = {MAIN}", taken, "s"))
    bench.checks.append(Check(f"1e7 moves, N = {MAIN}: seconds", taken, MOST_SECONDS, "<="))
    compiled = _run_child("count_compilations", seed)
    name = "functions that a second process compiles"
    bench.checks.append(Check(name, compiled, 0, "<="))
    return bench


def make_training(n_robots: int, seed: int) -> Training:
    """Makes D-RR-QL as chapter 6 has it, exploring until it has found the goal 1,000 times."""
    start, goal = _STARTS[n_robots]
    task = make_task("line", n_robots=n_robots, start=start, goal=goal)
    settings = catalog.make_settings("d-rr-ql", task, exploration=Exploration(per_success=1e-3))
    return Training(task, "d-rr-ql", settings, np.random.default_rng(seed))


def train_in_blocks(n_robots: int, seed: int) -> Callable[[], int]:
    """Returns work that trains, tests the composed policy, and tells the number of moves."""
    training = make_training(n_robots, seed)

    def work() -> int:
        before = training.moves
        for _ in range(BLOCK // TEST_EVERY):
            training.advance(episodes=TEST_EVERY)
            training.test(1, manner="composed")
        return training.moves - before

    return work


def _time_ten_million(seed: int) -> float:
    training = make_training(MAIN, seed)
    training.advance(moves=1000)
    begun = time.process_time()
    training.advance(moves=10_000_000)
    return time.process_time() - begun


def _run_child(function: str, seed: int, **environment: str) -> float:
    command = [sys.executable, "-m", "hose_mj.cli.bench.learn", function, str(seed)]
    done = subprocess.run(
        command, env={**os.environ, **environment}, capture_output=True, text=True, check=True
    )
    return float(json.loads(done.stdout))


def time_plain(seed: int) -> float:
    """Returns moves/s of the loops in this process, which is one without compilation."""
    training = make_training(MAIN, seed)
    with np.errstate(over="ignore"):  # integers that wrap around, as they are meant to
        training.advance(moves=1000)
        begun = time.process_time()
        training.advance(moves=PLAIN_MOVES)
    return PLAIN_MOVES / (time.process_time() - begun)


def count_compilations(seed: int) -> int:
    """Returns how many functions a training with tests compiles in this process."""
    import gc

    from numba.core.dispatcher import Dispatcher

    train_in_blocks(MAIN, seed)()
    found: list[Any] = [k for k in gc.get_objects() if isinstance(k, Dispatcher)]
    ours = [k for k in found if k.__module__.split(".")[0] in ("hose_mj", "hose_learning")]
    return sum(sum(k.stats.cache_misses.values()) for k in ours)


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]](int(sys.argv[2]))))
