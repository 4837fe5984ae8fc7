"""Policies by name: random moves, to the goal, and one for each kind of break.

All are deterministic: the same world and seed, the same controls.

Which of several scripts does what is wanted is rehearsed: each is played, and the world goes back.
A robot in a corridor cannot be told to stretch a hose by geometry alone: the hose hangs, catches
and whips. So the scripts are tried in order, on the world itself where its hose is a spline. Where
it is one of MuJoCo's, which takes far longer, they are tried on a spline hose in the same scene,
and what does there as wanted is then tried on the world itself: not all carries over.
"""

import heapq
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from hose_mj.constraints.kinds import KIND_OF, KINDS
from hose_mj.constraints.monitor import Break, Monitor
from hose_mj.errors import InputError, StepError, check_choice
from hose_mj.hoses.protocol import Array
from hose_mj.rollout import scripts
from hose_mj.rollout.episode import Policy, is_at_goal
from hose_mj.rollout.scripts import Obstacles, Player, Script, compute_reach, move, relax
from hose_mj.world.actions import Actions, Mode, compute_cells, compute_centres
from hose_mj.world.driving import Driver
from hose_mj.world.registry import make_world
from hose_mj.world.world import World

# A way for the tip through the cells that are free, and places behind it for the others

Cell = tuple[int, int, int]
HOSE_SAMPLES = 129
_CLEARANCE = 0.15  # distance kept to obstacles, as a share of a cell


class FreeCells:
    """The cells in which the tip's robot may be while nothing else moves.

    Its site starts at `start` (3,), m. With `hose`, cells that the hose covers are held, away from
    the tip's own place on it.
    """

    def __init__(self, driver: Driver, start: Array, *, hose: bool) -> None:
        world = driver.world
        self._world, self._size = world, world.scene.cell_size
        self._spatial = bool(driver.axes[0] == 3)
        self._obstacles = Obstacles(world, 0)
        self._site, self._start = world.site_positions()[0], start
        self._radius = compute_reach(world, 0)
        self._held, self._apart = self._list_held(hose)
        self._known: dict[Cell, bool] = {}

    def _list_held(self, hose: bool) -> tuple[Array, Array]:
        """Points that are held, and how far the tip's site has to stay from each."""
        world = self._world
        others = world.site_positions()[1:-1]
        apart = [self._radius + compute_reach(world, k) for k in range(1, world.n_robots)]
        if not hose:
            return others, np.array(apart)
        length = world.scene.spec.length
        arcs = np.linspace(0.0, length, HOSE_SAMPLES)
        own = np.maximum(3.0 * self._radius, 0.5 * (length - world.arc_lengths[1]))
        covered = world.hose_position(arcs[arcs < world.arc_lengths[0] - own])
        wide = np.full(len(covered), self._radius + world.scene.spec.outer_radius)
        return np.concatenate([others, covered]), np.concatenate([apart, wide])

    def is_free(self, cell: Cell) -> bool:
        """Says whether the tip's robot fits there."""
        if cell not in self._known:
            self._known[cell] = self._fits(compute_centres(self._world, cell))
        return self._known[cell]

    def _fits(self, place: Array) -> bool:
        if not self._spatial:
            place = np.array([*place[:2], self._site[2]])
        low, high = self._world.scene.bounds
        if np.any(place < low) or np.any(place > high):
            return False
        away = self._held - place
        if not self._spatial:
            away = away[:, :2]
        if np.any(np.linalg.norm(away, axis=1) < self._apart):
            return False
        margin = _CLEARANCE * self._size
        return self._obstacles.measure(place - self._site, 2.0 * margin) >= margin

    def find_path(self, goal: Cell) -> list[Cell] | None:
        """The shortest way from the tip's cell to a goal by A*, through sides and edges of cells.

        Diagonal steps need the cells on both sides of them free. The goal itself counts as free.
        """
        start = self._cell_of(self._start)
        reach = int(np.ceil(self._world.scene.spec.length / self._size)) + 1
        before: dict[Cell, Cell] = {}
        cost = {start: 0.0}
        queue = [(_distance(start, goal), start)]
        while queue:
            _, cell = heapq.heappop(queue)
            if cell == goal:
                path = [goal]
                while path[-1] in before:
                    path.append(before[path[-1]])
                return path[::-1]
            for step in _STEPS if self._spatial else _LEVEL_STEPS:
                following = (cell[0] + step[0], cell[1] + step[1], cell[2] + step[2])
                if max(map(abs, following)) > reach:
                    continue
                total = cost[cell] + float(np.linalg.norm(step))
                if total < cost.get(following, np.inf) and self._is_open(cell, step, goal):
                    cost[following], before[following] = total, cell
                    heapq.heappush(queue, (total + _distance(following, goal), following))
        return None

    def _is_open(self, cell: Cell, step: Cell, goal: Cell) -> bool:
        for part in product(*({0, s} for s in step)):
            beside = (cell[0] + part[0], cell[1] + part[1], cell[2] + part[2])
            if any(part) and beside != goal and not self.is_free(beside):
                return False
        return True

    def _cell_of(self, place: Array) -> Cell:
        x, y, z = (int(c) for c in compute_cells(self._world, place))
        return x, y, z if self._spatial else 0

    def find_goal(self) -> Cell:
        """The goal's cell."""
        return self._cell_of(self._world.goal_position())


