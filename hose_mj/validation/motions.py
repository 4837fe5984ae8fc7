"""The dynamic cases, compared with their converged limit, and those with contact."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from weakref import WeakKeyDictionary

import numpy as np
from scipy.interpolate import CubicSpline

from hose_mj.errors import StepError
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import reference
from hose_mj.validation.case import (
    DOWN,
    GRAVITY,
    LENGTH,
    ROD,
    Case,
    Motion,
    Reference,
    lay_between,
    lay_cantilever,
    make_case,
    read_places,
    read_tip,
)
from hose_mj.validation.quasistatic import WIDTH, Chain, settle

ACROSS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
"""Turns a cylinder's axis to y, across the plane in which hoses are laid."""

_MOTION = partial(make_case, gravity=DOWN, scale=LENGTH)
_FREE = Motion(1.0, 50)


def _ease(time: float, ramp: float) -> float:
    """Rises from 0 to 1 within `ramp` (s), at rest before and after: half a cosine."""
    return 0.5 - 0.5 * math.cos(math.pi * min(time / ramp, 1.0))


def make_released_rod() -> Case:
    """A horizontal cantilever let go."""
    return _MOTION(
        "released-rod", spec=ROD, lay=lay_cantilever, probe=read_tip, motion=_FREE, clamped=True
    )


def make_free_flight() -> Case:
    """A straight hose thrown spinning and flexing."""

    def flex(s: Array) -> Array:
        """Symmetric, zero at both ends, without moment and shear there: f'' = s^2 (1 - s)^2."""
        return s**4 / 12.0 - s**5 / 10.0 + s**6 / 30.0 - s / 60.0

    def speed(s: Array) -> Array:
        u = s / LENGTH
        return np.stack([0.5 + 0.0 * u, 0.0 * u, 4.0 * (0.5 - u) + 300.0 * flex(u)], axis=1)

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]], speed)
        return []

    probe = read_places((0.0, 0.5, 1.0))
    return make_case("free-flight", spec=ROD, lay=lay, probe=probe, scale=LENGTH, motion=_FREE)


def make_taut_pull() -> Case:
    """A sagging hose drawn taut by its ends."""
    slack, taut, ramp = 0.8 * LENGTH, 0.995 * LENGTH, 0.6

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        hose.move(holds[1], (slack + (taut - slack) * _ease(time, ramp), 0.0, 0.0))

    return _MOTION(
        "taut-pull",
        "hose",
        spec=replace(ROD, damping_time=0.01),
        lay=lambda hose: lay_between(hose, slack),
        probe=read_places((0.25, 0.5, 0.75)),
        motion=Motion(1.0, 50, drive),
    )


def make_suture_pull() -> Case:
    """A suture thread drawn taut sideways."""
    length = 0.1
    slack, pull, ramp = 0.098, 0.0105, 0.3
    starts: WeakKeyDictionary[HoseModel, Array] = WeakKeyDictionary()

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset(
            lambda s: np.stack(
                [s / length * slack, 0.0 * s, -0.0089 * np.sin(math.pi * s / length)], axis=1
            )
        )
        ends = [hose.attach(0.0, (0.0, 0.0, 0.0)), hose.attach(length, (slack, 0.0, 0.0))]
        hose.solve_static()
        starts[hose] = hose.position(0.5 * length)[0].copy()
        return [*ends, hose.attach(0.5 * length)]

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        aim = np.array([0.5 * slack, 0.0, pull])
        hose.move(holds[2], starts[hose] + (aim - starts[hose]) * _ease(time, ramp))

    return make_case(
        "taut-pull",
        "suture",
        spec=HoseSpec.from_material(
            length=length,
            youngs_modulus=750e6,
            poisson_ratio=0.4,
            density=1100.0,
            outer_radius=0.2e-3,
            damping_time=2e-3,
        ),
        gravity=DOWN,
        lay=lay,
        probe=read_places((0.25, 0.75), length),
        scale=length,
        motion=Motion(0.5, 25, drive),
        models=("geds",),
        steps=(0.002, 0.001, 0.0005, 0.00025),
    )


_DRUM = 0.1  # radius (m)


def _wind(angle: float, bend: float, leg: float) -> tuple[Callable[[Array], Array], Array, Array]:
    """A line that is wound by an angle (rad) on a circle of radius `bend`, with straight legs (m).

    Returns it as a function of arc length, and its unit tangents at its beginning and its end.
    """
    begin = 0.5 * (math.pi - angle)
    first, last = (np.array([math.sin(a), 0.0, math.cos(a)]) for a in (begin, begin + angle))

    def curve(s: Array) -> Array:
        turn = np.clip((s - leg) / bend, 0.0, angle)
        beyond = s - leg - angle * bend
        legs = np.outer(np.minimum(s - leg, 0.0), first) + np.outer(np.maximum(beyond, 0.0), last)
        arc = np.stack([-np.cos(begin + turn), 0.0 * s, np.sin(begin + turn)], axis=1)
        return np.asarray(bend * arc + legs)

    return curve, first, last


