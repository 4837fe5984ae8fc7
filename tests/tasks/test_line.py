from itertools import product

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_tasks import line as reference
from reference_tasks.line import LineReference

from hose_mj.tasks import kernels
from hose_mj.tasks.line.geometry import (
    covers,
    make_cover_table,
    make_direction_table,
    make_distance_table,
)
from hose_mj.tasks.registry import make_task

UP, DOWN, LEFT, RIGHT, NONE = range(5)
near = st.integers(-6, 6)
cells = st.tuples(near, near)


@pytest.mark.parametrize(
    ("end", "cell", "covered"),
    [
        ((2, 2), (1, 1), True),
        ((2, 2), (0, 1), False),  # only its corner touches
        ((2, 1), (1, 0), True),
        ((2, 1), (1, 1), True),
        ((2, 1), (2, 0), False),
        ((3, 0), (2, 0), True),
        ((3, 0), (4, 0), False),
        ((3, 0), (2, 1), False),  # runs along its side, half a cell away
        ((0, 0), (0, 0), True),
        ((0, 0), (1, 0), False),
    ],
)
def test_cells_that_a_segment_covers(end, cell, covered):
    assert covers(0, 0, *end, *cell) == covered


@settings(deadline=None)
@given(cells, cells, cells)
def test_covering_is_that_of_exact_fractions_and_symmetric(a, b, cell):
    covered = covers(*a, *b, *cell)
    assert covered == reference.covers(a, b, cell)
    assert covered == covers(*b, *a, *cell)
    mirrored = [(-y, x) for x, y in (a, b, cell)]
    assert covered == covers(*mirrored[0], *mirrored[1], *mirrored[2])


def test_a_cover_table_knows_all_cells_around_short_segments():
    table = make_cover_table(2)
    places = list(product(range(-4, 5), repeat=2))
    ways = list(reference.STEPS.values())
    for row, end in enumerate(product(range(-2, 3), repeat=2)):
        for column, (x, y) in enumerate(places):
            covered = [reference.covers((0, 0), end, (x + dx, y + dy)) for dx, dy in ways]
            assert table[row, column] == sum(1 << a for a, is_so in enumerate(covered) if is_so)
            assert not (max(abs(x), abs(y)) == 4 and any(covered))


def test_cardinalities_are_those_of_table_4_1():
    for n, offsets in {2: 197, 3: 89, 4: 49, 5: 37, 6: 21}.items():
        sizes = {v.name: v.cardinality for v in make_task("line", n_robots=n).variables}
        assert (sizes["r_n"], sizes["r_p"]) == (offsets, offsets)
        assert (sizes["d_g"], sizes["theta_g"], sizes["p"], sizes["o_up"]) == (24, 8, 441, 2)
    own = {v.name: v.cardinality for v in make_task("line-non-cooperative").variables}
    assert own["d_g"] == 256


def test_distances_and_directions():
    distances = make_distance_table(40, 24, squared=False)
    assert [distances[40 + x, 40 + y] for x, y in [(0, 0), (1, 1), (3, 4), (16, 16)]] == [
        0, 1, 5, 22,
    ]  # fmt: skip
    assert distances.max() == distances[40 + 17, 40 + 17] == 23
    assert make_distance_table(40, 256, squared=True)[40 + 3, 40 - 4] == 25
    directions = make_direction_table(40)
    around = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
    assert [directions[40 + 7 * x, 40 + 7 * y] for x, y in around] == list(range(8))
    # tan(pi / 8) = 0.4142 lies between 12/29 and 13/31
    assert directions[40 + 29, 40 + 12] == 0
    assert directions[40 + 31, 40 + 13] == 1
    assert directions[40, 40] == 0


@pytest.fixture
def play():
    """Plays one move from fixed cells and names its events."""

    def play(robots, agent, action, goal="none", **options):
        n = len(robots)
        task = make_task("line", n_robots=n, start=robots, goal=goal, **options)
        state = task.reset(np.array([1], np.uint64))
        return set(task.name_events(kernels.apply(task.kernel, state, agent, action)))

    return play


def test_events_of_single_moves(play):
    wide = {"half_width": 3}
    assert play(((3, 0),), 0, RIGHT, **wide) == {"out"}
    assert play(((3, 0),), 0, RIGHT, hose_length=3, **wide) == {"out", "stretch"}
    assert play(((3, 0),), 0, UP, hose_length=3, **wide) == {"stretch"}
    assert play(((3, 0),), 0, UP, hose_length=4, **wide) == set()
    assert play(((3, 0),), 0, UP, goal=(3, 1), **wide) == {"goal"}
    # no goal for who breaks something on the way
    assert play(((3, 0), (1, 0)), 0, UP, (3, 1), hose_length=4, **wide) == {"stretch"}
    # the tip steps onto the middle robot, onto the hose behind it, onto the source
    assert play(((3, 0), (2, 0)), 0, LEFT, **wide) == {"collision"}
    assert play(((1, 1), (2, 0)), 0, DOWN, **wide) == {"collision"}
    assert play(((0, 1), (2, 0)), 0, DOWN, **wide) == {"collision"}
    # the last robot may stand on the source, and a segment of one's own never blocks
    assert play(((3, 1), (1, 0)), 1, LEFT, **wide) == set()
    assert play(((3, 0), (1, 0)), 1, RIGHT, **wide) == set()
    # the last robot sweeps the segment to the source over the tip: the rules differ
    sweep = (((1, 1), (0, 2)), 1, RIGHT)
    assert play(*sweep, **wide) == set()
    assert play(*sweep, collision="sweeping", **wide) == {"collision"}


