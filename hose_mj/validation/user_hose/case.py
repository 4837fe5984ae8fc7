"""A user's hose as a case: what `hose-mj compare my_hose.toml` runs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.hoses.registry import make_hose
from hose_mj.scenes.hose_file.grasps import Grasp
from hose_mj.scenes.hose_file.hose_file import UserHose
from hose_mj.validation.case import Case, Motion
from hose_mj.validation.user_hose.initial_shape import Line, choose_director, count_turns, make_line

CASE_ID = "own-hose"
N_PROBES = 17
"""Places along the hose at which models are compared."""
REST_POINTS = 48
"""Control points of the rest shape from which all models start, times `compute_fineness`."""
_FIRST_MODE = 3.5
"""omega L^2 sqrt(rho A / EI) of a clamped-free beam."""
_PUSH = 1e-3
"""By this fraction of the length the hose is bent aside before it comes to rest."""
_STEPS_TO_REST = 400
_FLAT = 1e-6
_PAUSE = 0.04
_FEWEST, _MOST = 25, 500
"""Samples of a motion: about one per `_PAUSE` seconds, but not fewer or more than these."""


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
        clamped=any(
            hold.tangent is not None and hold.arc_length in (0.0, user.spec.length)
            for hold in user.holds
        ),
        planar=planar,
        obstacles=make_obstacles(user),
    )


def starts_at_rest(user: UserHose) -> bool:
    """Whether a rest shape is to be found, for its own sake or to start from."""
    return user.duration is None or user.start == "equilibrium"


def compute_fineness(user: UserHose) -> int:
    """By how much finer than others a hose is to be resolved: two turns of a coil count as one."""
    return max(1, math.ceil(count_turns(user) / 2.0))


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
    least = user.floor.height + user.spec.radius
    if lowest < least - 0.01 * user.spec.radius:
        valid = f"points along which the hose can be laid at or above z = {least:g} m"
        raise InputError("shape", f"down to z = {lowest:g} m", valid)


def put(user: UserHose, hose: HoseModel, line: Line) -> list[Hold]:
    """Lays a hose along a line, holds and loads it; returns the holds in the file's order."""
    if isinstance(hose, GedsHose) and not user.spec.is_isotropic:
        hose.reset(line, director=choose_director(user, line))
    else:
        hose.reset(line)
    holds = [_hold(hose, place) for place in user.holds]
    for load in user.loads:
        if any(load.force):
            hose.apply_force(load.arc_length, load.force)
        if any(load.moment):
            hose.apply_moment(load.arc_length, load.moment)
    return holds


def _hold(hose: HoseModel, place: Grasp) -> Hold:
    if place.tangent is None:
        return hose.attach(place.arc_length, place.position)
    if isinstance(hose, GedsHose) and place.director is not None:
        return hose.clamp(place.arc_length, place.position, place.tangent, place.director)
    return hose.clamp(place.arc_length, place.position, place.tangent)


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
    options = {
        "gravity": user.gravity,
        "control_points": points,
        "obstacles": make_obstacles(user),
    }
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
    """Whether holds, loads and gravity keep the hose in a plane parallel to x and z."""
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
        f"{spec.length:g} m of hose, {2e3 * spec.radius:.3g} mm thick, {spec.mass:.3g} kg; "
        f"EA = {spec.axial_stiffness:.3g} N, EI = {spec.bending_stiffness:.3g} N m\u00b2, "
        f"GJ = {spec.torsional_stiffness:.3g} N m\u00b2."
    ]
    kinds = [
        f"{'clamped' if hold.tangent else 'attached'}{_name_changes(hold)} at {hold.arc_length:g} m"
        for hold in user.holds
    ]
    parts.append(f"It is {' and '.join(kinds)}." if kinds else "Nothing holds it.")
    if user.duration is None:
        parts.append("Compared: its shape at rest.")
    else:
        start = "at rest" if user.start == "equilibrium" else "as laid"
        parts.append(f"It starts {start}; compared: its places over {user.duration:g} s.")
    return " ".join(parts)


def _name_changes(hold: Grasp) -> str:
    words = [word for word, some in (("moved", hold.moves), ("turned", hold.spins)) if some]
    return f" and {' and '.join(words)}" if words else ""


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
