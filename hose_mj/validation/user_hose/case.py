"""A user's hose as a case of `hose-mj compare`, and the smooth line along which it is laid."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.hoses.registry import make_hose
from hose_mj.scenes.hose_file.hose_file import UserHose
from hose_mj.validation.case import Case, Motion

Line = Callable[[Array], Array]  # positions (k, 3) over arc lengths (k,), m
CASE_ID = "own-hose"
N_PROBES = 17  # places along the hose at which models are compared
REST_POINTS = 48
"""Control points of the rest shape from which all models start, times `compute_fineness`."""
_FIRST_MODE = 3.5  # omega L^2 sqrt(rho A / EI) of a clamped-free beam
_PUSH = 1e-3
"""Amount, as a fraction of the length, by which the hose is bent aside before it comes to rest."""
_STEPS_TO_REST = 400
_FLAT = 1e-6
_PAUSE = 0.04
_FEWEST, _MOST = 25, 500
"""Samples of a motion: about one per `_PAUSE` seconds, but not fewer or more than these."""
_N = 200  # points of a piece between two holds
_CHORD = 1e-4  # chords of this fraction of the length tell how a line bends where it begins
_CLOSED = 1e-3
"""Ends no further apart than this fraction of the length between them count as one place."""
_AXES = np.eye(3)


def make_case(user: UserHose) -> Case:
    """Returns the case of a user's hose: static where no duration is given, else a motion.

    Models start from one line, the rest shape where the hose begins in equilibrium.

    Raises:
        InputError: the hose would be laid through the floor.
        StepError: GEDS found no rest shape.
    """
    _check_above_floor(user)
    at_rest = starts_at_rest(user)
    line = compute_rest_shape(user) if at_rest else make_line(user)
    places = line(np.linspace(0.0, user.spec.length, N_PROBES))
    planar = is_planar(user) and bool(np.ptp(places[:, 1]) < _FLAT * user.spec.length)

    def lay(hose: HoseModel) -> list[Hold]:
        holds = put(user, hose, line)
        if at_rest and user.duration is not None:
            hose.solve_static()
        return holds

    def probe(hose: HoseModel) -> Array:
        if user.duration is None:
            hose.solve_static()
        return np.asarray(hose.position(np.linspace(0.0, user.spec.length, N_PROBES)).ravel())

    return Case(
        id=CASE_ID,
        family=CASE_ID,
        title=user.title,
        about=describe(user),
        spec=user.spec,
        gravity=user.gravity,
        lay=lay,
        probe=probe,
        scale=user.spec.length,
        motion=None if user.duration is None else _make_motion(user, user.duration),
        clamped=any(h.tangent and h.arc_length in (0.0, user.spec.length) for h in user.holds),
        planar=planar,
        obstacles=make_obstacles(user),
    )


def starts_at_rest(user: UserHose) -> bool:
    """Says whether a rest shape is to be found, for its own sake or to start from."""
    return user.duration is None or user.start == "equilibrium"


def compute_fineness(user: UserHose) -> int:
    """Returns the factor by which a hose is resolved finer: two turns of a coil count as one."""
    curvature, torsion = user.spec.rest_curvature, user.spec.rest_torsion
    turns = math.hypot(curvature, torsion) * user.spec.length / math.tau
    return max(1, math.ceil(turns / 2.0)) if curvature else 1


def make_obstacles(user: UserHose) -> tuple[Obstacle, ...]:
    """The floor, where there is one."""
    if user.floor is None:
        return ()
    height, friction = user.floor.height, user.floor.friction
    return (Obstacle(kind="plane", position=(0.0, 0.0, height), friction=friction),)


def _check_above_floor(user: UserHose) -> None:
    if user.floor is None:
        return
    lowest = float(np.min(make_line(user)(np.linspace(0.0, user.spec.length, 401))[:, 2]))
    least = user.floor.height + user.spec.outer_radius
    if lowest < least - 0.01 * user.spec.outer_radius:
        valid = f"points along which the hose can be laid at or above z = {least:g} m"
        raise InputError("shape", f"down to z = {lowest:g} m", valid)


def put(user: UserHose, hose: HoseModel, line: Line) -> list[Hold]:
    """Lays a hose along a line, holds and loads it; returns the holds in the file's order."""
    if isinstance(hose, GedsHose) and not user.spec.is_isotropic:
        hose.reset(line, director=choose_director(user, line))
    else:
        hose.reset(line)
    holds = []
    for place in user.holds:
        if place.tangent is None:
            holds.append(hose.attach(place.arc_length, place.position))
        elif isinstance(hose, GedsHose) and place.director is not None:
            facts = (place.arc_length, place.position, place.tangent, place.director)
            holds.append(hose.clamp(*facts))
        else:
            holds.append(hose.clamp(place.arc_length, place.position, place.tangent))
    for load in user.loads:
        if any(load.force):
            hose.apply_force(load.arc_length, load.force)
        if any(load.moment):
            hose.apply_moment(load.arc_length, load.moment)
    return holds