@pytest.mark.parametrize(
    ("rule", "expected", "robots"),
    [
        ("simultaneous", [{"collision"}, {"collision"}], [0, 1, 0, 2]),
        ("cancelling", [{"collision"}, {"collision"}], [0, 2, 0, 1]),
    ],
)
def test_a_swap(rule, expected, robots):
    task = make_task("line", n_robots=2, start=((0, 2), (0, 1)), goal="none", move_rule=rule)
    state = task.reset(np.array([1], np.uint64))
    caused_events = np.zeros(2, np.int64)
    kernels.apply_joint(task.kernel, state, np.array([DOWN, UP]), caused_events)
    assert [set(task.name_events(events)) for events in caused_events] == expected
    assert state[task.layout["robots"]].tolist() == robots


def test_of_two_that_enter_one_cell_the_second_is_cancelled():
    start = ((0, 3), (1, 2))
    task = make_task("line-2015", n_robots=2, start=start, goal="random")
    state = task.reset(np.array([1], np.uint64))
    caused_events = np.zeros(2, np.int64)
    kernels.apply_joint(task.kernel, state, np.array([DOWN, LEFT]), caused_events)
    assert [task.name_events(events) for events in caused_events] == [(), ("collision",)]
    assert state[task.layout["robots"]].tolist() == [0, 2, 1, 2]


def test_flags_see_robots_and_hose_but_not_the_rim():
    start = ((3, 1), (3, 0), (1, 0))
    task = make_task("line", n_robots=3, half_width=3, start=start, goal="none")
    state = task.reset(np.array([1], np.uint64))
    names = [variable.name for variable in task.variables]
    flags = slice(names.index("o_up"), names.index("o_up") + 4)
    assert task.observe(state, 0)[flags].tolist() == [0, 1, 0, 0]
    assert task.observe(state, 1)[flags].tolist() == [1, 0, 0, 0]
    assert task.observe(state, 2)[flags].tolist() == [0, 0, 0, 0]


def count_starts(task, n_samples):
    stream = np.array([2026], np.uint64)
    state = task.make_state()
    counts = {}
    for _ in range(n_samples):
        kernels.reset(task.kernel, state, stream)
        counts[tuple(state[kernels.HEADER :])] = counts.get(tuple(state[kernels.HEADER :]), 0) + 1
    return counts


@pytest.mark.parametrize("id", ["line", "line-non-cooperative"])
def test_initial_states_are_uniform_over_the_feasible_ones(id):
    task = make_task(id, n_robots=2, half_width=2, hose_length=3)
    rules = LineReference(task.settings)
    chains = []
    for robots in product(rules.offsets, repeat=2):
        last, step = robots
        rules.robots = [(last[0] + step[0], last[1] + step[1]), last]
        if rules.is_feasible():
            chains.append(list(rules.robots))
    goals = [[cell] for cell in rules.goal_cells] if id == "line" else chains
    possible = {
        tuple(value for cell in (*chain, (0, 0), *goal) for value in cell)
        for chain, goal in product(chains, goals)
        if chain[: len(goal)] != goal
    }
    counts = count_starts(task, 20 * len(possible))
    assert set(counts) <= possible
    observed = [counts.get(state, 0) for state in possible]
    assert scipy.stats.chisquare(observed).pvalue > 0.01


def test_terminal_states_have_values_within_range():
    # Two robots that pull apart stretch a segment by two cells, the most there is.
    start = ((3, 0), (1, 0))
    task = make_task("line", n_robots=2, hose_length=4, half_width=3, start=start, goal="none")
    state = task.reset(np.array([1], np.uint64))
    caused_events = np.zeros(2, np.int64)
    kernels.apply_joint(task.kernel, state, np.array([RIGHT, LEFT]), caused_events)
    assert [task.name_events(events) for events in caused_events] == [
        ("out", "stretch"),
        ("stretch",),
    ]
    names = [variable.name for variable in task.variables]
    values = dict(zip(names, task.observe(state, 0), strict=True))
    assert values["p"] == 6 * 7 + 3  # (3, 0), the nearest cell of the grid
    assert values["r_p"] == 12  # (2, 0), the last of the 13 offsets within two cells
