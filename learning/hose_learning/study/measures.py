"""The measures of chapter 6: how soon a goal is found, and how soon and how well it is reached."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hose_learning.study.training import Manner, Training


@dataclass(frozen=True)
class Measures:
    """What section 6.6 measures. A step is a move in turns, or a joint move (footnote 2).

    Attributes:
        n_g: training steps until an episode first reaches the goal, or None.
        n_f: training steps until a greedy test first does, or None.
        s_f: steps of that test, or None.
        s_b: steps of the best test, or None.
        steps: training steps in all.
        n_tests: number of tests.
        n_valid: how many of them reached the goal.
    """

    n_g: int | None
    n_f: int | None
    s_f: int | None
    s_b: int | None
    steps: int
    n_tests: int
    n_valid: int


def measure(
    training: Training,
    max_steps: int,
    max_episodes: int | None = None,
    test_every: int = 100,
    manner: Manner | None = None,
) -> Measures:
    """Trains, tests the greedy policy after every so many episodes, and measures.

    Args:
        training: from its first move on.
        max_steps: training steps: moves in turns, or joint moves.
        max_episodes: most episodes; no bound by default.
        test_every: episodes between two tests.
        manner: how the agents move in a test; jointly by default.
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
