"""The tables of the margins' kernels, made from a world, its footprints and the limits."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hose_mj.constraints.footprints import Footprint
from hose_mj.constraints.hose_distance import BALL
from hose_mj.constraints.limits import Limits
from hose_mj.constraints.margin_kernels import OTHER_KIND
from hose_mj.hoses.geds.shapes import (
    BOUND,
    BOX,
    CAPSULE,
    CYLINDER,
    KIND,
    PLANE,
    ROW,
    SIZE,
    SPHERE,
)
from hose_mj.hoses.protocol import Array
from hose_mj.world.world import World

Ints = NDArray[np.int64]

_SIMPLE = (PLANE, SPHERE, CAPSULE, CYLINDER, BOX)
_INSIDE = 1e-9
"""Tension is sampled this part of a segment's length inside its ends, where it may jump."""


class Tables(NamedTuple):
    """What does not change while a monitor watches, and room to work in.

    Attributes:
        radius: of the hose, m.
        tension: that breaks a segment, N.
        stiffness: the hose's axial stiffness, N.
        lengthening: that breaks a segment, as a fraction.
        sight: distances are measured up to this, m.
        clearances: run-over, collision, bounds, obstacle (4,), m.
        bounds: low and high corner (2, 3), m.
        starts: of the margins: stretch, run-over, collision, bounds, obstacle, end (6,).
        segments: arc lengths of the attachments from the source's, (N + 1,), m.
        own: arc lengths between which a robot's own hose lies (N, 2), m.
        samples: arc lengths where tension is known (T,), m.
        sample_segments: the segment of each (T,).
        parts: parts of the hose within one piece and one segment: piece, segment (P, 2).
        part_ends: where they begin and end within the piece (P, 2).
        rows: geoms of robots and obstacles, as in hoses/geds/shapes.py (G, ROW).
        ids: their numbers in the mjModel (G,).
        robot_rows: robot i has the rows from its entry to the next one's (N + 1,).
        upright: whether a robot is one cylinder that stays upright (N,).
        obstacles: whether a robot's geom may hit a geom (R, G).
        balls: of the hose's pieces (K, 5).
        hulls: centre and radius of a ball about each robot (N, 4), m.
        near: pairs of geoms left to MuJoCo: rows and margin (Q, 3).
        gaps: below which no pair's distance can lie (Q,), m.
        margins: (M,).
        places: (M, 3), m.
        others: segment or row that a margin is about, -1 for none (M,).
    """

    radius: float
    tension: float
    stiffness: float
    lengthening: float
    sight: float
    clearances: Array
    bounds: Array
    starts: Ints
    segments: Array
    own: Array
    samples: Array
    sample_segments: Ints
    parts: Ints
    part_ends: Array
    rows: Array
    ids: Ints
    robot_rows: Ints
    upright: NDArray[np.bool_]
    obstacles: NDArray[np.bool_]
    balls: Array
    hulls: Array
    near: Ints
    gaps: Array
    margins: Array
    places: Array
    others: Ints


def make_tables(
    world: World,
    limits: Limits,
    footprints: Sequence[Footprint],
    obstacles: tuple[Ints, NDArray[np.bool_]],
    arcs: Array,
) -> Tables:
    """Makes the tables; see `Tables`.

    Args:
        world: to be measured.
        limits: what its margins are measured against.
        footprints: of its robots.
        obstacles: as `find_obstacles` returns them.
        arcs: ends of the pieces of its centre line (K + 1,), m.
    """
    n, spec = world.n_robots, world.scene.spec
    geoms, may_hit = obstacles
    ids = np.concatenate([*(footprint.geoms for footprint in footprints), geoms])
    counts = np.cumsum([0, *(len(footprint.geoms) for footprint in footprints)])
    kinds = [n, n, n * (n - 1) // 2, n * has_bounds(world), n * bool(len(geoms))]
    size = int(sum(kinds))
    # The tip's is L up to rounding.
    attachments = np.clip(world.arc_lengths, arcs[0], arcs[-1])
    parts, part_ends = split_hose(arcs, attachments)
    samples, sample_segments = place_samples(arcs, attachments)
    own_arcs = np.array([limits.find_own_arc(footprint.radius) for footprint in footprints])
    may_meet = np.zeros((counts[-1], len(ids)), dtype=np.bool_)
    may_meet[:, counts[-1] :] = may_hit
    room = int(counts[-1]) * len(ids)
    gravity = float(np.linalg.norm(world.model.opt.gravity))
    return Tables(
        radius=spec.outer_radius,
        tension=limits.find_tension(spec, gravity),
        stiffness=spec.axial_stiffness,
        lengthening=limits.max_lengthening,
        sight=limits.find_sight(max(footprint.radius for footprint in footprints)),
        clearances=np.array(limits.find_clearances(spec.outer_radius)),
        bounds=np.array(world.scene.bounds),
        starts=np.cumsum([0, *kinds]),
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


def has_bounds(world: World) -> bool:
    """Whether the scene has a bound in any direction."""
    return bool(np.any(np.isfinite(world.scene.bounds)))


def split_hose(arcs: Array, attachments: Array) -> tuple[Ints, Array]:
    """Cuts the hose at the ends of pieces and at the attachments.

    Args:
        arcs: ends of the pieces (K + 1,), m.
        attachments: of robots, tip first, and source (N + 1,), m.

    Returns:
        piece and segment (P, 2), and where each part begins and ends within its piece (P, 2).
    """
    cuts = np.unique(np.concatenate([arcs, attachments]))
    cuts = cuts[cuts <= attachments[0]]
    middles = 0.5 * (cuts[:-1] + cuts[1:])
    pieces = np.searchsorted(arcs, middles) - 1
    ends = np.stack([cuts[:-1], cuts[1:]], axis=1) - arcs[pieces, None]
    parts = np.stack([pieces, _find_segments(middles, attachments)], axis=1)
    return parts.astype(np.int64), ends / np.diff(arcs)[pieces, None]


def place_samples(arcs: Array, attachments: Array) -> tuple[Array, Ints]:
    """Arc lengths between which every model's tension is a straight line, and their segments.

    Tension is known at the joints of a cable, the middles of a flex's edges and of a spline's
    spans: ends and middles of pieces, and just inside the ends of the segments.
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
    """The segment of each arc length: segment i ends at attachment i."""
    found = len(attachments) - 1 - np.searchsorted(attachments[::-1], places)
    return np.asarray(found, dtype=np.int64)


def _make_rows(world: World, ids: Ints) -> Array:
    """Rows of geoms (G, ROW), without their poses."""
    model = world.model
    rows = np.zeros((len(ids), ROW))
    kinds = model.geom_type[ids]
    rows[:, KIND] = np.where(np.isin(kinds, _SIMPLE), kinds, OTHER_KIND)
    rows[:, SIZE : SIZE + 3] = model.geom_size[ids]
    rows[:, BOUND] = np.where(kinds == PLANE, 0.0, model.geom_rbound[ids])
    return rows
