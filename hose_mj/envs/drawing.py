"""What tasks look like, and `Renderer`, which shows an episode in a render mode.

The type of a task's record selects the function that makes its `Picture` (`draw`); what a mode
needs beyond that is loaded at the first frame.
"""

import functools
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hose_mj.envs.episode import Episode, sum_signals
from hose_mj.envs.picture import (
    AGENT_COLORS,
    GOAL,
    PASSENGER,
    ROBOT,
    SOURCE,
    STATION,
    TAXI,
    Mark,
    Picture,
    Point,
    Rgb,
    draw_picture,
    write_picture,
)
from hose_mj.errors import InputError
from hose_mj.recording.grid import Array, GridEpisode, GridTrack
from hose_mj.tasks.kernels import STEPS, Integers
from hose_mj.tasks.line.kernels import ABSENT, Line
from hose_mj.tasks.task import Task
from hose_mj.tasks.taxi.kernels import STATIONS, WIDTH, Taxi
from hose_mj.tasks.tiny.kernels import Corridor, Maze

RENDER_MODES = ["human", "ansi", "rgb_array", "rerun"]
"""human: text on the terminal after each step; ansi: the text; rgb_array: an image (h, w, 3);
rerun: a Rerun recording (.rrd, bytes) of the episode so far."""


class Moment(NamedTuple):
    """The state after a reset or a step, with the step's events and the team's reward."""

    state: Integers
    events: int
    reward: float


def look_at(episode: Episode) -> Moment:
    """Returns the moment that an episode is at."""
    reward = float(sum_signals(episode.compute_team_signals(), episode.chosen))
    return Moment(episode.state.copy(), episode.events, reward)


class Renderer:
    """Draws the episodes of one environment in one of `RENDER_MODES`; None draws nothing.

    `InputError` is raised for an unknown mode.
    """

    def __init__(self, task: Task, mode: str | None) -> None:
        if mode is not None and mode not in RENDER_MODES:
            raise InputError("render_mode", mode, f"None or one of {', '.join(RENDER_MODES)}")
        self.task, self.mode = task, mode
        self._history: list[Moment] = []

    def follow(self, episode: Episode) -> None:
        """Is told of every reset and step."""
        if self.mode == "human":
            sys.stdout.write(self._write(episode) + "\n\n")
        if self.mode == "rerun":
            if episode.steps == 0:
                self._history = []
            self._history.append(look_at(episode))

    def render(self, episode: Episode) -> Any:
        """Returns what the mode asks for; None in mode human or without one.

        Raises:
            InputError: nothing to show yet.
        """
        if self.mode is not None and not episode.begun:
            raise InputError.about("cannot show an episode that has not begun: call reset() first")
        if self.mode == "ansi":
            return self._write(episode)
        if self.mode == "rgb_array":
            return draw_picture(make_picture(self.task, episode.state, episode.events))
        if self.mode == "rerun":
            return encode_moments(self.task, self._history)
        return None

    def _write(self, episode: Episode) -> str:
        return write_picture(make_picture(self.task, episode.state, episode.events))


def encode_moments(task: Task, moments: Sequence[Moment]) -> bytes:
    """Returns the Rerun recording of an episode (.rrd)."""
    from hose_mj.recording.rerun import encode_grid_episode

    return encode_grid_episode(make_grid_episode(task, moments))


def make_grid_episode(task: Task, moments: Sequence[Moment]) -> GridEpisode:
    """Makes the record of an episode from its moments."""
    pictures = [make_picture(task, moment.state) for moment in moments]
    first = pictures[0]
    tracks = [
        GridTrack(
            f"{mark.kind}_{place}",
            mark.label or mark.kind,
            mark.color,
            np.array([picture.marks[place].at for picture in pictures], np.float64),
        )
        for place, mark in enumerate(first.marks)
    ]
    return GridEpisode(
        title=task.id,
        turns=np.array([moment.state[STEPS] for moment in moments]),
        lines=list_lines(first),
        tracks=tuple(tracks),
        hose=np.array([picture.hose for picture in pictures], np.float64) if first.hose else None,
        rewards=np.array([moment.reward for moment in moments]),
        events=tuple(", ".join(task.name_events(moment.events)) or "-" for moment in moments),
    )


def list_lines(picture: Picture) -> Array:
    """Lists the walls, or the lines of a grid without walls, each two points (n, 2, 2)."""
    if picture.walls:
        return np.array(picture.walls, np.float64)
    left, bottom = picture.corner[0] - 0.5, picture.corner[1] - 0.5
    right, top = left + picture.columns, bottom + picture.rows
    upright = [((left + k, bottom), (left + k, top)) for k in range(picture.columns + 1)]
    level = [((left, bottom + k), (right, bottom + k)) for k in range(picture.rows + 1)]
    return np.array(upright + level, np.float64)


# What each task looks like

GOAL_COLOR: Rgb = (34, 139, 87)
STATION_COLORS: dict[str, Rgb] = {"R": (200, 55, 50), "G": (40, 140, 70)}
STATION_COLORS |= {"Y": (190, 150, 0), "B": (50, 95, 190)}
_STEPS: dict[str, Point] = {"up": (0, 1), "down": (0, -1), "left": (-1, 0), "right": (1, 0)}


def make_picture(task: Task, state: Integers, events: int = 0) -> Picture:
    """Makes the picture of a state, with the events of the last step in its caption.

    Raises:
        NotImplementedError: a task that no function here can draw.
    """
    words = [f"move {int(state[STEPS])}", *task.name_events(events)]
    return draw(task.kernel, task, state, " · ".join(words))


