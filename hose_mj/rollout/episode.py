"""`run_episode`: a policy acts in a world until a break, the goal or the end of its time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from hose_mj.constraints.monitor import Break, Monitor
from hose_mj.errors import InputError
from hose_mj.world.world import World

EndedBy = Literal["break", "goal", "duration"]
SAMPLE_RATE = 25.0  # samples per simulated second: what a film shows


class Policy(Protocol):
    """What chooses the motors' controls."""

    ends_at_goal: bool  # whether the episode is over when the tip is at the goal

    def start(self, world: World, monitor: Monitor, generator: np.random.Generator) -> None:
        """Called once, at the state in which the episode starts."""
        ...

    def update(self) -> None:
        """Writes `world.control` for the next step; called before each."""
        ...

    def describe(self) -> Mapping[str, Any]:
        """Says what it does now, all optional.

        `turn` (its number), `owner` (the name of the robot whose turn it is), `action`, `vetoed`
        (names of actions), `stalled` (actions given up so far).
        """
        ...


class Observer(Protocol):
    """What watches an episode; it changes nothing in the world."""

    def start(self, world: World, monitor: Monitor, settings: Mapping[str, Any]) -> None:
        """Called once, at the state in which the episode starts."""
        ...

    def sample(self, world: World, monitor: Monitor, info: Mapping[str, Any]) -> None:
        """Called at the start, then at the sampling rate, and at the end.

        The monitor has just checked the world; `info` is what `Policy.describe` says, and
        `margins`.
        """
        ...

    def finish(self, outcome: EpisodeResult) -> None:
        """Called once, after the last sample."""
        ...


@dataclass(frozen=True)
class EpisodeResult:
    """How an episode ended, with which break, if any, and how long it took, simulated (s)."""

    steps: int
    sim_time: float
    ended_by: EndedBy
    broken: Break | None
    stalled: int  # actions that robots gave up


def is_at_goal(world: World) -> bool:
    """Says whether the tip's robot is within half a cell of the goal, in x and y.

    Where the goal is a cell's centre, as on the shipped floors, the two share a cell. A goal in the
    air, more than a cell above or below the robot, counts only within half a cell's height too.
    """
    cell = world.scene.cell_size
    away = abs(world.data.site_xpos[world.sites[0]] - world.goal_position())
    return bool(away[0] <= 0.5 * cell and away[1] <= 0.5 * cell and away[2] <= cell)


def run_episode(
    world: World,
    monitor: Monitor,
    policy: Policy,
    *,
    duration: float,
    observers: Sequence[Observer] = (),
    sample_rate: float = SAMPLE_RATE,
    generator: np.random.Generator | None = None,
    settings: Mapping[str, Any] | None = None,
) -> EpisodeResult:
    """Runs one episode from the world's present state.

    Args:
        world: acted in.
        monitor: of the world; its first break ends the episode.
        policy: acts.
        duration: simulated time after which the episode ends (s).
        observers: watch, in this order.
        sample_rate: samples per simulated second.
        generator: for all that the policy leaves to chance; one with seed 0 by default.
        settings: for the observers.

    Raises:
        InputError: a duration or rate that is not above 0.
        StepError: a step that cannot be finished.
    """
    for name, value in (("duration", duration), ("sample_rate", sample_rate)):
        if not 0.0 < value < np.inf:
            raise InputError(name, value, "a finite number above 0")
    monitor.reset()
    policy.start(world, monitor, generator or np.random.default_rng(0))
    for observer in observers:
        observer.start(world, monitor, settings or {})
    begun, steps, sampled = world.time, 0, 0
    most = max(1, round(duration / world.timestep))
    broken: Break | None = None
    ended_by: EndedBy | None = None
    _sample(observers, world, monitor, policy)
    while ended_by is None:
        policy.update()
        world.step()
        steps += 1
        broken = monitor.check()
        if broken is not None:
            ended_by = "break"
        elif policy.ends_at_goal and is_at_goal(world):
            ended_by = "goal"
        elif steps >= most:
            ended_by = "duration"
        due = int((world.time - begun) * sample_rate + 1e-9)
        if due > sampled or ended_by is not None:
            sampled = due
            _sample(observers, world, monitor, policy)
    stalled = int(policy.describe().get("stalled", 0))
    outcome = EpisodeResult(steps, world.time - begun, ended_by, broken, stalled)
    for observer in observers:
        observer.finish(outcome)
    return outcome


def _sample(observers: Sequence[Observer], world: World, monitor: Monitor, policy: Policy) -> None:
    if observers:
        info = {**policy.describe(), "margins": monitor.margins}
        for observer in observers:
            observer.sample(world, monitor, info)
