"""Policies by name: random moves, to the goal, and one for each kind of break.

All are deterministic: the same world and seed, the same controls.

Which of several scripts does what is wanted is rehearsed: each is played, and the world goes back.
A robot in a corridor cannot be told to stretch a hose by geometry alone: the hose hangs, catches
and whips. So the scripts are tried in order, on the world itself where its hose is a spline. Where
it is one of MuJoCo's, which takes far longer, they are tried on a spline hose in the same scene,
and what does there as wanted is then tried on the world itself: not all carries over.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hose_mj.constraints.kinds import KIND_OF, KINDS
from hose_mj.constraints.monitor import Break, Monitor
from hose_mj.errors import InputError, StepError, check_choice
from hose_mj.rollout import scripts
from hose_mj.rollout.episode import Policy, is_at_goal
from hose_mj.rollout.planning import GoalPlan
from hose_mj.rollout.scripts import Player, Script, move
from hose_mj.world.actions import Actions, Mode
from hose_mj.world.driving import Driver
from hose_mj.world.registry import make_world
from hose_mj.world.world import World

_LEVEL_PLANS = tuple(
    GoalPlan(0, avoid, pace, slack)
    for avoid in (True, False)
    for pace in (1.0, 0.5)
    for slack in (0.85, 0.95, 0.75)
)
_RISING_PLANS = tuple(
    GoalPlan(3, True, pace, slack) for pace in (1.0, 0.7) for slack in (0.85, 0.95)
)


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


class _Scripted:
    """Plays a script that was found."""

    def _play(self, driver: Driver, script: Script, robot: int, action: str) -> None:
        self._player = Player(driver, script)
        self._told = {"owner": driver.world.scene.robots[robot].name, "action": action}

    def update(self) -> None:
        """Drives all robots."""
        self._player.update()

    def describe(self) -> Mapping[str, Any]:
        """Says which robot it is about, and what it does."""
        return self._told


class ToGoal(_Scripted):
    """Drives the tip to the goal, the others after it so that the hose stays slack.

    Several plans are rehearsed; the first that reaches the goal is played, else the one that goes
    on for longest.
    """

    ends_at_goal = True

    def start(self, world: World, monitor: Monitor, generator: np.random.Generator) -> None:
        """Plans and rehearses."""
        driver = Driver(world)
        plans = (_RISING_PLANS if np.any(driver.axes == 3) else ()) + _LEVEL_PLANS
        ways = (plan.make_script(driver) for plan in plans)
        rehearsal = Rehearsal(world, monitor, ends_at_goal=True)
        found, trials = rehearsal.find(
            (way for way in ways if way is not None), lambda trial: trial.at_goal
        )
        straight = move(world, 0, {0: world.goal_position()})
        longest = max(trials, key=lambda trial: trial.time, default=None)
        best = found or longest
        self._play(driver, best.script if best else straight, 0, "to the goal")


class Breaking(_Scripted):
    """Breaks one constraint of a kind before any other.

    Scripts from the scene's geometry are rehearsed; the first with that break is played.

    Args:
        kind: name of one of `KINDS`.
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
            raise InputError("policy", f"break-{self.kind}", KIND_OF[self.kind].needs)
        broken = monitor.reset()
        if broken is not None:
            valid = f"a start that breaks nothing ({broken.describe()})"
            raise InputError("policy", f"break-{self.kind}", valid)
        driver = Driver(world)
        list_scripts = getattr(scripts, KIND_OF[self.kind].script)
        rehearsal = Rehearsal(world, monitor, ends_at_goal=False)
        found, trials = rehearsal.find(
            list_scripts(driver),
            lambda one: one.broken is not None and one.broken.kind == self.kind,
        )
        if found is None:
            valid = (
                f"a scene with room for it: here {len(trials)} ways were tried, and each broke "
                f"another constraint first or none"
            )
            raise InputError("policy", f"break-{self.kind}", valid)
        self._play(driver, found.script, found.script.robot, f"break {self.kind}")


_BREAKABLE = sorted(KINDS, key=lambda kind: not kind.other)
"""Kinds of breaks between two parties come first."""
POLICIES = ("random", "to-goal", *(f"break-{kind.name}" for kind in _BREAKABLE))
"""Names of the policies."""


def make_policy(name: str) -> Policy:
    """Returns a policy by name; `InputError` for an unknown name."""
    check_choice("policy", name, POLICIES)
    if name == "random":
        return Random()
    return ToGoal() if name == "to-goal" else Breaking(name.removeprefix("break-"))


SLOW_MODELS = ("cable", "flex")
MOST_TRIALS = 24
LONGEST, LONGEST_OF_ALL = 5.0, 20.0
"""Simulated time of a trial, and of all, at most (s)."""
SLOWNESS = 4.0
"""How often time simulated with one of MuJoCo's hoses counts: it takes several times as long."""
PATIENCE = 1.5
"""How much longer than its targets take a trial goes on, and a second more."""


@dataclass(frozen=True)
class RehearsedScript:
    """A script that was played, and what came of it.

    Attributes:
        script: played.
        broken: its first break; None where there was none.
        at_goal: whether the tip reached the goal before.
        time: when it ended (s).
    """

    script: Script
    broken: Break | None
    at_goal: bool
    time: float


class Rehearsal:
    """Plays scripts from the state that a world is in, which is not changed but for its time.

    With `ends_at_goal` a trial is over when the tip is at the goal.
    """

    def __init__(self, world: World, monitor: Monitor, *, ends_at_goal: bool) -> None:
        self._ends_at_goal = ends_at_goal
        self._stages = [(world, monitor)]
        if world.hose_model in SLOW_MODELS:
            spline = make_world(world.scene)
            self._stages.insert(0, (spline, Monitor(spline, monitor.limits)))

    def find(
        self, tried: Iterable[Script], is_wanted: Callable[[RehearsedScript], bool]
    ) -> tuple[RehearsedScript | None, list[RehearsedScript]]:
        """Returns the first trial that is as wanted, None if none is, and all trials made."""
        trials: list[RehearsedScript] = []
        spent = 0.0
        for script in tried:
            if len(trials) == MOST_TRIALS or spent > LONGEST_OF_ALL:
                break
            for stage in self._stages:
                trial = self._play(script, *stage)
                slow = stage[0].hose_model in SLOW_MODELS
                spent += trial.time * (SLOWNESS if slow else 1.0)
                if not is_wanted(trial):
                    break
            trials.append(trial)
            if is_wanted(trial):
                return trial, trials
        return None, trials

    def _play(self, script: Script, world: World, monitor: Monitor) -> RehearsedScript:
        before = world.snapshot()
        begun = world.time
        monitor.reset()
        driver = Driver(world)
        player = Player(driver, script)
        most = min(LONGEST, PATIENCE * player.time + 1.0)
        broken, at_goal = None, False
        try:
            while broken is None and not at_goal and world.time - begun < most:
                player.update()
                world.step()
                broken = monitor.check()
                at_goal = self._ends_at_goal and broken is None and is_at_goal(world)
            return RehearsedScript(script, broken, at_goal, world.time - begun)
        except StepError:
            return RehearsedScript(script, None, False, world.time - begun)
        finally:
            world.restore(before)
            monitor.reset()