@dataclass(frozen=True)
class GoalPlan:
    """How the tip is brought to the goal."""

    rise: int  # cells by which robots that can rise do so first; a hose that hangs low catches
    avoid: bool  # whether the tip avoids the hose; where it is all around, there is no such way
    pace: float  # how fast, as a share of what the robots can
    slack: float  # share of a segment that two neighbours may be apart

    def make_script(self, driver: Driver) -> Script | None:
        """The tip goes to the goal by the shortest free way; the others follow its trail.

        The trail leads from the source over the robots to the tip and on along the tip's way. A
        robot moves along it when the next one has gone farther than the slack allows; where the
        hose behind it is too short for that, all give way (`relax`).

        Returns:
            None where there is no way.
        """
        world = driver.world
        n, source = world.n_robots, world.site_positions()[-1]
        spans = self.slack * -np.diff(world.arc_lengths)
        places = self._rise(driver)
        cells = FreeCells(driver, places[0], hose=self.avoid)
        path = cells.find_path(cells.find_goal())
        if path is None:
            return None
        way = compute_centres(world, np.array(path[1:] or path))
        way[-1] = world.goal_position()
        if driver.axes[0] != 3:
            way[:, 2] = places[0, 2]
        trail = _Trail(np.concatenate([places[::-1], way]))
        along = trail.arcs[:n][::-1].copy()
        formations = [places] if self.rise else []
        for k in range(len(way)):
            along[0] = trail.arcs[n + k]
            for robot in range(1, n):
                ahead = trail.find(along[robot - 1])
                along[robot] = trail.follow(
                    *(along[robot], along[robot - 1], ahead, spans[robot - 1])
                )
            formation = np.array([trail.find(s) for s in along])
            formations.append(relax(formation, 0, source, spans))
        return Script(0, np.array(formations), self.pace)

    def _rise(self, driver: Driver) -> Array:
        """Returns where the robots are once they have risen (N, 3), m."""
        world = driver.world
        places = world.site_positions()[:-1]
        size, spatial = world.scene.cell_size, driver.axes == 3
        highest = np.maximum(places[:, 2], world.scene.bounds[1][2] - size)
        places[spatial, 2] = np.minimum(places[:, 2] + self.rise * size, highest)[spatial]
        return places


class _Trail:
    """A polyline by its arc length."""

    def __init__(self, points: Array) -> None:
        self._points = points
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        self.arcs = np.concatenate([[0.0], np.cumsum(steps)])

    def find(self, along: float) -> Array:
        return np.array([np.interp(along, self.arcs, self._points[:, c]) for c in range(3)])

    def follow(self, along: float, most: float, ahead: Array, span: float) -> float:
        """The first place from `along` on that is no farther than `span` from `ahead`."""
        for s in np.linspace(along, most, 200):
            if np.linalg.norm(self.find(float(s)) - ahead) <= span:
                return float(s)
        return most


def _distance(cell: Cell, goal: Cell) -> float:
    return float(np.linalg.norm(np.subtract(cell, goal)))


_STEPS: list[Cell] = [
    (x, y, z) for x, y, z in product((-1, 0, 1), repeat=3) if (x, y, z) != (0, 0, 0)
]
_LEVEL_STEPS = [step for step in _STEPS if step[2] == 0]


# Policies

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
LONGEST, LONGEST_OF_ALL = 5.0, 20.0  # simulated time of a trial, and of all, at most (s)
SLOWNESS = 4.0
"""How often time simulated with one of MuJoCo's hoses counts: it takes several times as long."""
PATIENCE = 1.5  # how much longer than its targets take a trial goes on, and a second more


@dataclass(frozen=True)
class RehearsedScript:
    """A script that was played, its first break, if any, and when it ended (s)."""

    script: Script
    broken: Break | None
    at_goal: bool  # whether the tip reached the goal before
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
        with world.unwatched():
            return self._play_unwatched(script, world, monitor)

    def _play_unwatched(self, script: Script, world: World, monitor: Monitor) -> RehearsedScript:
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
