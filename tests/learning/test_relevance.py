"""Algorithm 5.1 against Table 5.1, Definition 8 spelled out, and what tasks are known to be."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hose_learning.experience import record_experience
from hose_learning.relevance import (
    Signal,
    count_contradictions,
    count_unexplained,
    find_relevance,
    find_relevant,
    list_candidates,
    list_signals,
    make_veto_modules,
    number_rows,
    sort_by_range,
)

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import HEADER
from hose_mj.tasks.registry import make_task

# Thesis Table 5.1a: x, y, o_up, and whether going up was punished.
TABLE_51 = np.array(
    [(0, 0, 1, 1), (1, 0, 0, 0), (2, 0, 1, 1), (3, 0, 0, 0), (2, 1, 1, 1), (3, 1, 1, 1)]
)
FLAGS = ("o_up", "o_down", "o_left", "o_right")


def tells(values, moves, signal):
    """Definition 8, pair by pair: rows alike in values and move are alike in the signal."""
    rows = [(*map(int, row), int(move)) for row, move in zip(values, moves, strict=True)]
    return all(
        signal[one] == signal[other]
        for one, other in product(range(len(rows)), repeat=2)
        if rows[one] == rows[other]
    )


def run_as_printed(values, moves, signal):
    """Algorithm 5.1 line by line."""
    left = sorted(range(values.shape[1]), key=lambda k: -int(np.ptp(values[:, k])))
    for variable in list(left):
        if len(left) > 1:
            rest = [k for k in left if k != variable]
            if tells(values[:, rest], moves, signal):
                left = rest
    return sorted(left)


def test_table_5_1_step_by_step():
    values, up = TABLE_51[:, :3], np.zeros(6, np.int64)
    punished = TABLE_51[:, 3].astype(bool)
    assert sort_by_range(values) == [0, 1, 2]
    assert count_contradictions(values[:, 1:], punished) == 0  # Table 5.1b: x goes
    assert count_contradictions(values[:, 2:], punished) == 0  # Table 5.1c: y goes
    assert find_relevant(values, up, punished).tolist() == [False, False, True]


def test_the_pairs_that_the_text_compares():
    """Instances (0, 2), (1, 3) and (4, 5) share y and o_up, and no others do."""
    rows = number_rows(TABLE_51[:, 1:3])
    alike = {(i, j) for i in range(6) for j in range(i + 1, 6) if rows[i] == rows[j]}
    assert alike == {(0, 2), (1, 3), (4, 5)}


def test_the_maze_is_the_table():
    task = make_task("maze", actions="up")
    state = task.make_state()
    for x, y, flag, punished in TABLE_51:
        state[HEADER : HEADER + 2] = x, y
        assert task.observe(state, 0).tolist() == [x, y, flag]
        assert kernels.apply(task.kernel, state.copy(), 0, 0) & 1 == punished


@pytest.mark.parametrize("seed", range(30))
def test_it_does_what_is_printed(seed):
    generator = np.random.default_rng(seed)
    values = generator.integers(0, (2, 5, 3, 4), size=(int(generator.integers(1, 60)), 4))
    moves = generator.integers(0, 3, len(values))
    signal = (values[:, 1] > 2) ^ (values[:, 0] == moves)
    if seed % 3 == 0:
        signal = generator.random(len(values)) < 0.5  # noise: nothing tells it
    found = find_relevant(values, moves, signal)
    assert np.flatnonzero(found).tolist() == run_as_printed(values, moves, signal)


def test_only_equal_moves_are_compared():
    values, signal = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]), np.array([1, 1, 0, 0], bool)
    apart, alike = np.array([0, 0, 1, 1]), np.zeros(4, np.int64)
    assert count_contradictions(np.column_stack([apart, values[:, :1]]), signal) == 0
    assert find_relevant(values, alike, signal).tolist() == [False, True]
    # The move tells the signal alone; still one variable is left, the last one tested.
    assert find_relevant(values, apart, signal).tolist() == [False, True]


@pytest.mark.parametrize("largest", [3, 2**40])
def test_rows_are_numbered_exactly(largest):
    generator = np.random.default_rng(3)
    columns = generator.choice([0, 1, largest], size=(200, 5))
    numbers = number_rows(columns)
    for one, other in product(range(200), repeat=2):
        assert (numbers[one] == numbers[other]) == (columns[one] == columns[other]).all()


def test_contradictions_are_the_fewer_of_equal_rows():
    columns = np.array([[1], [1], [1], [2], [2], [3]])
    signal = np.array([1, 1, 0, 0, 1, 1], bool)
    assert count_contradictions(columns, signal) == 1 + 1 + 0


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("pooled", [False, True])
def test_the_line_task(seed, pooled):
    """Section 5.5.1: a stretch is told by r_n and r_p alone, a collision by the flags."""
    task = make_task("line")
    log = record_experience(task, 10_000, np.random.default_rng(seed))
    candidates = list_candidates(task, log)
    relevance = find_relevance(log, list_signals(task), candidates, pooled)
    out, stretch, collision = relevance.signals
    assert relevance.list_relevant(stretch) == ("r_n", "r_p")
    assert relevance.list_relevant(collision) == FLAGS
    assert count_unexplained(relevance, stretch, log) == 0
    only_grid = find_relevance(log, [out], ("p", "r_n", "r_p"))
    assert only_grid.list_relevant(out) == ("p",)


def test_copies_of_an_agents_own_variables_are_left_out():
    task = make_task("line", n_robots=3)
    log = record_experience(task, 500, np.random.default_rng(0))
    names = [variable.name for variable in task.variables]
    left_out = set(names) - set(list_candidates(task, log))
    assert left_out == {"r_n_1", "r_n_2", "r_n_3"}


def test_the_taxi():
    """Section 5.5.2: a collision is told by the four flags."""
    task = make_task("taxi")
    log = record_experience(task, 2000, np.random.default_rng(1))
    relevance = find_relevance(log, list_signals(task), list_candidates(task, log))
    assert relevance.list_relevant(relevance.signals[0]) == FLAGS


def test_what_nothing_tells_keeps_everything():
    """Two equal rows that differ in the signal: every variable tested is found to matter."""
    values = np.array([[0, 5], [0, 5], [1, 2]])
    signal = np.array([1, 0, 0], bool)
    assert find_relevant(values, np.zeros(3, np.int64), signal).all()


def test_a_single_agent_has_a_signal_for_each_robot():
    signals = list_signals(make_task("line-single-agent", n_robots=2))
    assert [signal.name for signal in signals[2:4]] == ["stretch_0", "stretch_1"]
    assert signals[3].actions == ("up_1", "down_1", "left_1", "right_1")
    assert [signal.name for signal in list_signals(make_task("taxi-single-agent"))] == [
        "collision_0",
        "collision_1",
    ]
    assert list_signals(make_task("corridor")) == (Signal("collision", "collision"),)


def test_modules_are_made_of_what_matters():
    task = make_task("maze")
    log = record_experience(task, 2000, np.random.default_rng(0))
    relevance = find_relevance(log, list_signals(task), list_candidates(task, log))
    (module,) = make_veto_modules(relevance)
    assert (module.kind, module.variables, module.events) == ("veto", FLAGS, ("collision",))


def test_nothing_is_made_of_what_was_not_seen():
    task = make_task("line", half_width=10, n_robots=2, start=((1, 0), (0, 1)))
    log = record_experience(task, 1, np.random.default_rng(0))
    relevance = find_relevance(log, list_signals(task), list_candidates(task, log))
    assert relevance.n_seen.tolist() == [0, 0, 0]
    assert make_veto_modules(relevance) == ()


def test_wrong_names():
    log = record_experience(make_task("maze"), 10, np.random.default_rng(0))
    with pytest.raises(InputError, match="event is 'stretch'; valid: one of collision, goal"):
        find_relevance(log, [Signal("stretch", "stretch")], ("x",))
    with pytest.raises(InputError, match="variable is 'z'"):
        find_relevance(log, [Signal("collision", "collision")], ("z",))
    with pytest.raises(InputError, match="action is 'jump'"):
        find_relevance(log, [Signal("collision", "collision", ("jump",))], ("x",))
    with pytest.raises(InputError, match="at least one of x, y"):
        find_relevance(log, [], ())
