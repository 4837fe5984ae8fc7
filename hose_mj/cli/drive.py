"""`hose-mj drive`: a person drives the robots by keyboard in MuJoCo's passive viewer."""

from __future__ import annotations

import math
import os
import queue
import sys
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.errors import InputError, check_choice
from hose_mj.recording.document import make_document, print_document
from hose_mj.world.registry import WORLDS, make_world

if TYPE_CHECKING:
    from hose_mj.world.world import World

SPACE, BACKSPACE = 32, 259
ARROWS = {265: (0, 1, 0), 264: (0, -1, 0), 263: (-1, 0, 0), 262: (1, 0, 0)}
HEIGHT = {266: (0, 0, 1), 267: (0, 0, -1)}
"""GLFW's codes of the keys: arrows, page up and page down."""
PICTURES_PER_SECOND = 50.0
HELP = """keys: 0 to 9 choose a robot (0 is the tip's), arrows move it by a cell,
page up and page down lift and lower one that flies, space stops all,
backspace starts again; close the window to end"""


@dataclass(frozen=True)
class Args:
    """Drive the robots of a scene with the keyboard and see what breaks.

    Number keys choose a robot (0 is the tip's), the arrows move it from cell to cell, page up and
    page down lift and lower one that flies, space stops all, backspace starts again. A broken
    constraint is told in the terminal.
    """

    scene: Annotated[str, tyro.conf.Positional]
    """A shipped scene (floor_1 to floor_6, corridor, deck, lift), or your own MJCF file."""
    model: str = "geds"  # The hose's model: geds, cable or flex.
    json: bool = False
    """Print one JSON document on stdout when the window is closed; messages go to stderr."""


class Desk:
    """What the keys do to a world; the window is elsewhere, so that tests need none.

    Args:
        world: driven.
        tell: prints a line.

    Attributes:
        robot: the one that the arrows move.
        breaks: how many constraints broke.
    """

    def __init__(self, world: World, tell: Any = print) -> None:
        from hose_mj.constraints.monitor import Monitor
        from hose_mj.world.driving import Driver

        self.world, self._tell = world, tell
        self.monitor = Monitor(world)
        self.driver = Driver(world)
        self.robot = self.breaks = 0
        self._keys: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._start = world.snapshot()
        self._was_at_goal = False

    def press(self, key: int) -> None:
        """Takes a key, by GLFW's code; from any thread."""
        self._keys.put(key)

    def advance(self, duration: float) -> None:
        """Does what the keys say, then goes on for a simulated time (s)."""
        from hose_mj.rollout.episode import is_at_goal

        while not self._keys.empty():
            self._obey(self._keys.get())
        for _ in range(max(1, round(duration / self.world.timestep))):
            self.driver.update()
            self.world.step()
            broken = self.monitor.check()
            if broken is not None:
                self.breaks += 1
                self._tell(f"{broken.kind}: {broken.describe()}")
        at_goal = is_at_goal(self.world)
        if at_goal and not self._was_at_goal:
            self._tell(f"{self.world.time:.3f} s: the tip is at the goal")
        self._was_at_goal = at_goal

    def _obey(self, key: int) -> None:
        if ord("0") <= key <= ord("9"):
            robot = key - ord("0")
            if robot < self.world.n_robots:
                self.robot = robot
                self._tell(f"robot {robot}: {self.world.scene.robots[robot].name}")
        elif key in ARROWS or key in HEIGHT:
            for axis, cells in enumerate((ARROWS | HEIGHT)[key]):
                self.driver.targets[self.robot, axis] += cells * self.world.scene.cell_size
        elif key == SPACE:
            self.driver.drive_to(self.world.site_positions()[:-1])
        elif key == BACKSPACE:
            self.world.restore(self._start)
            self.monitor.reset()
            self.driver.drive_to(self.world.site_positions()[:-1])


def run(args: Args) -> int:
    """Opens the viewer; 0 when its window is closed."""
    check_choice("model", args.model, WORLDS)
    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform == "linux" and not named:
        valid = "a display (DISPLAY or WAYLAND_DISPLAY); without one, hose-mj rollout --save F.rrd"
        raise InputError("display for drive", None, valid)
    desk = Desk(make_world(args.scene, args.model), lambda line: print(line, file=sys.stderr))
    print(HELP, file=sys.stderr)
    _show(desk)
    if args.json:
        world = desk.world
        health = world.health and world.health.summarize()
        results = {"sim_time": world.time, "breaks": desk.breaks, "health": health}
        print_document(make_document("drive", args, results=results))
    return 0


def _show(desk: Desk) -> None:
    """Runs in real time until the window is closed."""
    import mujoco.viewer

    from hose_mj.rollout.video import draw_hose

    world = desk.world
    gravity = math.hypot(*world.model.opt.gravity)
    limit = desk.monitor.limits.compute_tension_limit(world.scene.spec, gravity)
    span = 1.0 / PICTURES_PER_SECOND
    with mujoco.viewer.launch_passive(
        world.model, world.data, key_callback=desk.press, show_left_ui=False, show_right_ui=False
    ) as viewer:
        while viewer.is_running():
            begun = time.perf_counter()
            with viewer.lock():
                desk.advance(span)
                viewer.user_scn.ngeom = 0
                draw_hose(viewer.user_scn, world, limit)
            viewer.sync()
            time.sleep(max(0.0, span - (time.perf_counter() - begun)))
