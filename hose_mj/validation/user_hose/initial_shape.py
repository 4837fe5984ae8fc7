"""How a user's hose is laid at first: a smooth line of its length through its holds."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from hose_mj.hoses.protocol import Array
from hose_mj.scenes.hose_file.hose_file import UserHose

Line = Callable[[Array], Array]
_N = 200
"""Points of a piece between two holds."""
_CHORD = 1e-4
"""Chords of this fraction of the length tell how a line bends where it begins."""
_CLOSED = 1e-3
"""Ends no further apart than this fraction of the length between them count as one place."""
_AXES = np.eye(3)


def make_line(user: UserHose) -> Line:
    """Returns positions (k, 3) over arc lengths (k,): along `user.shape`, or through the holds.

    Between two holds it is a cubic curve with the tangents of clamps, bent out along gravity, or
    aside above a floor, until it is as long as the hose there; beyond the first and the last hold
    it is straight, and hangs down from a single attachment. A hose that is a coil at rest and has
    one hold at most is laid as that coil.
    """
    if user.shape is not None:
        points = np.array(user.shape)
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        return _interpolate(along * user.spec.length / along[-1], points)
    if user.spec.rest_curvature != 0.0 and len(user.holds) <= 1:
        return _make_coil(user)
    if not user.holds:
        return lambda s: np.outer(s, _AXES[0])
    places = [hold.arc_length for hold in user.holds]
    nodes, tangents = [np.array(hold.position) for hold in user.holds], _choose_tangents(user)
    out = user.gravity if user.floor is None else (0.0, 0.0, 0.0)
    pieces = []
    if places[0] > 0.0:
        pieces.append(_lay_tail(0.0, places[0], nodes[0] - places[0] * tangents[0], tangents[0]))
    for (k, begin), (_, end) in pairwise(enumerate(places)):
        points = bend_between(nodes[k : k + 2], tangents[k : k + 2], end - begin, out)
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        pieces.append((begin + along * (end - begin) / along[-1], points))
    if places[-1] < user.spec.length:
        pieces.append(_lay_tail(places[-1], user.spec.length, nodes[-1], tangents[-1]))
    s = np.concatenate([pieces[0][0][:1], *(piece[0][1:] for piece in pieces)])
    points = np.concatenate([pieces[0][1][:1], *(piece[1][1:] for piece in pieces)])
    return _interpolate(s, points)


def count_turns(user: UserHose) -> float:
    """Turns of the coil that a hose is at rest; 0 for one that is straight then."""
    spec = user.spec
    if spec.rest_curvature == 0.0:
        return 0.0
    return math.hypot(spec.rest_curvature, spec.rest_torsion) * spec.length / math.tau


def choose_director(user: UserHose, line: Line) -> Array:
    """Returns m1 (3,) with which a coil or ribbon is laid where it begins.

    A clamp there has it, by the file or from the line of `make_line`. Elsewhere no moment bends
    the end: a coil is curved there as at rest, about m1. A ribbon begins with its flat side up.
    """
    first = user.holds[0] if user.holds and user.holds[0].arc_length == 0.0 else None
    if first is not None and first.director is not None:
        return np.array(first.director)
    if first is not None and first.tangent is not None:
        line = make_line(user)
    step = _CHORD * user.spec.length
    one, other = np.diff(line(step * np.arange(3.0)), axis=0) / step
    bend = np.cross(one, other) / step
    if np.linalg.norm(bend) > 0.1 * abs(user.spec.rest_curvature) > 0.0:
        return np.asarray(bend / np.linalg.norm(bend) * np.sign(user.spec.rest_curvature))
    tangent = one / np.linalg.norm(one)
    return np.cross(_choose_side(tangent, [tangent], np.array(user.gravity)), tangent)


def _make_coil(user: UserHose) -> Line:
    """The helix of constant curvature K and torsion T: Darboux's vector T t + K b is its axis.

    It is bent about the director of a clamp, b.
    """
    turn, twist = user.spec.rest_curvature, user.spec.rest_torsion
    origin, start, tangent = np.zeros(3), 0.0, _AXES[0]
    if user.holds:
        start, origin = user.holds[0].arc_length, np.array(user.holds[0].position)
        tangent = _choose_tangents(user)[0]
    side = _choose_side(tangent, [tangent], np.zeros(3))
    if user.holds and user.holds[0].director is not None:
        side = np.cross(user.holds[0].director, tangent)
    rate = math.hypot(turn, twist)
    axis = (twist * tangent + turn * np.cross(tangent, side)) / rate

    def line(s: Array) -> Array:
        along, angle = (s - start)[:, None], rate * (s - start)[:, None]
        rise = axis * (axis @ tangent)
        across, third = tangent - rise, np.cross(axis, tangent)
        circle = across * np.sin(angle) + third * (1.0 - np.cos(angle))
        return np.asarray(origin + rise * along + circle / rate)

    return line


def bend_between(ends: list[Array], tangents: list[Array], length: float, gravity: object) -> Array:
    """Points (k, 3) of a curve of a given length between two ends, bent out along gravity.

    Args:
        ends: two places (3,), no further apart than the length (m).
        tangents: unit tangents there.
        length: m.
        gravity: (3,), any size.
    """
    chord = ends[1] - ends[0]
    u = np.linspace(0.0, 1.0, _N)[:, None]
    steps = (u**3 - 2 * u**2 + u, 3 * u**2 - 2 * u**3, u**3 - u**2)
    # Ends that are all but in one place have no chord: then a loop leaves the tangent's line.
    is_open = np.linalg.norm(chord) > _CLOSED * length
    across = chord if is_open else tangents[0]
    side = _choose_side(across, tangents, np.asarray(gravity, dtype=float))
    handle = length

    def curve(bend: float) -> Array:
        base = ends[0] + steps[1] * chord
        base = base + handle * (steps[0] * tangents[0] + steps[2] * tangents[1])
        return np.asarray(base + 16.0 * bend * (u * (1.0 - u)) ** 2 * side)

    def surplus(bend: float) -> float:
        return float(np.sum(np.linalg.norm(np.diff(curve(bend), axis=0), axis=1))) - length

    while surplus(0.0) > 0.0 and handle > 1e-6 * length:
        handle *= 0.7
    if surplus(0.0) > -1e-9 * length:
        return curve(0.0)
    return curve(brentq(surplus, 0.0, 2.0 * length))


def _choose_tangents(user: UserHose) -> list[Array]:
    """Unit tangents: of clamps as given, of attachments along the chord of their neighbours."""
    tangents = []
    for k, hold in enumerate(user.holds):
        near = user.holds[max(k - 1, 0) : k + 2]
        chord = np.subtract(near[-1].position, near[0].position)
        if hold.tangent is not None:
            tangents.append(np.array(hold.tangent))
        elif np.linalg.norm(chord) > 1e-9 * user.spec.length:
            tangents.append(chord / np.linalg.norm(chord))
        else:
            tangents.append(_hang(user, hold.arc_length))
    return tangents


def _hang(user: UserHose, arc_length: float) -> Array:
    """Down from an attachment, up to it where most of the hose is before it; x without gravity."""
    size = np.linalg.norm(user.gravity)
    if size == 0.0:
        return np.array([1.0, 0.0, 0.0])
    sign = 1.0 if arc_length <= 0.5 * user.spec.length else -1.0
    return np.asarray(sign * np.array(user.gravity) / size)


def _choose_side(chord: Array, tangents: list[Array], gravity: Array) -> Array:
    """The direction across a chord in which a slack hose hangs out: along gravity if it can."""
    along = chord / np.linalg.norm(chord)
    for aim in (gravity / (np.linalg.norm(gravity) or 1.0), tangents[0] - tangents[-1], *_AXES):
        across = aim - (aim @ along) * along
        if np.linalg.norm(across) > 0.05:
            return np.asarray(across / np.linalg.norm(across))
    raise AssertionError("one axis at least is not along the chord")


def _lay_tail(begin: float, end: float, start: Array, tangent: Array) -> tuple[Array, Array]:
    s = np.linspace(begin, end, _N)
    return s, start + np.outer(s - begin, tangent)


def _interpolate(along: Array, points: Array) -> Line:
    if len(points) < 4:
        return lambda s: np.stack([np.interp(s, along, points[:, k]) for k in range(3)], axis=1)
    return CubicSpline(along, points)  # type: ignore[no-any-return]
