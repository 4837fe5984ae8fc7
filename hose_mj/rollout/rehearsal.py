"""Which of several scripts does what is wanted, found by playing each and going back.

A robot in a corridor cannot be told to stretch a hose by geometry alone: the hose hangs, catches
and whips. So the scripts are tried in order, on the world itself where its hose is a spline. Where
it is one of MuJoCo's, which takes far longer, they are tried on a spline hose in the same scene,
and what does there as wanted is then tried on the world itself: not all carries over.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from hose_mj.constraints.breaks import Break
from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import StepError
from hose_mj.rollout.episode import is_at_goal
from hose_mj.rollout.scripts import Player, Script
from hose_mj.world.driving import Driver
from hose_mj.world.registry import make_world
from hose_mj.world.world import World

SLOW_MODELS = ("cable", "flex")
MOST_TRIALS = 24
LONGEST, LONGEST_OF_ALL = 5.0, 20.0
"""Simulated time of a trial, and of all, at most (s)."""
SLOWNESS = 4.0
"""How often time simulated with one of MuJoCo's hoses counts: it takes several times as long."""
PATIENCE = 1.5
"""How much longer than its targets take a trial goes on, and a second more."""


@dataclass(frozen=True)
class Trial:
    """What came of a script.

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
    """Plays scripts from the state that a world is in.

    Args:
        world: not changed, but for the time that a trial takes.
        monitor: of the world.
        ends_at_goal: whether a trial is over when the tip is at the goal.
    """

    def __init__(self, world: World, monitor: Monitor, *, ends_at_goal: bool) -> None:
        self._ends_at_goal = ends_at_goal
        self._stages = [(world, monitor)]
        if world.hose_model in SLOW_MODELS:
            twin = make_world(world.scene)
            self._stages.insert(0, (twin, Monitor(twin, monitor.limits)))

    def find(
        self, scripts: Iterable[Script], is_wanted: Callable[[Trial], bool]
    ) -> tuple[Trial | None, list[Trial]]:
        """Returns the first trial that is as wanted, None if none is, and all trials made."""
        trials: list[Trial] = []
        spent = 0.0
        for script in scripts:
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

    def _play(self, script: Script, world: World, monitor: Monitor) -> Trial:
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
            return Trial(script, broken, at_goal, world.time - begun)
        except StepError:
            return Trial(script, None, False, world.time - begun)
        finally:
            world.restore(before)
            monitor.reset()
