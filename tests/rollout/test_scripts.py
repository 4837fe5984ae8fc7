"""Formations, how robots glide between them, and ways to the goal."""

from __future__ import annotations

import heapq

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from hose_mj.rollout.policies import FreeCells, GoalPlan
from hose_mj.rollout.scripts import Player, Script, move, relax
from hose_mj.world.actions import compute_centres
from hose_mj.world.driving import Driver
from hose_mj.world.registry import make_world

numbers = st.floats(-1.0, 1.0)


@given(arrays.arrays(float, (4, 3), elements=numbers), st.integers(0, 3), st.floats(0.0, 1.0))
def test_relaxed_robots_are_within_reach_of_each_other(formation, fixed, share):
    """Wherever the fixed robot is in reach of the source at all."""
    spans, source = np.array([0.3, 0.4, 0.5, 0.6]), np.array([0.1, 0.0, -0.2])
    away = formation[fixed] - source
    reach = spans[fixed:].sum()
    if np.linalg.norm(away) > 0.95 * reach:
        formation[fixed] = source + away * 0.95 * share * reach / np.linalg.norm(away)
    found = relax(formation, fixed, source, spans)
    assert np.array_equal(found[fixed], formation[fixed])
    apart = np.linalg.norm(np.diff(np.vstack([found, source]), axis=0), axis=1)
    assert np.all(apart <= spans * (1.0 + 1e-2))


def test_a_slack_formation_stays_as_it_is():
    formation = np.array([[0.2, 0.1, 0.0], [0.1, 0.0, 0.0]])
    found = relax(formation, 0, np.zeros(3), np.array([0.2, 0.2]))
    assert np.array_equal(found, formation)


def test_robots_glide_together():
    """All arrive at once, at the speed of the one that goes farthest."""
    world = make_world("floor_2")
    driver = Driver(world, speed=0.2)
    start = driver.targets.copy()
    script = move(world, 0, {0: start[0] - [0.1, 0, 0], 1: start[1] + [0, 0.05, 0]}, {0: start[0]})
    player = Player(driver, script)
    assert player.time == pytest.approx(0.1 / 0.2 + 0.1 / 0.2)
    assert Player(driver, Script(0, script.formations, 0.5)).time == pytest.approx(2.0)
    seen = {}
    for k in range(1200):
        if k in (125, 250, 375, 1199):
            seen[k] = driver.targets.copy()
        player.update()
        world.step()
    half = world.timestep
    assert seen[125] == pytest.approx(0.5 * (start + script.formations[0]), abs=half)
    assert seen[250] == pytest.approx(script.formations[0], abs=half)
    assert seen[1199] == pytest.approx(script.formations[1])
    assert world.site_positions()[0] == pytest.approx(start[0], abs=2e-3)


@pytest.fixture(scope="module")
def deck():
    return Driver(make_world("deck"))


def test_the_way_on_the_deck_is_free_and_shortest(deck):
    cells = FreeCells(deck, deck.world.site_positions()[0], hose=False)
    goal = cells.find_goal()
    path = cells.find_path(goal)
    assert path[-1] == goal
    assert all(cells.is_free(cell) for cell in path[:-1])
    steps = np.abs(np.diff(path, axis=0))
    assert steps.max() == 1
    length = np.linalg.norm(steps, axis=1).sum()
    assert length == pytest.approx(find_shortest(cells, path[0], goal))
    assert length > np.linalg.norm(np.subtract(path[0], goal))


def find_shortest(cells, start, goal):
    """Dijkstra over the same moves, without the heuristic."""
    best, queue = {start: 0.0}, [(0.0, start)]
    while queue:
        cost, cell = heapq.heappop(queue)
        if cell == goal:
            return cost
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                following = (cell[0] + dx, cell[1] + dy, 0)
                beside = {(cell[0] + a, cell[1] + b, 0) for a in {0, dx} for b in {0, dy}}
                beside -= {cell, goal}
                total = cost + float(np.hypot(dx, dy))
                is_better = max(map(abs, following)) < 25 and total < best.get(following, np.inf)
                if is_better and all(cells.is_free(one) for one in beside):
                    best[following] = total
                    heapq.heappush(queue, (total, following))
    return None


def test_crates_other_robots_and_the_edge_are_not_free(deck):
    cells = FreeCells(deck, deck.world.site_positions()[0], hose=False)
    world = deck.world
    size = world.scene.cell_size

    def is_free_at(place):
        source = world.site_positions()[-1]
        cell = np.round((np.array([*place, source[2]]) - source) / size).astype(int)
        assert np.linalg.norm((compute_centres(world, cell) - [*place, 0])[:2]) < size
        return cells.is_free((int(cell[0]), int(cell[1]), 0))

    assert is_free_at((0.9, -2.2))
    for place in ((0.2, 1.9), (1.6, -0.5), (-0.3, 0.2), (5.0, 0.0), (0.0, -3.6)):
        assert not is_free_at(place)


def test_a_plan_keeps_segments_slack_and_ends_at_the_goal(deck):
    world = deck.world
    spans = -np.diff(world.arc_lengths)
    for slack in (0.85, 0.95):
        script = GoalPlan(0, False, 1.0, slack).make_script(deck)
        source = world.site_positions()[-1]
        for formation in script.formations:
            apart = np.linalg.norm(np.diff(np.vstack([formation, source]), axis=0), axis=1)
            assert np.all(apart <= slack * spans * 1.01)
        assert script.formations[-1, 0, :2] == pytest.approx(world.goal_position()[:2])


def test_robots_that_fly_rise_first():
    driver = Driver(make_world("lift"))
    script = GoalPlan(3, True, 1.0, 0.95).make_script(driver)
    risen = script.formations[0] - driver.world.site_positions()[:-1]
    assert risen == pytest.approx(np.tile([0.0, 0.0, 3 * driver.world.scene.cell_size], (3, 1)))
