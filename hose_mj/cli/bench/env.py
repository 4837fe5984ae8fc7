"""The group `env`: compiled tasks and many copies at once, beside Gymnasium's Taxi."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from hose_mj.checks import Check
from hose_mj.cli.bench import Bench, Record, measure_rate
from hose_mj.envs.vector import VectorTaskEnv
from hose_mj.tasks import kernels
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream

N_ROBOTS = (2, 3, 4, 6, 8)
MAIN = 4  # the number of robots that the limits are about
COPIES = 1024
PEER = "Gymnasium's Taxi from Python"
LEAST_MOVES, LEAST_RATIO, LEAST_VECTOR_MOVES = 3e6, 100.0, 1e6
"""Limits: moves/s of the line task, times faster than the peer, moves/s a core of the copies."""


def measure(quick: bool, seed: int) -> Bench:
    """Times the line task in a compiled loop, its copies, and single environments from Python."""
    rounds, seconds = (3, 0.1) if quick else (7, 0.4)

    def rate(work: Callable[[], int], clock: Callable[[], float] = time.process_time) -> float:
        return measure_rate(work, rounds, seconds, clock)

    bench = Bench()

    def record(name: str, value: float, peer: float | None = None) -> None:
        ratio = None if peer is None else value / peer
        named = None if peer is None else PEER
        bench.records.append(Record("env", name, value, "moves/s", named, ratio))

    newest = max(id for id in gymnasium.registry if id.startswith("Taxi-v"))
    taxi = rate(step_gymnasium(newest, 1, seed))
    record(PEER, taxi)
    for n_robots in (MAIN,) if quick else N_ROBOTS:
        moves = rate(play_compiled(n_robots, seed))
        record(f"line, N = {n_robots}, compiled loop", moves, taxi)
        if n_robots == MAIN:
            bench.checks += [
                Check(f"line, N = {MAIN}: moves/s", moves, LEAST_MOVES, ">="),
                Check(f"line, N = {MAIN}: times {PEER}", moves / taxi, LEAST_RATIO, ">="),
            ]
    one_core = rate(step_copies(1, seed))
    record(f"line, N = {MAIN}, {COPIES} copies, one core", one_core, taxi)
    name = f"line, N = {MAIN}, {COPIES} copies: moves/s on one core"
    bench.checks.append(Check(name, one_core, LEAST_VECTOR_MOVES, ">="))
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    if cores and cores > 1:
        all_cores = rate(step_copies(None, seed), time.perf_counter)
        record(f"line, N = {MAIN}, {COPIES} copies, all cores", all_cores, taxi)
    single = rate(step_gymnasium("hose_mj/Line-v0", MAIN, seed, n_robots=MAIN))
    record(f"line, N = {MAIN}, one copy from Python", single, taxi)
    return bench


def play_compiled(n_robots: int, seed: int) -> Callable[[], int]:
    """Random moves in one compiled loop; every agent observes all variables before its move."""
    task = make_task("line", n_robots=n_robots)
    stream = make_stream(np.random.default_rng(seed))
    state = task.reset(stream)
    values, counts = np.zeros(len(task.variables), np.int64), np.zeros(4, np.int64)
    moves = 100_000

    def work() -> int:
        kernels.run_random(task.kernel, state, stream, moves, values, counts)
        return moves

    return work


def step_copies(cores: int | None, seed: int) -> Callable[[], int]:
    """Random joint moves of many copies; a copy that starts an episode makes none."""
    env = VectorTaskEnv("line", COPIES, n_robots=MAIN, cores=cores)
    shape = (32, COPIES, MAIN)
    actions = np.random.default_rng(seed).integers(0, env.task.n_actions, shape)
    env.reset(seed=seed)
    over = np.zeros(COPIES, np.bool_)

    def work() -> int:
        nonlocal over
        moves = 0
        for action in actions:
            moves += MAIN * (COPIES - int(over.sum()))
            _, _, terminated, truncated, _ = env.step(action)
            over = terminated | truncated
        return moves

    return work


def step_gymnasium(id: str, moves: int, seed: int, **options: Any) -> Callable[[], int]:
    """Random steps of an environment as `gymnasium.make` makes it, each of so many moves."""
    env = gymnasium.make(id, **options)
    env.action_space.seed(seed)
    env.reset(seed=seed)
    steps = 1000

    def work() -> int:
        for _ in range(steps):
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            if terminated or truncated:
                env.reset()
        return steps * moves

    return work
