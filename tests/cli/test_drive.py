"""`hose-mj drive`: what keys do, without a window, and what is said where none can open."""

from __future__ import annotations

import numpy as np
import pytest

from hose_mj.cli import main as cli
from hose_mj.cli.drive import BACKSPACE, SPACE, Desk
from hose_mj.world.registry import make_world

UP, LEFT, PAGE_UP = 265, 263, 266


@pytest.fixture
def desk():
    lines = []
    desk = Desk(make_world("floor_2"), lines.append)
    desk.lines = lines
    return desk


def test_arrows_move_the_robot_chosen(desk):
    start = desk.world.site_positions()
    for key in (ord("1"), LEFT):
        desk.press(key)
    for _ in range(50):
        desk.advance(0.02)
    moved = desk.world.site_positions() - start
    assert moved[1, :2] == pytest.approx([-0.05, 0.0], abs=5e-3)
    assert np.linalg.norm(moved[0, :2]) < 5e-3
    assert desk.world.time == pytest.approx(1.0)
    assert desk.lines == ["robot 1: robot1"]


def test_robots_that_there_are_not_and_other_keys_do_nothing(desk):
    targets = desk.driver.targets.copy()
    for key in (ord("7"), ord("q")):
        desk.press(key)
    desk.advance(0.02)
    assert desk.robot == 0
    assert np.array_equal(desk.driver.targets, targets)


def test_space_stops_and_backspace_starts_again(desk):
    start = desk.world.site_positions()
    for _ in range(3):
        desk.press(LEFT)
    desk.advance(0.1)
    desk.press(SPACE)
    for _ in range(20):
        desk.advance(0.05)
    stopped = desk.world.site_positions()[0, 0] - start[0, 0]
    assert -0.1 < stopped < -0.005
    desk.press(BACKSPACE)
    desk.advance(0.02)
    assert desk.world.time == pytest.approx(0.02)
    assert desk.world.site_positions() == pytest.approx(start, abs=2e-3)


def test_a_break_is_told(desk):
    for _ in range(8):
        desk.press(UP)
    for _ in range(50):
        desk.advance(0.02)
    assert desk.breaks == len(desk.lines) >= 1
    assert all(line.split(":")[0] in ("stretch", "bounds", "run-over") for line in desk.lines)


def test_page_up_lifts_what_flies():
    desk = Desk(make_world("lift"), print)
    before = desk.driver.targets[0, 2]
    desk.press(PAGE_UP)
    desk.advance(0.01)
    assert desk.driver.targets[0, 2] - before == pytest.approx(desk.world.scene.cell_size)


def test_without_a_display_one_line_and_status_2(capsys, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert cli.main(["drive", "floor_2"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("hose-mj: error: display for drive is None; valid: a display")
    assert captured.err.count("\n") == 1


def test_an_unknown_model(capsys):
    assert cli.main(["drive", "floor_2", "--model", "rope"]) == 2
    assert "model is 'rope'; valid: one of geds" in capsys.readouterr().err
