"""The clamps of a hose and the segments between them, as the kernels of twist.py read them.

Made anew whenever a clamp comes or goes. The material stays where it is: a clamp that comes takes
hold of it as it lies, and one that goes leaves its neighbours with the twist that was between them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.polynomial import Polynomial

from hose_mj.hoses.geds.records import Hose
from hose_mj.hoses.geds.span import LEAST_TURN_ROOM, make_span
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.geds.twist import Twist, find_owners, measure_twist
from hose_mj.hoses.protocol import Array

_UNITS = np.eye(3)
_NODES = np.polynomial.legendre.leggauss(3)[0]
_AREAS = [
    (Polynomial.fromroots(np.delete(_NODES, g)) / np.prod(_NODES[g] - np.delete(_NODES, g))).integ()
    for g in range(3)
]
"""Integrals of the parabolas that are 1 at one Gauss point and 0 at the others."""


def make_twist(spline: Spline, hose: Hose, arc_lengths: Sequence[float], x: Array) -> Twist:
    """Returns clamps with arbitrary directors and segments without twist.

    Args:
        spline: the hose's geometry.
        hose: its constants.
        arc_lengths: of the clamps, ascending, (C,), m.
        x: the unknowns.
    """
    s = np.array(arc_lengths, dtype=np.float64)
    starts, values = spline.compute_basis(s)
    n_spans, n_clamps = len(hose.tables.first), len(s)
    n_segments = max(n_clamps - 1, 0) if has_scalar_twist(spline, hose) else 0
    ends = np.stack([np.arange(n_segments), np.arange(n_segments) + 1], axis=1)
    weights = np.array(
        [make_weights(spline, n_spans, s[first], s[last]) for first, last in ends]
    ).reshape(n_segments, n_spans, 3)
    compliance = np.array([measure_compliance(hose, part) for part in weights])
    n_frames = 3 * n_spans + n_clamps if spline.has_theta else 0
    return Twist(
        starts=starts,
        places=s / hose.tables.span_length,
        slopes=np.ascontiguousarray(values[:, 1]),
        directors=make_directors(spline, s, x),
        spin=np.zeros((n_clamps, 2)),
        ends=ends,
        spans=(starts // spline.n_dof)[ends],
        weights=weights,
        compliance=compliance,
        angle=np.zeros(n_segments),
        trial=np.zeros(n_segments),
        torque=np.zeros(n_segments),
        frames=np.zeros((n_frames, 10)),
        accepted=np.zeros((n_frames, 10)),
        fresh=np.zeros((n_frames, 10)),
        angles=np.zeros(n_frames),
        fit=np.zeros((n_spans + 7, 8)),
        change=np.zeros((1, n_spans + 7)),
        turn_rows=np.zeros(n_clamps, dtype=np.int64),
        transported=np.zeros((n_segments, 7)),
        rows=np.zeros((n_segments, spline.size + 4 * spline.n_dof)),
        load_starts=np.zeros(0, dtype=np.int64),
        load_slopes=np.zeros((0, 4)),
        load_moments=np.zeros((0, 3)),
        load_shares=np.zeros((0, n_spans, 3)),
        applied=np.zeros((n_spans, 3)),
    )


def has_scalar_twist(spline: Spline, hose: Hose) -> bool:
    """Whether a hose carries a moment about its tangent without an unknown for it."""
    return spline.n_dof == 3 and bool(np.all(hose.elasticity.torsional_stiffness > 0.0))


def make_directors(spline: Spline, arc_lengths: Array, x: Array) -> Array:
    """Returns unit tangents and some unit vectors normal to them at arc lengths (C,), (C, 6)."""
    directors = np.zeros((len(arc_lengths), 6))
    for row, tangent in enumerate(spline.evaluate(arc_lengths, x, 1)):
        length = float(np.linalg.norm(tangent))
        unit = tangent / length if length > 1e-12 else np.eye(3)[0]
        directors[row] = np.concatenate([unit, compute_normal(unit)])
    return directors


def compute_normal(tangent: Array) -> Array:
    """Returns some unit vector (3,) normal to a unit tangent (3,)."""
    away = _UNITS[int(np.abs(tangent).argmin())]
    normal = cross(tangent, away)
    return np.asarray(normal / np.linalg.norm(normal))


def cross(first: Array, second: Array) -> Array:
    """Returns the cross product of two vectors (3,), in a tenth of numpy's time."""
    a, b, c = first.tolist()
    x, y, z = second.tolist()
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def make_weights(spline: Spline, n_spans: int, start: float, end: float) -> Array:
    """Returns lengths that the Gauss points stand for between two arc lengths, (S, 3), m.

    Where a clamp is inside a span the weights integrate parabolas over the part exactly.
    """
    length = spline.length / n_spans
    spans = np.arange(n_spans)
    low = 2.0 * np.clip(start / length - spans, 0.0, 1.0) - 1.0
    high = 2.0 * np.clip(end / length - spans, 0.0, 1.0) - 1.0
    return np.stack([0.5 * length * (area(high) - area(low)) for area in _AREAS], axis=1)


