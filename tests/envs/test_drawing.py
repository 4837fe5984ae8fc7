"""Pictures: what is where, in the image and in the text."""

from __future__ import annotations

import re

import numpy as np
import pytest

from hose_mj.envs import IDS
from hose_mj.envs.drawing import GOAL_COLOR, Moment, make_grid_episode, make_picture
from hose_mj.envs.gym import TaskEnv
from hose_mj.envs.picture import AGENT_COLORS, ROBOT, TAXI, Picture, draw_picture, write_picture
from hose_mj.errors import InputError
from hose_mj.recording.rerun import read_recording
from hose_mj.tasks.registry import make_task

START = ((-4, 3), (0, 3), (2, 0))


@pytest.fixture
def line():
    env = TaskEnv("line", n_robots=3, start=START, goal=(-6, -5), render_mode="rgb_array")
    env.reset(seed=0)
    return env


def find_pixel(image, cell, x, y):
    """Middle of a cell of the grid [-10, 10]^2 whose frame is 6 pixels wide."""
    return 6 + int((x + 10.5) * cell), 6 + int((10.5 - y) * cell)


def test_the_image_shows_each_robot_in_its_colour(line):
    image = line.render()
    assert image.dtype == np.uint8
    cell = 510 // 21
    assert image.shape[1] == 21 * cell + 12
    for number, (x, y) in enumerate(START):
        column, row = find_pixel(image, cell, x, y)
        around = image[row - 8 : row + 9, column - 8 : column + 9].reshape(-1, 3)
        share = np.mean(np.all(around == AGENT_COLORS[number], axis=1))
        assert share > 0.4
    column, row = find_pixel(image, cell, -6, -5)
    around = image[row - 10 : row + 11, column - 10 : column + 11].reshape(-1, 3)
    assert np.any(np.all(around == GOAL_COLOR, axis=1))


def test_images_are_new_and_deterministic(line):
    first, second = line.render(), line.render()
    assert np.array_equal(first, second)
    assert not np.shares_memory(first, second)


def test_the_picture_of_the_line_holds_the_flags(line):
    """Robot 1 at (0, 3) stands between segments it ends, robot 0 next to nothing."""
    picture = make_picture(line.task, line.state())
    assert picture.hose == (*START, (0, 0))
    task = line.task
    places = {variable.name: k for k, variable in enumerate(task.variables)}
    expected = 0
    for agent in range(3):
        values = task.observe(line.state(), agent)
        expected += sum(int(values[places[f"o_{way}"]]) for way in ("up", "down", "left", "right"))
    assert len(picture.flags) == expected


def test_the_text_of_the_line(line):
    line = TaskEnv("line", n_robots=3, start=START, goal=(-6, -5), render_mode="ansi")
    line.reset(seed=0)
    lines = line.render().splitlines()
    assert len(lines) == 22
    assert lines[-1] == "move 0"

    def at(x, y):
        return lines[10 - y].ljust(42)[2 * (x + 10)]

    assert [at(x, y) for x, y in START] == ["0", "1", "2"]
    assert (at(0, 0), at(-6, -5), at(-2, 3), at(9, 9)) == ("S", "G", "*", ".")


def test_the_text_of_the_maze_has_the_walls_of_table_5_1():
    env = TaskEnv("maze", start=(2, 0), render_mode="ansi")
    env.reset(seed=0)
    assert env.render().splitlines() == [
        "+---+---+---+---+",
        "| G   .   .   . |",
        "+---+   +---+   +",
        "| .   .   0   . |",
        "+---+---+---+---+",
        "move 0",
    ]


def test_the_text_of_the_taxi_follows_the_passengers():
    env = TaskEnv("taxi", starts=((0, 0), (2, 1)), moves="turns", render_mode="ansi")
    env.reset(seed=0)
    env.step((4, 1))
    rows = env.render().splitlines()
    assert rows[1].startswith("| 0p")
    assert rows[-1].startswith("move 2")


