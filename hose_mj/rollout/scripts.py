"""`Script`: formations that robots go through, `Player` drives them, and what may break what.

`list_*` list scripts that may break a constraint of a kind (kinds.py names them in the kind's row),
the likeliest first, from a scene's geometry.
"""

import math
from dataclasses import dataclass
from itertools import permutations

import mujoco
import numpy as np
from numpy.typing import NDArray

from hose_mj.hoses.protocol import Array
from hose_mj.world.driving import Driver
from hose_mj.world.world import World


@dataclass(frozen=True)
class Script:
    """Places of all robots' sites, one formation after the other.

    Between two formations all robots move straight and arrive together, so two that are near enough
    for their hose in both formations are so in between (a distance is a convex function).
    """

    robot: int  # the one it is about
    formations: Array  # (k, N, 3), m
    pace: float = 1.0  # how fast it is played, as a share of what the robots can


def move(world: World, robot: int, *changes: dict[int, Array]) -> Script:
    """A script in which some robots go to places (3,), one dict for each formation."""
    places = world.site_positions()[:-1]
    formations = []
    for change in changes:
        for k, place in change.items():
            places[k] = place
        formations.append(places.copy())
    return Script(robot, np.array(formations))


def relax(formation: Array, fixed: int, source: Array, spans: Array) -> Array:
    """Draws robots together until no two neighbours, the source included, are too far apart.

    Passes up and down the hose alternate, as in Aristidou and Lasenby's FABRIK (2011), but with
    lengths that are limits: they end at such a formation where there is one. The sites are at (N,
    3), m, the robot `fixed` stays; `spans` are how far each may be from the next one along the hose
    (N,), m.
    """
    chain = np.concatenate([formation, source[None]])
    n = len(formation)
    for _ in range(_PASSES):
        for k in range(fixed + 1, n):
            chain[k] = _draw(chain[k], chain[k - 1], spans[k - 1])
        for k in range(n - 1, fixed, -1):
            chain[k] = _draw(chain[k], chain[k + 1], spans[k])
    for k in range(fixed - 1, -1, -1):
        chain[k] = _draw(chain[k], chain[k + 1], spans[k])
    return chain[:-1]


def _draw(place: Array, other: Array, span: float) -> Array:
    away = place - other
    distance = float(np.linalg.norm(away))
    return place if distance <= span else np.asarray(other + away * span / distance)


_PASSES = 20


class Player:
    """Drives the robots of a world through a script, then holds them at its end.

    `time` is when the targets are at its end (s).
    """

    def __init__(self, driver: Driver, script: Script) -> None:
        self._driver, self.script = driver, script
        # Bases have to turn before they drive.
        speed = script.pace * driver.speed * (0.5 if driver.wheeled else 1.0)
        self._formations = np.concatenate([driver.targets[None], script.formations])
        steps = np.linalg.norm(np.diff(self._formations, axis=0), axis=2).max(axis=1)
        self._times = np.concatenate([[0.0], np.cumsum(steps / speed)])
        self._begun = driver.world.time
        self.time = float(self._times[-1])

    def update(self) -> None:
        """Writes the controls of the next step."""
        elapsed = self._driver.world.time - self._begun
        times, formations = self._times, self._formations
        k = min(int(np.searchsorted(times, elapsed, side="right")), len(times) - 1)
        span = times[k] - times[k - 1]
        share = min(1.0, (elapsed - times[k - 1]) / span) if span > 0.0 else 1.0
        self._driver.drive_to((1.0 - share) * formations[k - 1] + share * formations[k])
        self._driver.update()


_ANGLES = tuple(math.radians(a) for a in (0, 30, -30, 60, -60, 90, -90, 135, -135))
_DETOURS = tuple(math.radians(a) for a in (30, -30, 60, -60))
_BEYOND = 1.5  # how much farther than a segment is long its ends are driven apart
_BEHIND = 0.5  # how far behind an obstacle or a bound a robot is driven, in cells
_SLACK = 0.95  # share of a segment that neighbours may be apart where some follow another
_SHARES = (0.5, 0.35, 0.65, 0.2, 0.8)  # where along a segment it is run over, the middle first


def list_stretches(driver: Driver) -> list[Script]:
    """Two neighbours driven apart, by one of them or by both; or the last robot from the source."""
    world = driver.world
    sites, arcs = world.site_positions(), world.arc_lengths
    found = []
    for robot in range(world.n_robots):
        here, there = sites[robot], sites[robot + 1]
        far = _BEYOND * (arcs[robot] - arcs[robot + 1])
        for angle in _ANGLES:
            away = _turn(_point(there, here), angle)
            scripts = [move(world, robot, {robot: there + far * away})]
            if robot + 1 < world.n_robots:
                middle, half = 0.5 * (here + there), 0.5 * far * away
                both = {robot: middle + half, robot + 1: middle - half}
                scripts.append(move(world, robot, both))
            found += scripts
    return _sort(driver, found, room=1.0 / _BEYOND)


