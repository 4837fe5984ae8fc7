"""Actions in cells, in worlds with a hose."""

from __future__ import annotations

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.tasks.line import kernels as line_kernels
from hose_mj.tasks.line.settings import DIRECTIONS
from hose_mj.world.actions import STEPS, Actions, compute_cells, compute_centres
from hose_mj.world.driving import Driver
from hose_mj.world.registry import make_world


def act(actions, robot, action):
    actions.begin(robot, action)
    while not actions.is_done():
        actions.update()
        actions.world.step()


def test_names_and_steps_are_the_line_tasks():
    assert tuple(STEPS)[:5] == (*DIRECTIONS, "none")
    for number, name in enumerate((*DIRECTIONS, "none")):
        assert STEPS[name] == (line_kernels.step_x(number), line_kernels.step_y(number), 0)


def test_cells_of_the_floor():
    world = make_world("floor_4")
    cells = compute_cells(world, world.site_positions())
    assert cells.tolist() == [[2, 5, 0], [2, 3, 0], [3, 1, 0], [1, 2, 0], [0, 0, 0]]
    assert compute_centres(world, cells) == pytest.approx(world.site_positions())
    edge = world.site_positions()[0] + [0.0249, -0.0249, 0.0]
    assert compute_cells(world, edge).tolist() == [2, 5, 0]


def test_a_walk_through_cells_with_a_hose():
    world = make_world("floor_2")
    actions = Actions(Driver(world))
    cells = actions.compute_cells()
    assert actions.names == (*DIRECTIONS, "none")
    for turn, action in enumerate(("left", "down", "right", "down", "none", "up")):
        robot = turn % 2
        act(actions, robot, action)
        cells[robot] += STEPS[action]
        assert not actions.stalled
        assert actions.compute_cells().tolist() == cells.tolist()
        away = world.site_positions()[:-1] - compute_centres(world, cells)
        assert np.linalg.norm(away[robot]) <= 5e-3
        assert np.linalg.norm(away, axis=1).max() <= 1e-2
        assert np.linalg.norm(world.site_velocities()[robot]) <= 1e-2
    assert actions.describe() == {"turn": 6, "owner": "robot1", "action": "up", "stalled": 0}


def test_a_robot_that_is_too_slow_stalls_and_holds_where_it_is():
    world = make_world("floor_2")
    actions = Actions(Driver(world, speed=0.01))
    start = world.site_positions()[1]
    act(actions, 1, "left")
    assert actions.stalled
    assert actions.describe()["stalled"] == 1
    assert world.time == pytest.approx(2.0, abs=0.01)
    here = world.site_positions()[1]
    assert 0.0 < start[0] - here[0] <= 0.02
    assert actions.driver.targets[1] == pytest.approx(here)
    act(actions, 1, "none")
    assert not actions.stalled


def test_up_in_space():
    world = make_world("lift")
    actions = Actions(Driver(world))
    start = world.site_positions()
    act(actions, 0, "+z")
    moved = world.site_positions() - start
    source = start[-1]
    cell = world.scene.cell_size
    height = source[2] + (round((start[0, 2] - source[2]) / cell) + 1) * cell
    assert world.site_positions()[0, 2] == pytest.approx(height, abs=actions.tolerance)
    assert np.linalg.norm(moved[0, :2]) < actions.tolerance


def test_what_there_is_not():
    world = make_world("floor_2")
    actions = Actions(Driver(world))
    with pytest.raises(InputError, match="robot is 2; valid: 0"):
        actions.begin(2, "up")
    with pytest.raises(InputError, match="action is '\\+z'; valid: one of up, down, left, right"):
        actions.begin(0, "+z")
    with pytest.raises(InputError, match="mode is 'teleport'"):
        Actions(Driver(world), "teleport")
    with pytest.raises(InputError, match="force_time is 0"):
        Actions(Driver(world), "force", force_time=0.0)
