"""`Monitor`: the signed margins of a world, and the breaks as they happen."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from hose_mj.constraints.footprints import Footprint, HoseProbe, find_obstacles, make_footprint
from hose_mj.constraints.hose_distance import BALL
from hose_mj.constraints.kinds import KIND_OF, KINDS, OBSTACLE, RUN_OVER, Kind, Watched
from hose_mj.constraints.limits import Limits
from hose_mj.constraints.margin_kernels import OTHER_KIND, Ints, Tables, measure_margins
from hose_mj.errors import InputError
from hose_mj.hoses.geds import shapes
from hose_mj.hoses.protocol import Array
from hose_mj.jit import compile_notice
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.world import World

_SIMPLE = (shapes.PLANE, shapes.SPHERE, shapes.CAPSULE, shapes.CYLINDER, shapes.BOX)
_INSIDE = 1e-9
"""Tension is sampled this part of a segment's length inside its ends, where it may jump."""


@dataclass(frozen=True)
class Break:
    """A margin that fell below zero."""

    kind: str  # name of one of `KINDS`
    robot: int | None  # the robot's number; None for a stretched segment
    # The segment (stretch, run-over), the other robot (collision), the obstacle's geom (obstacle);
    # None for bounds.
    other: int | str | None
    time: float  # when the margin was zero (s)
    place: tuple[float, float, float]  # where (3,), m, world frame
    margin: float  # at the end of the step in which it was crossed, m, or N for stretch
    # How fast the margin fell in that step, m/s, or N/s for stretch; 0 for a margin that was below
    # zero from the start.
    speed: float

    def describe(self) -> str:
        """One line of English."""
        where = ", ".join(f"{x:.3f}" for x in self.place)
        unit = KIND_OF[self.kind].unit
        how = f"at {self.speed:.3g} {unit}/s" if self.speed > 0.0 else "from the start"
        what = KIND_OF[self.kind].sentence.format(robot=self.robot, other=self.other)
        return f"{self.time:.3f} s: {what} at ({where}) m, {how} ({self.margin:.3g} {unit})"

    def to_record(self) -> dict[str, Any]:
        """Plain JSON values, by the attributes' names."""
        return {**asdict(self), "place": list(self.place)}


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
        InputError: no world, a robot without geoms, or limits that name a geom that is not there.
    """

    def __init__(self, world: World, limits: Limits | None = None) -> None:
        if not isinstance(world, World):
            raise InputError("world", world, "a world, as make_world returns it")
        if limits is not None and not isinstance(limits, Limits):
            raise InputError("limits", limits, "a Limits, or None for the defaults")
        self.world, self.limits = world, limits or Limits()
        self._footprints = [make_footprint(world, i) for i in range(world.n_robots)]
        self._obstacles = find_obstacles(world, self._footprints, self.limits.ground)
        watched = find_watched(world, self._obstacles[0])
        # Of each margin: the place of its kind in KINDS, robot and other.
        self._margins = [
            (k, robot, other)
            for k, kind in enumerate(KINDS)
            for robot, other in kind.members(watched)
        ]
        self._prepare(world.centre_line().arc_lengths)
        self.kinds = tuple(KINDS[k].name for k, _, _ in self._margins)
        self.names = tuple(
            f"{KINDS[k].name} {'-'.join(str(n) for n in members if n is not None)}"
            for k, *members in self._margins
        )
        self.units = tuple(KINDS[k].unit for k, _, _ in self._margins)
        nearest = [self._tables.tension, *self._tables.clearances[1:]]
        texts = [kind.limit.format(limit=most) for kind, most in zip(KINDS, nearest, strict=True)]
        self.limit_texts = tuple(np.repeat(texts, np.diff(self._tables.starts)).tolist())
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
        t = self._tables
        # Those geoms of robots that the kernels cannot measure.
        strange = [
            [int(t.ids[g]) for g in range(low, high) if t.rows[g, shapes.KIND] == OTHER_KIND]
            for low, high in pairwise(t.robot_rows)
        ]
        self._probe: HoseProbe | None = None
        if any(strange):
            self._probe = HoseProbe(world.model, strange, t.own, t.radius, arcs)

    def _measure(self) -> _Measurement:
        world = self.world
        line = world.centre_line()
        if not np.array_equal(line.arc_lengths, self._arcs):
            self._prepare(line.arc_lengths)
        t = self._tables
        queued = measure_margins(
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
            kind = self._margins[m][0]
            clearance = t.clearances[kind]
            most = t.margins[m] + clearance
            if gaps[q] >= most:
                continue
            found = mujoco.mj_geomDistance(model, data, t.ids[a], t.ids[b], most, ends)
            if found < most:
                t.margins[m], t.places[m] = found - clearance, 0.5 * (ends[:3] + ends[3:])
                if kind == OBSTACLE:
                    t.others[m] = b

    def _measure_probe(self, probe: HoseProbe, line: CentreLine) -> None:
        """Lets MuJoCo measure the hose's distance from geoms whose shape only it knows."""
        t, clearance = self._tables, self._tables.clearances[RUN_OVER]
        first, last = t.starts[RUN_OVER : RUN_OVER + 2]
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
        number, robot, other = self._margins[m]
        kind, found = KINDS[number], int(now.others[m])
        return Break(
            *(kind.name, robot, self._name_other(kind, found) if other is None else other),
            float(before.time + part * step),
            *(tuple(place.tolist()), float(now.margins[m])),
            speed=float(fall / step) if step > 0.0 else 0.0,
        )

    def _name_other(self, kind: Kind, found: int) -> int | str | None:
        """Says what the other party of a break is called where it differs from break to break."""
        if kind.other != "geom":
            return found if kind.other else None
        model, geom = self.world.model, int(self._tables.ids[found])
        body = model.body(model.geom_bodyid[geom]).name
        return str(model.geom(geom).name) or f"geom {geom} of {body}"