@functools.singledispatch
def draw(record: Any, task: Task, state: Integers, caption: str) -> Picture:
    """Makes the picture of a state of the task with this kernel record."""
    raise NotImplementedError(f"no picture of {type(record).__name__}")


def number_robots(cells: Integers) -> tuple[Mark, ...]:
    """Returns numbered robots, the last one first so that the tip is on top; `cells` is (n, 2)."""
    marks = [
        Mark(ROBOT, (float(x), float(y)), str(number), AGENT_COLORS[number % len(AGENT_COLORS)])
        for number, (x, y) in enumerate(cells)
    ]
    return tuple(reversed(marks))


@draw.register
def draw_corridor(record: Corridor, task: Task, state: Integers, caption: str) -> Picture:
    """A row of cells."""
    cells = np.stack([state[task.layout["robots"]], np.zeros(2, np.int64)], axis=1)
    goal = Mark(GOAL, (record.goal, 0), "", GOAL_COLOR)
    return Picture((0, 0), record.n_cells, 1, (goal, *number_robots(cells)), caption=caption)


@draw.register
def draw_maze(record: Maze, task: Task, state: Integers, caption: str) -> Picture:
    """A grid with walls; flags are where a wall stops the robot."""
    at = state[task.layout["robots"]]
    goal = Mark(GOAL, (record.goal_x, record.goal_y), "", GOAL_COLOR)
    cells = [(x, y) for x in range(record.width) for y in range(record.height)]
    sides = [
        (x, y, s) for x, y in cells for k, s in enumerate(_STEPS.values()) if record.walls[x, y, k]
    ]
    return Picture(
        (0, 0),
        record.width,
        record.height,
        (goal, *number_robots(at[None])),
        walls=tuple(compute_side(x, y, *step) for x, y, step in sides),
        flags=list_flags(task, state, [(float(at[0]), float(at[1]))]),
        caption=caption,
    )


@draw.register
def draw_line(record: Line, task: Task, state: Integers, caption: str) -> Picture:
    """The hose from the tip to the source; flags are where a move would collide."""
    points = state[task.layout["robots"]].reshape(-1, 2)
    source = state[task.layout["source"]]
    goals = state[task.layout["goals"]].reshape(-1, 2)
    corners = [(float(x), float(y)) for x, y in (*points, source)]
    marks = [Mark(SOURCE, corners[-1])]
    if record.goal_mode != ABSENT:
        for number, (x, y) in enumerate(goals):
            own = (str(number), AGENT_COLORS[number % len(AGENT_COLORS)])
            look = own if record.own_goals else ("", GOAL_COLOR)
            marks.append(Mark(GOAL, (float(x), float(y)), *look))
    h, side = record.half_width, 2 * record.half_width + 1
    marks += number_robots(points)
    flags = list_flags(task, state, corners[:-1])
    return Picture((-h, -h), side, side, tuple(marks), tuple(corners), (), flags, caption)


@draw.register
def draw_taxi(record: Taxi, task: Task, state: Integers, caption: str) -> Picture:
    """Dietterich's map; a passenger has the colour of the station that he wants to go to."""
    stations = {
        _place_taxi_cell(WIDTH * row + column): name for name, (row, column) in STATIONS.items()
    }
    marks = [Mark(STATION, at, name, STATION_COLORS[name]) for at, name in stations.items()]
    taxis = [_place_taxi_cell(cell) for cell in state[task.layout["taxis"]]]
    for number, at in enumerate(taxis):
        marks.append(Mark(TAXI, at, str(number), AGENT_COLORS[number]))
    for number, status in enumerate(state[task.layout["passengers"]]):
        origin = _place_taxi_cell(record.origins[number])
        destination = _place_taxi_cell(record.destinations[number])
        x, y = (origin, *taxis, destination)[status]
        aside = 0.0 if 0 < status <= len(taxis) else 0.28 * number - 0.1
        color = STATION_COLORS[stations[destination]]
        marks.append(Mark(PASSENGER, (x + aside, y - 0.2), str(number), color))
    walls = [
        compute_side(*_place_taxi_cell(cell), *_STEPS[way])
        for cell in range(WIDTH**2)
        for way, wall in zip(("up", "right", "down", "left"), record.walls[cell], strict=True)
        if wall
    ]
    flags = list_flags(task, state, taxis)
    return Picture((0, 0), WIDTH, WIDTH, tuple(marks), (), tuple(walls), flags, caption)


def _place_taxi_cell(number: int) -> Point:
    """Returns column and row, counted upwards, of a cell of the taxi's map."""
    return float(number % WIDTH), float(WIDTH - 1 - number // WIDTH)


def compute_side(x: float, y: float, dx: float, dy: float) -> tuple[Point, Point]:
    """Returns the ends of a cell's side in a direction."""
    middle, half = (x + dx / 2, y + dy / 2), (abs(dy) / 2, abs(dx) / 2)
    return (middle[0] - half[0], middle[1] - half[1]), (middle[0] + half[0], middle[1] + half[1])


def list_flags(task: Task, state: Integers, cells: list[Point]) -> tuple[tuple[Point, Point], ...]:
    """Returns the sides of the robots' cells whose flag is 1.

    A flag is called o_up for the agent that sees it, o_up_2 for robot 2 of a single agent.
    """
    places = {variable.name: place for place, variable in enumerate(task.variables)}
    flags = []
    for number, (x, y) in enumerate(cells):
        alone = task.n_agents == 1 and len(cells) > 1
        values = task.observe(state, 0 if alone else number)
        for name, (dx, dy) in _STEPS.items():
            place = places.get(f"o_{name}_{number}" if alone else f"o_{name}")
            if place is not None and values[place]:
                flags.append(((x + dx / 2, y + dy / 2), (x, y)))
    return tuple(flags)