def make_capstan() -> Case:
    """A hose drawn over half a drum."""
    length, friction, pull = 0.6, 0.3, 1.0
    speed, pause, n_steps = 0.05, 0.005, 300
    spec = HoseSpec(
        length=length,
        axial_stiffness=2e3,
        bending_stiffness=1e-5,
        torsional_stiffness=0.0,
        linear_density=0.1,
        outer_radius=0.005,
        damping_time=0.01,
    )
    bend = _DRUM + spec.outer_radius
    curve, _, _ = _wind(math.pi, bend, 0.5 * (length - math.pi * bend))

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset(curve)
        return []

    def probe(hose: HoseModel) -> Array:
        hose.apply_force(0.0, (0.0, 0.0, -pull))
        hold, place, pulls = hose.attach(length), hose.position(length)[0], []
        for _ in range(n_steps):
            place = place - [0.0, 0.0, speed * pause]
            hose.move(hold, place)
            hose.step(max(1, round(pause / hose.timestep)))
            pulls.append(-hose.reaction(hold).force[2])
        return np.array([np.mean(pulls[n_steps // 2 :]) / pull])

    return make_case(
        "capstan",
        spec=spec,
        lay=lay,
        probe=probe,
        truth=lambda: np.array([reference.capstan(friction, math.pi)]),
        models=("geds",),
        obstacles=(
            Obstacle(kind="cylinder", rotation=ACROSS, size=(_DRUM, 0.2), friction=friction),
        ),
        promised={20: 0.01},
    )


def make_held_capstan(turns: float = 0.5, friction: float = 0.3) -> Case:
    """A hose drawn round a drum by a number of turns, then stopped and held for ten seconds."""
    pull, speed, draw, brake, hold_time, leg = 1.0, 0.05, 1.5, 0.5, 10.0, 0.12
    angle, bend = 2.0 * math.pi * turns, _DRUM + 0.005
    curve, first, last = _wind(angle, bend, leg)
    spec = HoseSpec(
        length=angle * bend + 2.0 * leg,
        axial_stiffness=2e4,
        bending_stiffness=1e-5,
        torsional_stiffness=0.0,
        linear_density=0.1,
        outer_radius=0.005,
        damping_time=0.01,
    )

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset(curve)
        return []

    def probe(hose: HoseModel) -> Array:
        hose.apply_force(0.0, -pull * first)
        hold, start = hose.attach(spec.length), hose.position(spec.length)[0]
        n_steps, pulls = round(draw / hose.timestep), []
        for k in range(n_steps):
            hose.move(hold, start + speed * hose.timestep * (k + 1) * last)
            hose.step()
            pulls.append(hose.reaction(hold).force @ last)
        left = np.linspace(1.0, 0.0, round(brake / hose.timestep) + 1)[1:]
        way = speed * (draw + brake / 3.0 * (1.0 - left**3))
        hose.follow({hold: start + np.outer(way, last)})
        hose.step(round(hold_time / hose.timestep))
        held = hose.reaction(hold).force @ last
        return np.array([np.mean(pulls[n_steps // 2 :]), held]) / pull

    bending = spec.bending_stiffness / (2.0 * pull * bend**2)
    return make_case(
        "held-capstan",
        spec=spec,
        lay=lay,
        probe=probe,
        truth=lambda: np.full(2, reference.capstan(friction, angle, bending)),
        models=("geds",),
        obstacles=(
            Obstacle(kind="cylinder", rotation=ACROSS, size=(_DRUM, 0.2), friction=friction),
        ),
        promised={20: 0.01},
    )


TOW_TIME = 72.0
TOW_SAMPLES = 24
TOW_FRICTION = 0.5
_TOW_WIDTH = 0.35
_TOWED = HoseSpec(
    length=LENGTH,
    axial_stiffness=2e3,
    bending_stiffness=5e-3,
    torsional_stiffness=5e-3 / 1.3,
    linear_density=0.1,
    damping_time=0.01,
)


@cache
def _make_eight() -> CubicSpline:
    """The figure of eight over the fraction of its length, starting at the far end of the hose."""
    turn = np.linspace(0.0, 2.0 * math.pi, 4001)
    eight = np.stack([np.sin(turn), 0.5 * np.sin(2.0 * turn)], axis=1) * _TOW_WIDTH
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(eight, axis=0), axis=1))])
    return CubicSpline(along / along[-1], eight + np.array([LENGTH, 0.0]))


def compute_tow_place(fraction: Array) -> Array:
    """Places (k, 2) of the towed end after fractions (k,) of a figure of eight, even in speed."""
    return np.asarray(_make_eight()(fraction))


def tow_chain(spec: HoseSpec, friction: float, start: Array, path: Array, delta: float) -> Array:
    """Tows a chain by its last node.

    Args:
        spec: the hose; stretching, bending and weight count.
        friction: Coulomb's coefficient of the floor.
        start: nodes (N + 1, 2) of the chain at rest, evenly spaced along it, m.
        path: places of the last node, one an increment, (k, 2), m.
        delta: slip below which friction is smoothed (m), well below an increment.

    Returns:
        nodes after each increment, (k, N + 1, 2), m.

    Raises:
        StepError: an increment that does not converge.
    """
    n = len(start)
    h = spec.length / (n - 1)
    drag = friction * spec.linear_density * GRAVITY
    chain = Chain(h, spec.axial_stiffness, spec.bending_stiffness, drag, delta, 1e-3 * delta)
    x = np.array(start, dtype=np.float64).ravel()
    padded = 2 * n + WIDTH
    work = np.zeros(padded), np.zeros((padded, 2 * WIDTH)), np.zeros((1, padded)), np.zeros(2 * n)
    shapes = np.empty((len(path), n, 2))
    for k, place in enumerate(path):
        before = x.copy()
        x[-2:] = place
        if not settle(x, before, chain, *work):
            raise StepError(f"increment {k} of the tow did not converge")
        shapes[k] = x.reshape(n, 2)
    return shapes


def _tow_chain(n_links: int, n_increments: int) -> Array:
    """Computes with the minimiser what `make_floor_tow` compares: (TOW_SAMPLES + 1, 33), m."""
    start = np.stack([np.linspace(0.0, LENGTH, n_links + 1), np.zeros(n_links + 1)], axis=1)
    path = compute_tow_place(np.arange(1, n_increments + 1) / n_increments)
    slip = 2e-3 * float(np.linalg.norm(path[1] - path[0]))
    shapes = tow_chain(_TOWED, TOW_FRICTION, start, path, slip)
    every = n_increments // TOW_SAMPLES
    seen = np.concatenate([start[None], shapes[every - 1 :: every]])[:, :: n_links // 10]
    heights = np.full((*seen.shape[:2], 1), _TOWED.outer_radius)
    return np.concatenate([seen, heights], axis=2).reshape(len(seen), -1)


@cache
def compute_tow() -> Reference:
    """The minimiser's answer, and how far it is from that of half as many links and increments."""
    coarse, fine = (_tow_chain(200 * k, 80 * k * TOW_SAMPLES) for k in (1, 2))
    gap = (fine - coarse).reshape(len(fine), -1, 3)
    return Reference(fine, float(np.max(np.linalg.norm(gap, axis=2))) / LENGTH)


def make_floor_tow() -> Case:
    """A hose towed slowly along a figure of eight on a rough floor."""
    law = ContactLaw().complete(_TOWED)
    height = _TOWED.outer_radius + law.find_gap(9.81 * _TOWED.linear_density)

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset([[0.0, 0.0, height], [LENGTH, 0.0, height]])
        return [hose.attach(LENGTH, (LENGTH, 0.0, height))]

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        hose.move(holds[0], (*compute_tow_place(np.array(time / TOW_TIME)), height))

    return _MOTION(
        "floor-tow",
        spec=_TOWED,
        lay=lay,
        probe=read_places(np.linspace(0.0, 1.0, 11)),
        motion=Motion(TOW_TIME, TOW_SAMPLES, drive),
        models=("geds", "cable"),
        steps=(0.1, 0.05),
        obstacles=(Obstacle(kind="plane", friction=TOW_FRICTION),),
        planar=False,
        reference=compute_tow,
        uncertainty=2e-3,
        promise=5e-3,
        has_ratios=False,
    )


def make_obstacle_drop() -> Case:
    """A cantilever let go above a bar."""
    bar = Obstacle(
        kind="cylinder", position=(0.5, 0.0, -0.3), rotation=ACROSS, size=(0.1, 0.2), friction=0.3
    )
    return _MOTION(
        "obstacle-drop",
        spec=replace(
            ROD, bending_stiffness=0.02, torsional_stiffness=0.02 / 1.3, damping_time=0.02
        ),
        lay=lay_cantilever,
        probe=read_places((0.5, 0.75, 1.0)),
        motion=_FREE,
        clamped=True,
        models=("geds", "cable"),
        obstacles=(bar,),
        contact_law=ContactLaw(stiffness=3e3, width=1e-3),
        uncertainty=5e-4,
        promise=5e-3,
        has_ratios=False,
    )