def measure_compliance(hose: Hose, weights: Array) -> float:
    """Returns the integral of ds / GJ over a segment, 1 / (N m)."""
    return float(np.sum(weights / hose.elasticity.torsional_stiffness))


def share_twist(spline: Spline, hose: Hose, new: Twist, old: Twist) -> Array:
    """Returns the angle (K,) of the new segments when the material keeps its twist."""
    length = hose.tables.span_length
    angle = np.zeros(len(new.angle))
    for k, ends in enumerate(new.ends):
        for other, others in enumerate(old.ends):
            start = length * max(new.places[ends[0]], old.places[others[0]])
            end = length * min(new.places[ends[1]], old.places[others[1]])
            if start < end:
                part = make_weights(spline, len(new.weights[k]), start, end)
                share = measure_compliance(hose, part) / old.compliance[other]
                angle[k] += share * old.angle[other]
    return angle


def turn_director(twist: Twist, clamp: int, angle: float) -> None:
    """Turns the director of a clamp about its tangent, right-handed."""
    tangent, director = twist.directors[clamp, :3], twist.directors[clamp, 3:].copy()
    across = np.cross(tangent, director)
    twist.directors[clamp, 3:] = np.cos(angle) * director + np.sin(angle) * across


def take_over_twist(
    spline: Spline,
    hose: Hose,
    new: Twist,
    old: Twist,
    same: dict[int, int],
    x: Array,
    measure_applied: Callable[[float, float], float],
) -> None:
    """Gives new clamps and segments the material's present angles.

    Args:
        spline: the hose's geometry.
        hose: its constants.
        new: as made by `make_twist`; written.
        old: what was there before, a closed loop parted.
        same: the clamp in `old` of each clamp of `new` that was there.
        x: the unknowns.
        measure_applied: gives the angle (rad) by which point moments twist the hose between two
            arc lengths (m), beyond the angles of `old`.
    """
    for clamp, before in same.items():
        new.directors[clamp] = old.directors[before]
        new.spin[clamp] = old.spin[before]
    wanted = share_twist(spline, hose, new, old)
    for k, (first, last) in enumerate(new.places[new.ends] * hose.tables.span_length):
        wanted[k] += measure_applied(float(first), float(last))
    # Without torsional stiffness there is no segment, however many clamps.
    anchor = min(same, default=0) if len(wanted) > 0 else 0
    span = make_span()

    def measure(k: int) -> float:
        new.trial[:] = wanted
        measure_twist(spline.axes, hose.tables, new, x, span)
        return float(new.trial[k])

    for k in range(anchor, len(wanted)):
        found = measure(k)
        if k + 1 in same:
            wanted[k] = found
        else:
            turn_director(new, k + 1, wanted[k] - found)
    for k in range(anchor - 1, -1, -1):
        turn_director(new, k, measure(k) - wanted[k])
    new.angle[:] = wanted


