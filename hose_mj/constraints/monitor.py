"""`Monitor`: the signed margins of a world, and the breaks as they happen."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray

from hose_mj.constraints import margin_kernels as kernels
from hose_mj.constraints.breaks import (
    BOUNDS,
    COLLISION,
    KINDS,
    OBSTACLE,
    RUN_OVER,
    STRETCH,
    UNITS,
    Break,
)
from hose_mj.constraints.footprints import find_footprint, find_obstacles
from hose_mj.constraints.hose_probe import HoseProbe
from hose_mj.constraints.limits import Limits
from hose_mj.constraints.margin_tables import make_tables
from hose_mj.hoses.geds.shapes import KIND
from hose_mj.hoses.protocol import Array
from hose_mj.jit import compile_notice
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.world import World


@dataclass(frozen=True)
class _Measurement:
    """Margins (M,), their places (M, 3), what they are about (M,), and when (s)."""

    margins: Array
    places: Array
    others: NDArray[np.int64]
    time: float


class Monitor:
    """Watches a world; docs/constraints.md says what each margin is.

    Args:
        world: as it stands; what its robots stand on now is no obstacle to them.
        limits: None for the defaults.

    Attributes:
        world, limits: as given.
        names: of the margins (M): "stretch 0", "run-over 1", "collision 0-1", "bounds 0",
            "obstacle 2". Without finite bounds or obstacles there are no such margins.
        kinds, units: of each margin; units are N for stretch and m for the others.
        limit_texts: what each margin is measured against, in words.
        breaks: all that the last `check` or `reset` found, the earliest first.

    Raises:
        InputError: a robot without geoms, or limits that name a geom that is not there.
    """

    def __init__(self, world: World, limits: Limits | None = None) -> None:
        self.world, self.limits = world, limits or Limits()
        self._footprints = [find_footprint(world, i) for i in range(world.n_robots)]
        self._obstacles = find_obstacles(world, self._footprints, self.limits.ground)
        self._prepare(world.centre_line().arc_lengths)
        self._pairs = list(combinations(range(world.n_robots), 2))
        self.kinds = tuple(np.repeat(KINDS, np.diff(self._tables.starts)).tolist())
        self.names = tuple(self._name(m) for m in range(len(self.kinds)))
        self.units = tuple(UNITS[kind] for kind in self.kinds)
        texts = self._make_limit_texts()
        self.limit_texts = tuple(texts[kind] for kind in self.kinds)
        self.breaks: tuple[Break, ...] = ()
        self._pending: tuple[Break, ...] = ()
        with compile_notice("margins of constraints"):
            self._last = self._measure()
        self.reset()

    # -- measuring ---------------------------------------------------------------------------------

    def measure(self) -> Array:
        """Margins (M,) of the world as it stands, N or m: positive is fine, 0 the limit."""
        return self._measure().margins

    @property
    def margins(self) -> Array:
        """Margins (M,) as the last `check` or `reset` measured them."""
        return self._last.margins

    def check(self) -> Break | None:
        """Returns the earliest limit crossed since the last call; to be called after every step.

        A limit is crossed when its margin was not below zero and is now. Time and place are
        interpolated between the two; all that were crossed are in `breaks`. The first call after
        `reset` also returns what was broken from the start. A world whose clock went back counts as
        reset.
        """
        before, now = self._last, self._measure()
        if now.time < before.time:
            self.reset()
            before = self._last
        self._last = now
        crossed = np.flatnonzero((now.margins < 0.0) & (before.margins >= 0.0))
        found = [self._make_break(int(m), before, now) for m in crossed]
        self.breaks = (*self._pending, *sorted(found, key=lambda one: one.time))
        self._pending = ()
        return self.breaks[0] if self.breaks else None

    def reset(self) -> Break | None:
        """Starts anew with the world as it stands; returns a limit that is broken already."""
        self._last = self._measure()
        broken = np.flatnonzero(self._last.margins < 0.0)
        found = [self._make_break(int(m), self._last, self._last) for m in broken]
        self.breaks = self._pending = tuple(found)
        return found[0] if found else None

    def _prepare(self, arcs: Array) -> None:
        """Makes the tables for a centre line with pieces between these arc lengths."""
        self._arcs, world = arcs, self.world
        self._tables = make_tables(world, self.limits, self._footprints, self._obstacles, arcs)
        self._probe = self._make_probe(arcs)

    def _measure(self) -> _Measurement:
        world = self.world
        line = world.centre_line()
        if not np.array_equal(line.arc_lengths, self._arcs):
            self._prepare(line.arc_lengths)
        t = self._tables
        queued = kernels.measure_margins(
            *(t, (line.arc_lengths, line.coefficients), world.tension(t.samples)),
            *(world.site_positions(), (world.data.geom_xpos, world.data.geom_xmat)),
        )
        if queued:
            self._measure_pairs(queued)
        if self._probe is not None:
            self._measure_probe(self._probe, line)
        return _Measurement(t.margins.copy(), t.places.copy(), t.others.copy(), world.time)

    def _measure_pairs(self, queued: int) -> None:
        """Lets MuJoCo measure the pairs of geoms that may be nearer than what is known."""
        t, model, data = self._tables, self.world.model, self.world.data
        ends, gaps = np.zeros(6), t.gaps[:queued]
        for q in np.argsort(gaps).tolist():
            a, b, m = t.near[q].tolist()
            clearance = t.clearances[1 if m < t.starts[3] else 3]
            most = t.margins[m] + clearance
            if gaps[q] >= most:
                continue
            found = mujoco.mj_geomDistance(model, data, t.ids[a], t.ids[b], most, ends)
            if found < most:
                t.margins[m], t.places[m] = found - clearance, 0.5 * (ends[:3] + ends[3:])
                if m >= t.starts[4]:
                    t.others[m] = b

    def _measure_probe(self, probe: HoseProbe, line: CentreLine) -> None:
        """Lets MuJoCo measure the hose's distance from geoms whose shape only it knows."""
        t, clearance = self._tables, self._tables.clearances[0]
        first, last = t.starts[1:3]
        for i, near in enumerate(
            probe.measure(self.world.data, line, t.margins[first:last] + clearance)
        ):
            if near is not None:
                t.margins[first + i], t.places[first + i] = near.distance - clearance, near.place
                t.others[first + i] = np.sum(near.arc_length < t.segments[1:-1])

    # -- what was found ----------------------------------------------------------------------------

    def _make_break(self, m: int, before: _Measurement, now: _Measurement) -> Break:
        fall, step = before.margins[m] - now.margins[m], now.time - before.time
        part = before.margins[m] / fall if fall > 0.0 else 1.0
        place = before.places[m] + part * (now.places[m] - before.places[m])
        kind, (robot, other) = self.kinds[m], self._find_members(m)
        if kind == RUN_OVER:
            other = int(now.others[m])
        elif kind == OBSTACLE:
            other = self._name_geom(int(self._tables.ids[now.others[m]]))
        return Break(
            *(kind, robot, other, float(before.time + part * step)),
            *(tuple(place.tolist()), float(now.margins[m])),
            speed=float(fall / step) if step > 0.0 else 0.0,
        )

    def _find_members(self, m: int) -> tuple[int | None, int | str | None]:
        """Robot and other of a margin, as far as they are always the same."""
        kind = self.kinds[m]
        number = m - int(self._tables.starts[KINDS.index(kind)])
        if kind == STRETCH:
            return None, number
        return self._pairs[number] if kind == COLLISION else (number, None)

    def _name(self, m: int) -> str:
        robot, other = self._find_members(m)
        numbers = [str(n) for n in (robot, other) if n is not None]
        return f"{self.kinds[m]} {'-'.join(numbers)}"

    def _name_geom(self, geom: int) -> str:
        model = self.world.model
        body = model.body(model.geom_bodyid[geom]).name
        return str(model.geom(geom).name) or f"geom {geom} of {body}"

    def _make_limit_texts(self) -> dict[str, str]:
        near, apart, inside, clear = self._tables.clearances
        return {
            STRETCH: f"tension at most {self._tables.tension:.4g} N",
            RUN_OVER: f"hose's surface at least {near:.3g} m away",
            COLLISION: f"robots at least {apart:.3g} m apart",
            BOUNDS: f"at least {inside:.3g} m inside the bounds",
            OBSTACLE: f"obstacles at least {clear:.3g} m away",
        }

    def _make_probe(self, arcs: Array) -> HoseProbe | None:
        """A probe for those geoms of robots that the kernels cannot measure, where there are."""
        t = self._tables
        strange = [
            [int(t.ids[g]) for g in range(low, high) if t.rows[g, KIND] == kernels.OTHER_KIND]
            for low, high in pairwise(t.robot_rows)
        ]
        return HoseProbe(self.world.model, strange, t.own, t.radius, arcs) if any(strange) else None
