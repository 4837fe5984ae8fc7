"""What robots do in cells (thesis B.1): one robot steps to the next cell, the others hold.

A cell is `scene.cell_size` wide; cell c has its centre at the source plus c times that, in x and y,
and in z for robots that are driven there. On the shipped floors these are the cells of the line
task, so a state of the world is one of the line task (chapter 7).
"""

import math
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from hose_mj.errors import InputError, check_choice
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.protocol import Array
from hose_mj.world.driving import Driver
from hose_mj.world.world import World

# Cells by which each action moves a robot.
STEPS = {"up": (0, 1, 0), "down": (0, -1, 0), "left": (-1, 0, 0), "right": (1, 0, 0)}
STEPS |= {"none": (0, 0, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}
FLOOR_CELL = 0.05  # width of the thesis's cells (m), for which its tolerances and times are stated

Mode = Literal["drive", "force"]
Cells = npt.NDArray[np.int64]


def compute_cells(world: World, points: Array) -> Cells:
    """c(P) = round((P - source) / cell size) of points (..., 3), m."""
    source = world.data.site_xpos[world.sites[-1]]
    return np.asarray(np.round((points - source) / world.scene.cell_size), dtype=np.int64)


def compute_centres(world: World, cells: npt.ArrayLike) -> Array:
    """The centres (..., 3), m, of cells (..., 3)."""
    source = world.data.site_xpos[world.sites[-1]]
    return np.asarray(source + np.asarray(cells) * world.scene.cell_size)


class Actions:
    """Lets the robots of a world act, one at a time.

    `begin` an action, then call `update` before each step of the world until `is_done` after one.
    In the mode "drive" a servo brings the robot to the centre of the next cell: done within a tenth
    of a cell and a fifth of a cell per second, given up, `stalled`, after 2 s sqrt(cell / 5 cm);
    on the floor these are 5 mm, 1 cm/s and 2 s, and elsewhere, for carriers and wheeled
    bases alike, lengths scale with the cell and times with its root, as motions under the same
    accelerations do. In the mode "force" a force acts on the robot at its site for a fixed time
    while its motors rest (thesis B.1). All others hold their places with the same servo; so does
    a robot that does `none`, or that has stalled.

    Args:
        driver: of the world; its targets become the places held.
        mode: "drive" or "force".
        force: in the mode "force" (N).
        force_time: how long it acts (s).

    Attributes:
        names: of the actions, with +z and -z where a robot is driven along three axes.
        stalled: whether the last action was given up.
        robot, action: the robot that acts and what it does; None before the first action.
        turns, n_stalled: how many actions were begun and given up so far.

    Raises:
        InputError: an unknown mode, or a number that is not above 0.
    """

    def __init__(
        self, driver: Driver, mode: Mode = "drive", *, force: float = 2.0, force_time: float = 0.5
    ) -> None:
        check_choice("mode", mode, ("drive", "force"))
        for name, value in (("force", force), ("force_time", force_time)):
            if not 0.0 < value < math.inf:
                raise InputError(name, value, "a finite number above 0")
        self.driver, self.world, self.mode = driver, driver.world, mode
        self._force, self._force_time = force, force_time
        self.names = tuple(STEPS) if np.any(driver.axes == 3) else tuple(STEPS)[:5]
        cell = self.world.scene.cell_size
        self.tolerance = 0.1 * cell
        self.slowness = 0.2 * cell
        self.patience = 2.0 * math.sqrt(cell / FLOOR_CELL)
        self.stalled = False
        self.robot: int | None = None
        self.action: str | None = None
        self.turns = self.n_stalled = 0
        self._begun = 0.0
        self._runs = self._pushes = False

    def list_names(self, robot: int) -> tuple[str, ...]:
        """The actions that a robot has."""
        return self.names if self.driver.axes[robot] == 3 else self.names[:5]

    def compute_cells(self) -> Cells:
        """The robots' cells (N, 3)."""
        return compute_cells(self.world, self.world.site_positions()[:-1])

    def begin(self, robot: int, action: str) -> None:
        """Starts an action; one that still runs ends where its robot is.

        Raises:
            InputError: a robot or action that there is not.
        """
        if check_count("robot", robot, 0) >= self.world.n_robots:
            raise InputError("robot", robot, f"0 (tip) to {self.world.n_robots - 1}")
        check_choice("action", action, self.list_names(robot))
        step = np.array(STEPS[action])
        self._end()
        self.robot, self.action, self.stalled = robot, action, False
        self.turns += 1
        self._begun, self._runs = self.world.time, True
        self._pushes = self.mode == "force" and action != "none"
        if self._pushes:
            self.world.apply_force(robot, self._force * step)
        elif np.any(step):
            place = self.world.data.site_xpos[self.world.sites[robot]]
            next_cell = compute_centres(self.world, compute_cells(self.world, place) + step)
            moved = step != 0 if step[2] else np.array([True, True, False])
            self.driver.targets[robot] = np.where(moved, next_cell, self.driver.targets[robot])

    def update(self) -> None:
        """Writes the controls of the next step."""
        if self._pushes and self.robot is not None:
            self.driver.targets[self.robot] = self._find_place()
        self.driver.update()
        if self._pushes and self.robot is not None:
            self.driver.rest(self.robot)

    def is_done(self) -> bool:
        """Says whether the action has ended, to be asked after each step."""
        if self._runs and self.robot is not None:
            elapsed = self.world.time - self._begun
            if self.mode == "force":
                ended = elapsed >= self._force_time - 0.5 * self.world.timestep
            else:
                driver, robot = self.driver, self.robot
                is_near = elapsed > 0.0 and driver.compute_error(robot) <= self.tolerance
                arrived = is_near and driver.compute_speed(robot) <= self.slowness
                self.stalled = not arrived and elapsed >= self.patience
                self.n_stalled += self.stalled
                ended = arrived or self.stalled
            if ended:
                self._end()
        return not self._runs

    def describe(self) -> dict[str, Any]:
        """The turn, its owner and what it does, for recordings."""
        if self.robot is None:
            return {}
        owner = self.world.scene.robots[self.robot].name
        told = {"turn": self.turns, "owner": owner, "action": self.action}
        return {**told, "stalled": self.n_stalled}

    def _find_place(self) -> Array:
        return np.array(self.world.data.site_xpos[self.world.sites[self.robot]])

    def _end(self) -> None:
        """Ends what runs; a robot that was pushed or has stalled holds where it is."""
        if self._runs and self.robot is not None:
            if self._pushes:
                self.world.apply_force(self.robot, np.zeros(3))
            if self._pushes or self.stalled:
                self.driver.targets[self.robot] = self._find_place()
        self._runs = self._pushes = False