def compute_rest_shape(user: UserHose) -> Line:
    """Returns an equilibrium of GEDS under holds and loads that small pushes do not upset.

    Newton's method alone would also stop where the hose balances on an edge. So the hose is laid,
    bent a little out of its plane, let go in a viscous fluid until it has all but come to rest,
    and only then solved for.

    Raises:
        StepError: none was found.
    """
    spec, length = user.spec, user.spec.length
    pace = math.sqrt(spec.bending_stiffness / spec.linear_density) / length**2
    pace = max(_FIRST_MODE * pace, math.sqrt(float(np.linalg.norm(user.gravity)) / length))
    thick = replace(spec, drag=2.0 * spec.linear_density * pace)
    start = make_line(user)

    def push(s: Array) -> Array:
        aside = np.sin(2.3 * np.pi * s / length) * _PUSH * length
        return np.asarray(start(s) + aside[:, None] * np.array([0.1, 1.0, 0.1]))

    points = REST_POINTS * compute_fineness(user)
    options: dict[str, Any] = {"gravity": user.gravity, "control_points": points}
    options["obstacles"] = make_obstacles(user)
    loose = make_hose("geds", thick, timestep=0.1 / pace, scheme="backward-euler", **options)
    hose = make_hose("geds", spec, **options)
    try:
        put(user, loose, push)
        loose.step(_STEPS_TO_REST)
        put(user, hose, loose.position)
    except StepError:
        put(user, hose, start)
    hose.solve_static()
    return lambda s: hose.position(np.clip(s, 0.0, length))


def is_planar(user: UserHose) -> bool:
    """Says whether holds, loads and gravity keep the hose in a plane parallel to x and z."""
    places = [hold.position for hold in user.holds] + list(user.shape or ())
    aims = [hold.tangent for hold in user.holds if hold.tangent is not None]
    for move in (move for hold in user.holds for move in hold.moves):
        places += [move.to] if move.to is not None else []
        aims += [move.tangent] if move.tangent is not None else []
    forces = [user.gravity, *(load.force for load in user.loads)]
    flat = len({place[1] for place in places}) <= 1 and not any(v[1] for v in (*aims, *forces))
    turned = any(load.moment[0] or load.moment[2] for load in user.loads)
    straight = user.spec.is_isotropic and user.spec.rest_torsion == 0.0
    return flat and not turned and not user.spins and straight


def describe(user: UserHose) -> str:
    """A sentence on the hose and one on what happens to it."""
    spec = user.spec
    parts = [
        f"{spec.length:g} m of hose, {2e3 * spec.outer_radius:.3g} mm thick, {spec.mass:.3g} kg; "
        f"EA = {spec.axial_stiffness:.3g} N, EI = {spec.bending_stiffness:.3g} N m\u00b2, "
        f"GJ = {spec.torsional_stiffness:.3g} N m\u00b2."
    ]
    kinds = []
    for hold in user.holds:
        words = ["clamped" if hold.tangent else "attached"]
        words += [word for word, some in (("moved", hold.moves), ("turned", hold.spins)) if some]
        kinds.append(f"{' and '.join(words)} at {hold.arc_length:g} m")
    parts.append(f"It is {' and '.join(kinds)}." if kinds else "Nothing holds it.")
    if user.duration is None:
        parts.append("Compared: its shape at rest.")
    else:
        start = "at rest" if user.start == "equilibrium" else "as laid"
        parts.append(f"It starts {start}; compared: its places over {user.duration:g} s.")
    return " ".join(parts)


def _make_motion(user: UserHose, duration: float) -> Motion:
    n_samples = min(max(round(duration / _PAUSE), _FEWEST), _MOST)
    if not user.moves:
        return Motion(duration, n_samples)
    changing = [k for k, hold in enumerate(user.holds) if hold.changes]

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        for k in changing:
            hold = user.holds[k]
            spin = hold.angle_at(time) - hold.angle_at(time - hose.timestep)
            hose.move(holds[k], hold.position_at(time), hold.tangent_at(time), spin)

    return Motion(duration, n_samples, drive)


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
    """Unit tangents: of clamps as given, of attachments along the chord of their neighbours.

    An attachment without neighbours hangs along gravity, or lies along x.
    """
    tangents = []
    for k, hold in enumerate(user.holds):
        near = user.holds[max(k - 1, 0) : k + 2]
        chord = np.subtract(near[-1].position, near[0].position)
        if hold.tangent is not None:
            tangents.append(np.array(hold.tangent))
        elif np.linalg.norm(chord) > 1e-9 * user.spec.length:
            tangents.append(chord / np.linalg.norm(chord))
        elif size := np.linalg.norm(user.gravity):
            # Down, or up where most of the hose is before it.
            sign = 1.0 if hold.arc_length <= 0.5 * user.spec.length else -1.0
            tangents.append(np.asarray(sign * np.array(user.gravity) / size))
        else:
            tangents.append(_AXES[0])
    return tangents


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
    rises = np.append(True, np.diff(along) > 0.0)  # a curve that turns back can stand still
    along, points = along[rises], points[rises]
    if len(points) < 4:
        return lambda s: np.stack([np.interp(s, along, points[:, k]) for k in range(3)], axis=1)
    return CubicSpline(along, points)  # type: ignore[no-any-return]