def list_run_overs(driver: Driver) -> list[Script]:
    """A robot driven across each segment, at several places, those it does not hold first.

    Each way is taken alone, then with the others following so that segments stay slack.
    """
    world = driver.world
    sites, arcs = world.site_positions(), world.arc_lengths
    found: list[tuple[int, float, Script]] = []
    for robot in range(world.n_robots):
        radius = compute_reach(world, robot)
        for segment in range(world.n_robots):
            own = segment in (robot, robot - 1)
            for share in _SHARES:
                arc = arcs[segment + 1] + share * (arcs[segment] - arcs[segment + 1])
                if abs(arc - arcs[robot]) < 4.0 * radius:
                    continue
                point = _level(driver, robot, world.hose_position(arc)[0])
                across = point + 2.0 * radius * _point(sites[robot], point)
                distance = float(np.linalg.norm(point - sites[robot]))
                found.append((own, distance, move(world, robot, {robot: across})))
    alone = [script for _, _, script in sorted(found, key=lambda item: item[:2])]
    return [way for script in alone for way in (script, _follow(driver, script))]


def list_collisions(driver: Driver) -> list[Script]:
    """A robot driven at another, straight or from a side; robots that share no segment first."""
    world = driver.world
    sites = world.site_positions()
    found: list[tuple[int, float, Script]] = []
    for robot, other in permutations(range(world.n_robots), 2):
        here, there = sites[robot], _level(driver, robot, sites[other])
        apart = compute_reach(world, robot) + compute_reach(world, other)
        distance = float(np.linalg.norm(there - here))
        for k, angle in enumerate(_ANGLES):
            if angle == 0.0:
                script = move(world, robot, {robot: there})
            else:
                beside = there + 1.5 * apart * _turn(_point(there, here), angle)
                script = move(world, robot, {robot: beside}, {robot: there})
            found.append((k // 2, distance, script))
    return [script for _, _, script in sorted(found, key=lambda item: item[:2])]


def list_exits(driver: Driver) -> list[Script]:
    """A robot driven out of the bounds, the nearest first."""
    world = driver.world
    sites = world.site_positions()
    found: list[tuple[float, Script]] = []
    for robot in range(world.n_robots):
        for axis in range(driver.axes[robot]):
            for bound, sense in zip(world.scene.bounds, (-1.0, 1.0), strict=True):
                if math.isfinite(bound[axis]):
                    distance = abs(bound[axis] - sites[robot, axis])
                    step = np.zeros(3)
                    step[axis] = sense * (distance + _BEHIND * world.scene.cell_size)
                    found += _list_ways(driver, robot, step)
    return [script for _, script in sorted(found, key=lambda item: item[0])]


def list_obstacle_hits(driver: Driver) -> list[Script]:
    """A robot driven at an obstacle, the nearest first; straight, or from a side.

    From a side, since straight ahead the hose may lie between the two and be squeezed.
    """
    world = driver.world
    found: list[tuple[float, Script]] = []
    for robot in range(world.n_robots):
        obstacles = Obstacles(world, robot)
        for geom in obstacles.others:
            _, towards = obstacles.find(int(geom), np.zeros(3), world.scene.spec.length)
            towards[driver.axes[robot] :] = 0.0
            length = float(np.linalg.norm(towards))
            if length > 0.0:
                step = towards * (1.0 + _BEHIND * world.scene.cell_size / length)
                found += _list_ways(driver, robot, step)
                found += _list_detours(driver, robot, step)
    return [script for _, script in sorted(found, key=lambda item: item[0])]


def _list_ways(driver: Driver, robot: int, step: Array) -> list[tuple[float, Script]]:
    """A robot moves by a step, alone or with others so that segments stay slack; and how far."""
    world = driver.world
    sites = world.site_positions()
    distance = float(np.linalg.norm(step))
    alone = move(world, robot, {robot: sites[robot] + step})
    spans = -np.diff(world.arc_lengths)
    ways = [(distance, alone)]
    for cost, slack, pace in ((1.2, 0.9, 1.0), (2.0, 0.75, 1.0), (2.5, 0.9, 0.5)):
        together = relax(alone.formations[0], robot, sites[-1], slack * spans)
        ways.append((cost * distance, Script(robot, together[None], pace)))
    return ways


def _follow(driver: Driver, script: Script) -> Script:
    """The same with the other robots drawn after the one it is about."""
    source, spans = driver.world.site_positions()[-1], -_SLACK * np.diff(driver.world.arc_lengths)
    drawn = [relax(places, script.robot, source, spans) for places in script.formations]
    return Script(script.robot, np.array(drawn), script.pace)


def _list_detours(driver: Driver, robot: int, step: Array) -> list[tuple[float, Script]]:
    """A robot moves by a step, but ends it from a side; and how far, the turns counted double."""
    world = driver.world
    sites = world.site_positions()
    end = sites[robot] + step
    ways = []
    for angle in _DETOURS:
        beside = end - _turn(step, angle)
        script = move(world, robot, {robot: beside}, {robot: end})
        first, length = (float(np.linalg.norm(v)) for v in (beside - sites[robot], step))
        ways.append((2.0 * first + length, script))
    return ways


def _sort(driver: Driver, scripts: list[Script], room: float) -> list[Script]:
    """Scripts that stay in the bounds and clear of others first, then short ones."""
    world = driver.world
    sites = world.site_positions()[:-1]
    low, high = (np.array(bound) for bound in world.scene.bounds)

    def rate(script: Script) -> tuple[int, float]:
        last = script.formations[-1]
        moved = np.linalg.norm(last - sites, axis=1)
        ends = sites + room * (last - sites)
        out = bool(np.any(ends < low) or np.any(ends > high))
        return int(out) + _count_meetings(world, script, room), float(moved.max())

    return sorted(scripts, key=rate)


def _count_meetings(world: World, script: Script, room: float) -> int:
    """Counts how many pairs of robots come too close on the way of a script with one formation."""
    sites = world.site_positions()[:-1]
    reach = [compute_reach(world, k) for k in range(world.n_robots)]
    steps = room * (script.formations[-1] - sites)
    count = 0
    for i in range(world.n_robots):
        for j in range(i + 1, world.n_robots):
            shares = np.linspace(0.0, 1.0, 17)[:, None]
            apart = sites[i] - sites[j] + shares * (steps[i] - steps[j])
            near = np.linalg.norm(apart[:, :2], axis=1).min()
            count += bool(near < reach[i] + reach[j] and np.any(steps[[i, j]]))
    return count


def _level(driver: Driver, robot: int, point: Array) -> Array:
    """A point at the height of a robot that is driven in the plane."""
    if driver.axes[robot] == 3:
        return point
    return np.array([*point[:2], driver.targets[robot, 2]])


def _point(start: Array, end: Array) -> Array:
    """The unit vector from one point to another, along x where they are one."""
    step = end - start
    length = float(np.linalg.norm(step))
    return step / length if length > 0.0 else np.array([1.0, 0.0, 0.0])


def _turn(vector: Array, angle: float) -> Array:
    """A vector turned about the vertical."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])


class Obstacles:
    """Distances of a robot to the scene around it, at the state that the world is in.

    Planes that face up are floors and stand in nobody's way, nor does what the robot stands on or
    touches at the start.
    """

    def __init__(self, world: World, robot: int) -> None:
        model = world.model
        self._model = model
        self._data = mujoco.MjData(model)
        self._data.qpos[:] = world.data.qpos
        mujoco.mj_kinematics(model, self._data)
        self.geoms = find_solid(world, np.asarray(world.robot_bodies[robot]))
        self._own = np.array(self._data.geom_xpos[self.geoms])
        moving = np.concatenate(world.robot_bodies)
        fixed = np.flatnonzero(model.body_weldid == 0)
        fixed = np.setdiff1d(fixed, moving)
        self.others = np.array(
            [g for g in find_solid(world, fixed) if not self._is_ground(int(g))], np.int64
        )

    def measure(self, offset: Array, most: float) -> float:
        """Clearance (m) of the robot moved by an offset (3,); `most` where it is larger."""
        return min((self.find(int(g), offset, most)[0] for g in self.others), default=most)

    def find(self, obstacle: int, offset: Array, most: float) -> tuple[float, Array]:
        """Clearance (m) to one obstacle, and the vector (3,) to it from the robot moved."""
        data, model = self._data, self._model
        data.geom_xpos[self.geoms] = self._own + offset
        best, towards = most, np.zeros(3)
        ends = np.zeros(6)
        for geom in self.geoms:
            reach = model.geom_rbound[geom] + model.geom_rbound[obstacle] + best
            apart = data.geom_xpos[geom] - data.geom_xpos[obstacle]
            if model.geom_rbound[obstacle] > 0.0 and apart @ apart > reach * reach:
                continue
            distance = mujoco.mj_geomDistance(model, data, int(geom), obstacle, best, ends)
            if distance < best:
                best, towards = distance, ends[3:] - ends[:3]
        return best, towards

    def _is_ground(self, geom: int) -> bool:
        if self._model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_PLANE:
            return self.find(geom, np.zeros(3), 1e-3)[0] < 1e-3
        return bool(self._data.geom_xmat[geom, 8] > 0.7)


def find_solid(world: World, bodies: NDArray[np.int64]) -> NDArray[np.int64]:
    """The geoms of some bodies that collide with anything."""
    model = world.model
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return np.flatnonzero(solid & np.isin(model.geom_bodyid, bodies))


def compute_reach(world: World, robot: int) -> float:
    """Returns how far (m) a robot's colliding geoms reach around its site, seen from above."""
    model, data = world.model, world.data
    site = data.site_xpos[world.sites[robot], :2]
    reach = 0.0
    for geom in find_solid(world, np.asarray(world.robot_bodies[robot])):
        away = float(np.linalg.norm(data.geom_xpos[geom, :2] - site))
        if model.geom_type[geom] in (_CYLINDER, _ELLIPSOID):
            away += float(model.geom_size[geom, 0])
        else:
            away += float(np.linalg.norm(model.geom_aabb[geom, 3:5]))
        reach = max(reach, away)
    return reach


_CYLINDER, _ELLIPSOID = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_ELLIPSOID