def settle(twist: Twist) -> None:
    """Gives all segments the moment of their present angle."""
    twist.trial[:] = twist.angle
    twist.torque[:] = twist.angle / twist.compliance


def join_ends(twist: Twist, spin: float) -> Twist:
    """Returns the twist of a closed loop: its first piece and its last become one segment.

    The directors of its ends are glued at one tangent, so they stay together from then on wherever
    it goes.

    Args:
        twist: of its pieces as segments of an open hose, with clamps at both ends; written.
        spin: what the last end is turned by before (rad).
    """
    last = len(twist.starts) - 1
    turn_director(twist, last, spin)
    twist.angle[-1:] += spin
    between = twist.directors[0, :3] + twist.directors[last, :3]
    between /= np.linalg.norm(between)
    for clamp in (0, last):
        tangent, director = twist.directors[clamp, :3], twist.directors[clamp, 3:]
        twist.directors[clamp, 3:] = transport_director(tangent, between, director)
        twist.directors[clamp, :3] = between
    if len(twist.ends) < 2:
        return twist
    compliance, angle = twist.compliance[:-1].copy(), twist.angle[:-1].copy()
    compliance[0] += twist.compliance[-1]
    angle[0] += twist.angle[-1]
    return twist._replace(
        compliance=compliance,
        angle=angle,
        trial=angle.copy(),
        torque=np.zeros_like(angle),
        rows=twist.rows[:-1].copy(),
    )


def part_ends(
    spline: Spline,
    hose: Hose,
    twist: Twist,
    x: Array,
    measure_applied: Callable[[float, float], float],
) -> Twist:
    """Returns the pieces of a closed loop as segments of an open hose; see `join_ends`.

    The first piece and the last each get the angle that their compliance asks for, so the material
    between them is where it really is; `measure_applied` as in `take_over_twist`.
    """
    if len(twist.ends) == len(twist.angle):
        return twist
    compliance = np.array([measure_compliance(hose, part) for part in twist.weights])
    angle = (twist.angle / twist.compliance)[find_owners(twist)] * compliance
    parted = twist._replace(
        directors=twist.directors.copy(),
        compliance=compliance,
        angle=angle,
        trial=angle.copy(),
        torque=np.zeros_like(angle),
        rows=np.zeros((len(angle), twist.rows.shape[1])),
    )
    start, end = twist.places[twist.ends[0]] * hose.tables.span_length
    parted.trial[0] += measure_applied(float(start), float(end))
    wanted = float(parted.trial[0])
    measure_twist(spline.axes, hose.tables, parted, x, make_span())
    gap = float(parted.trial[0] - wanted)
    for clamp in (0, len(parted.starts) - 1):
        turn_director(parted, clamp, gap)
    return parted


def take_over_frames(new: Twist, old: Twist, same: dict[int, int], n_spans: int) -> None:
    """Gives the frames of a hose with theta to a new set of clamps; see `take_over_twist`."""
    first = 3 * n_spans
    new.accepted[:first] = old.accepted[:first]
    for clamp, place in enumerate(new.places):
        row = first + clamp
        if clamp in same:
            new.accepted[row] = old.accepted[first + same[clamp]]
            new.spin[clamp] = old.spin[same[clamp]]
            continue
        inside = place - min(int(place), n_spans - 1)
        nearest = int(np.argmin(np.abs(0.5 + 0.5 * _NODES - inside)))
        near = new.accepted[3 * min(int(place), n_spans - 1) + nearest]
        tangent = new.directors[clamp, :3]
        new.accepted[row, :3] = tangent
        new.accepted[row, 6:9] = transport_director(near[:3], tangent, near[6:9])
    new.frames[:] = new.accepted


def transport_director(start: Array, end: Array, director: Array) -> Array:
    """Returns a director (3,) after the smallest rotation of the unit vector start to end."""
    factor = (director @ end) / max(1.0 + float(start @ end), LEAST_TURN_ROOM)
    return np.asarray(director - factor * (start + end))
