"""`Script`: formations that robots go through one after the other; `Player` drives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.world.driving import Driver
from hose_mj.world.world import World


@dataclass(frozen=True)
class Script:
    """Places of all robots' sites, one formation after the other.

    Between two formations all robots move straight and arrive together, so two that are near enough
    for their hose in both formations are so in between (a distance is a convex function).

    Attributes:
        robot: the one it is about.
        formations: (k, N, 3), m.
        pace: how fast it is played, as a share of what the robots can.
    """

    robot: int
    formations: Array
    pace: float = 1.0


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
    lengths that are limits: they end at such a formation where there is one.

    Args:
        formation: places of the sites (N, 3), m.
        fixed: the robot that stays.
        source: where the hose begins (3,), m.
        spans: how far each robot may be from the next one along the hose (N,), m.
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

    Args:
        driver: of the world.
        script: its formations.

    Attributes:
        script: as given.
        time: when the targets are at its end (s).
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
        self._driver.drive_to(_interpolate(elapsed, self._times, self._formations))
        self._driver.update()


def _interpolate(time: float, times: Array, formations: Sequence[Array] | Array) -> Array:
    k = min(int(np.searchsorted(times, time, side="right")), len(times) - 1)
    span = times[k] - times[k - 1]
    share = min(1.0, (time - times[k - 1]) / span) if span > 0.0 else 1.0
    return np.asarray((1.0 - share) * formations[k - 1] + share * formations[k])
