"""Policies by name: random moves, to the goal, and one for each kind of break.

All are deterministic: the same world and seed, the same controls.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import InputError
from hose_mj.hoses.inputs import check_choice
from hose_mj.rollout.breaking import LISTS
from hose_mj.rollout.episode import Policy
from hose_mj.rollout.planning import Plan
from hose_mj.rollout.rehearsal import Rehearsal, Trial
from hose_mj.rollout.scripts import Player, move
from hose_mj.world.actions import Actions, Mode
from hose_mj.world.driving import Driver
from hose_mj.world.world import World

_LEVEL_PLANS = tuple(
    Plan(0, avoid, pace, slack)
    for avoid in (True, False)
    for pace in (1.0, 0.5)
    for slack in (0.85, 0.95, 0.75)
)
_RISING_PLANS = tuple(Plan(3, True, pace, slack) for pace in (1.0, 0.7) for slack in (0.85, 0.95))


class Random:
    """One robot after the other, the tip first, moves to a neighbouring cell at random.

    Args:
        mode: of the actions, "drive" or "force".
    """

    ends_at_goal = True

    def __init__(self, mode: Mode = "drive") -> None:
        self._mode: Mode = mode

    def start(self, world: World, monitor: Monitor, generator: np.random.Generator) -> None:
        """Begins with the tip's robot."""
        self._generator = generator
        self._actions = Actions(Driver(world), self._mode)

    def update(self) -> None:
        """Lets the next robot begin where the last has done, then drives all."""
        actions = self._actions
        if actions.is_done():
            robot = 0 if actions.robot is None else (actions.robot + 1) % actions.world.n_robots
            names = [name for name in actions.list_names(robot) if name != "none"]
            actions.begin(robot, names[self._generator.integers(len(names))])
        actions.update()

    def describe(self) -> Mapping[str, Any]:
        """The turn's owner and its move."""
        return self._actions.describe()


class ToGoal:
    """Drives the tip to the goal, the others after it so that the hose stays slack.

    Several plans are rehearsed; the first that reaches the goal is played, else the one that goes
    on for longest.
    """

    ends_at_goal = True

    def start(self, world: World, monitor: Monitor, generator: np.random.Generator) -> None:
        """Plans and rehearses."""
        driver = Driver(world)
        plans = (_RISING_PLANS if np.any(driver.axes == 3) else ()) + _LEVEL_PLANS
        scripts = (plan.make_script(driver) for plan in plans)
        rehearsal = Rehearsal(world, monitor, ends_at_goal=True)
        found, trials = rehearsal.find(
            (script for script in scripts if script is not None), lambda trial: trial.at_goal
        )
        straight = move(world, 0, {0: world.goal_position()})
        longest = max(trials, key=lambda trial: trial.time, default=None)
        best = found or longest
        self._player = Player(driver, best.script if best else straight)
        self._owner = world.scene.robots[0].name

    def update(self) -> None:
        """Drives all."""
        self._player.update()

    def describe(self) -> Mapping[str, Any]:
        """That the tip's robot goes to the goal."""
        return {"owner": self._owner, "action": "to the goal"}


class Breaking:
    """Breaks one constraint of a kind before any other.

    Scripts from the scene's geometry are rehearsed; the first with that break is played.

    Args:
        kind: "stretch", "run-over", "collision", "obstacle" or "bounds".
    """

    ends_at_goal = False

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def start(self, world: World, monitor: Monitor, generator: np.random.Generator) -> None:
        """Finds a script.

        Raises:
            InputError: the world has no such constraint, or no script that was tried breaks it
                before another.
        """
        if self.kind not in monitor.kinds:
            raise InputError("policy", f"break-{self.kind}", _WANTED[self.kind])
        broken = monitor.reset()
        if broken is not None:
            valid = f"a start that breaks nothing ({broken.describe()})"
            raise InputError("policy", f"break-{self.kind}", valid)
        driver = Driver(world)
        rehearsal = Rehearsal(world, monitor, ends_at_goal=False)
        found, trials = rehearsal.find(LISTS[self.kind](driver), self._is_wanted)
        if found is None:
            valid = (
                f"a scene with room for it: here {len(trials)} ways were tried, and each broke "
                f"another constraint first or none"
            )
            raise InputError("policy", f"break-{self.kind}", valid)
        self._player = Player(driver, found.script)
        self._owner = world.scene.robots[found.script.robot].name

    def update(self) -> None:
        """Drives all."""
        self._player.update()

    def describe(self) -> Mapping[str, Any]:
        """Which robot breaks what."""
        return {"owner": self._owner, "action": f"break {self.kind}"}

    def _is_wanted(self, trial: Trial) -> bool:
        return trial.broken is not None and trial.broken.kind == self.kind


_WANTED = {
    "stretch": "a scene with a hose",
    "run-over": "a scene with a hose and a robot that has a solid geom",
    "collision": "a scene with two robots or more (floor_2 to floor_6, corridor, deck, lift)",
    "obstacle": "a scene with solid geoms to run into (corridor, deck, lift)",
    "bounds": "a scene with a numeric bounds (floor_1 to floor_6, corridor, deck, lift)",
}

POLICIES = ("random", "to-goal", *(f"break-{kind}" for kind in LISTS))
"""Names of the policies."""


def make_policy(name: str) -> Policy:
    """Returns a policy by name.

    Raises:
        InputError: an unknown name.
    """
    check_choice("policy", name, POLICIES)
    if name == "random":
        return Random()
    return ToGoal() if name == "to-goal" else Breaking(name.removeprefix("break-"))