@pytest.mark.parametrize("id", IDS)
def test_every_task_has_a_picture_with_all_its_agents(id):
    options = {"n_robots": 3} if "2015" not in id and "Line" in id else {}
    task = make_task(IDS[id], **options)
    picture = make_picture(task, task.reset(np.zeros(1, np.uint64)))
    robots = [mark for mark in picture.marks if mark.kind in (ROBOT, TAXI)]
    assert [mark.label for mark in sorted(robots, key=lambda mark: mark.label)] == [
        str(k) for k in range(len(robots))
    ]
    inside = [
        -0.5 <= x - picture.corner[0] < picture.columns - 0.5
        and -0.5 <= y - picture.corner[1] < picture.rows - 0.5
        for x, y in (mark.at for mark in picture.marks)
    ]
    assert all(inside)


def test_the_caption_says_what_happened():
    env = TaskEnv("corridor", render_mode="ansi")
    env.reset(seed=0)
    env.step((1, 2))
    assert re.search(r"^move 2 · .*goal", env.render().splitlines()[-1])


def test_rerun_mode_records_the_episode(tmp_path):
    """Fixed start and actions: four states of two robots, x to the right and y negated."""
    env = TaskEnv("corridor", render_mode="rerun")
    env.reset(seed=5)
    env.step((2, 2))
    env.reset(seed=5)
    for actions in ((0, 2), (2, 1), (1, 2)):
        env.step(actions)
    path = tmp_path / "corridor.rrd"
    path.write_bytes(env.render())
    summary = read_recording(path)
    assert summary["application_id"] == "hose_mj"
    assert summary["timelines"] == ["turn"]
    rows = {name: entity["rows"] for name, entity in summary["entities"].items()}
    for name in ("goal_0", "robot_1", "robot_2"):
        assert rows[f"/grid/{name}"] == 4
    assert rows["/reward"] == rows["/events"] == 4
    assert summary["entities"]["/grid/lines"]["static"] == 1


def test_what_is_recorded_is_what_happened():
    env = TaskEnv("line", n_robots=3, start=START, goal=(-6, -5), moves="turns")
    env.reset(seed=0)
    moments = [Moment(env.state(), 0, 0.0)]
    env.step((0, 4, 4))
    moments.append(Moment(env.state(), env.episode.events, -1.0))
    grid = make_grid_episode(env.task, moments)
    assert grid.turns.tolist() == [0, 3]
    assert grid.rewards.tolist() == [0.0, -1.0]
    assert grid.hose[1].tolist() == [[-4, 4], [0, 3], [2, 0], [0, 0]]
    tip = next(track for track in grid.tracks if track.label == "0")
    assert tip.points.tolist() == [[-4, 3], [-4, 4]]
    assert grid.lines.shape == (44, 2, 2)
    assert grid.lines.min() == -10.5
    assert grid.events[0] == "-"


@pytest.mark.parametrize("mode", ["ansi", "rgb_array", "rerun"])
def test_nothing_to_draw_before_the_first_reset(mode):
    with pytest.raises(InputError, match="call reset"):
        TaskEnv("maze", render_mode=mode).render()


def test_human_mode_writes_every_step(capsys):
    env = TaskEnv("corridor", render_mode="human")
    env.reset(seed=0)
    env.step((2, 2))
    assert env.render() is None
    shown = capsys.readouterr().out
    assert "move 0" in shown
    assert "move 2" in shown


def test_no_mode_draws_nothing(capsys):
    env = TaskEnv("corridor")
    env.reset(seed=0)
    assert env.render() is None
    assert capsys.readouterr().out == ""


def test_an_empty_grid():
    picture = Picture((0, 0), 2, 3, (), caption="nothing")
    assert write_picture(picture) == ". .\n. .\n. .\nnothing"
    assert draw_picture(picture, cell=10).shape == (3 * 10 + 12 + 30, 2 * 10 + 12, 3)
