"""A way for the tip through the cells that are free, and places behind it for the others."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from itertools import product

import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.rollout.scripts import Obstacles, Script, compute_reach, relax
from hose_mj.world.actions import compute_cells, compute_centres
from hose_mj.world.driving import Driver

Cell = tuple[int, int, int]
HOSE_SAMPLES = 129
_CLEARANCE = 0.15
"""Distance kept to obstacles, as a share of a cell."""


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
    """How the tip is brought to the goal.

    Attributes:
        rise: cells by which robots that can rise do so first; a hose that hangs low catches.
        avoid: whether the tip avoids the hose; where it is all around, there is no such way.
        pace: how fast, as a share of what the robots can.
        slack: share of a segment that two neighbours may be apart.
    """

    rise: int
    avoid: bool
    pace: float
    slack: float

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