def make_tables(
    world: World,
    limits: Limits,
    footprints: Sequence[Footprint],
    obstacles: tuple[Ints, NDArray[np.bool_]],
    arcs: Array,
) -> Tables:
    """Makes the tables of a world that is to be measured against limits; see `Tables`.

    `obstacles` are as `find_obstacles` returns them, `arcs` the ends of the centre line's pieces (K
    + 1,), m.
    """
    n, spec = world.n_robots, world.scene.spec
    geoms, may_hit = obstacles
    ids = np.concatenate([*(footprint.geoms for footprint in footprints), geoms])
    counts = np.cumsum([0, *(len(footprint.geoms) for footprint in footprints)])
    watched = find_watched(world, geoms)
    starts = np.cumsum([0, *(len(kind.members(watched)) for kind in KINDS)])
    size = int(starts[-1])
    # The tip's is L up to rounding.
    attachments = np.clip(world.arc_lengths, arcs[0], arcs[-1])
    parts, part_ends = split_hose(arcs, attachments)
    samples, sample_segments = place_samples(arcs, attachments)
    own_arcs = np.array([limits.compute_own_arc(footprint.radius) for footprint in footprints])
    may_meet = np.zeros((counts[-1], len(ids)), dtype=np.bool_)
    may_meet[:, counts[-1] :] = may_hit
    room = int(counts[-1]) * len(ids)
    gravity = float(np.linalg.norm(world.model.opt.gravity))
    return Tables(
        radius=spec.outer_radius,
        tension=limits.compute_tension_limit(spec, gravity),
        stiffness=spec.axial_stiffness,
        lengthening=limits.max_lengthening,
        sight=limits.compute_sight(max(footprint.radius for footprint in footprints)),
        clearances=np.array([kind.clearance(limits, spec.outer_radius) for kind in KINDS]),
        bounds=np.array(world.scene.bounds),
        starts=starts,
        segments=attachments,
        own=attachments[:-1, None] + own_arcs[:, None] * [-1.0, 1.0],
        samples=samples,
        sample_segments=sample_segments,
        parts=parts,
        part_ends=part_ends,
        rows=_make_rows(world, ids),
        ids=ids,
        robot_rows=counts,
        upright=np.array([footprint.upright for footprint in footprints]),
        obstacles=may_meet,
        balls=np.zeros((len(arcs) - 1, BALL)),
        hulls=np.zeros((n, 4)),
        near=np.zeros((room, 3), dtype=np.int64),
        gaps=np.zeros(room),
        margins=np.zeros(size),
        places=np.zeros((size, 3)),
        others=np.zeros(size, dtype=np.int64),
    )


def find_watched(world: World, obstacles: Ints) -> Watched:
    """Returns what decides which margins there are; `obstacles` (H,) are geoms."""
    has_bounds = bool(np.any(np.isfinite(world.scene.bounds)))
    return Watched(world.n_robots, has_bounds, len(obstacles) > 0)


def split_hose(arcs: Array, attachments: Array) -> tuple[Ints, Array]:
    """Cuts the hose at the ends of pieces (K + 1,) and at the attachments, tip first (N + 1,), m.

    Returned are piece and segment (P, 2), and where each part begins and ends within its piece (P,
    2).
    """
    cuts = np.unique(np.concatenate([arcs, attachments]))
    cuts = cuts[cuts <= attachments[0]]
    middles = 0.5 * (cuts[:-1] + cuts[1:])
    pieces = np.searchsorted(arcs, middles) - 1
    ends = np.stack([cuts[:-1], cuts[1:]], axis=1) - arcs[pieces, None]
    parts = np.stack([pieces, _find_segments(middles, attachments)], axis=1)
    return parts.astype(np.int64), ends / np.diff(arcs)[pieces, None]


def place_samples(arcs: Array, attachments: Array) -> tuple[Array, Ints]:
    """Chooses arc lengths between which every model's tension is a straight line.

    Tension is known at the joints of a cable, the middles of a flex's edges and of a spline's
    spans: ends and middles of pieces, and just inside the ends of the segments. Returned are arc
    lengths (T,), m, and the segment of each (T,).
    """
    known = np.concatenate([arcs, 0.5 * (arcs[:-1] + arcs[1:])])
    inside = [
        np.array([low + _INSIDE * (high - low), high - _INSIDE * (high - low)])
        for high, low in pairwise(attachments)
    ]
    between = known[(known > attachments[-1]) & (known < attachments[0])]
    samples = np.sort(np.concatenate([*inside, between[~np.isin(between, attachments)]]))
    return samples, _find_segments(samples, attachments)


def _find_segments(places: Array, attachments: Array) -> Ints:
    """Returns the segment of each arc length: segment i ends at attachment i."""
    found = len(attachments) - 1 - np.searchsorted(attachments[::-1], places)
    return np.asarray(found, dtype=np.int64)


def _make_rows(world: World, ids: Ints) -> Array:
    """Makes the rows of geoms (G, ROW), without their poses."""
    model = world.model
    rows = np.zeros((len(ids), shapes.ROW))
    kinds = model.geom_type[ids]
    rows[:, shapes.KIND] = np.where(np.isin(kinds, _SIMPLE), kinds, OTHER_KIND)
    rows[:, shapes.SIZE : shapes.SIZE + 3] = model.geom_size[ids]
    rows[:, shapes.BOUND] = np.where(kinds == shapes.PLANE, 0.0, model.geom_rbound[ids])
    return rows
