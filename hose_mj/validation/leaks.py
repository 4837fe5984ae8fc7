"""Trials of contact: taut hoses round posts, hoses that fall on bars or meet a thin wall."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hose_mj.checks import Check
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation.case import GRAVITY
from hose_mj.validation.trial import Findings, LinePlot, ShapePlot

RADIUS = 0.01  # of the hose (m)
POSTS = (0.005, 0.03, 0.1)  # radii (m)
_RISES = 60  # of the pull
_N_SHOWN, _WAY = 4, 2.5  # in the pictures: hoses on bars, way of a hose that is thrown (m)
_ROOT = math.sqrt(0.5)
EDGE = Obstacle(
    kind="box",
    size=(0.1, 0.1, 0.5),
    rotation=[[_ROOT, -_ROOT, 0.0], [_ROOT, _ROOT, 0.0], [0.0, 0.0, 1.0]],
    friction=0.3,
)
"""A box that turns an edge to where the hose comes from."""


def make_light_hose(length: float = 1.0, drag: float = 0.1, **options: Any) -> GedsHose:
    """Makes a light hose of 20 mm, with as many control points as there are by default."""
    spec = HoseSpec(
        length=length,
        axial_stiffness=2e4,
        bending_stiffness=0.005,
        linear_density=0.1,
        outer_radius=RADIUS,
        damping_time=0.005,
        drag=drag,
    )
    return GedsHose(spec, **options)


@dataclass(frozen=True)
class Pull:
    """How a hose was pulled round an obstacle."""

    sink: float  # of the hose's surface below the obstacle's, in radii; infinite if it got through
    iterations: float  # of Newton's method in a step, mean
    unbalanced: (
        float  # by how much forces and the change of momentum differ, as a share of the pull
    )


def pull_round(obstacle: Obstacle, top: float, force: float, dt: float) -> Pull:
    """Bends a hose by 90 degrees round an obstacle about z, whose highest place is at y = top (m).

    Both ends are pulled down and outwards, with ever more force (N) for 0.3 s and all of it for
    another 0.3 s, over which forces are balanced.
    """
    hose = make_light_hose(timestep=dt, gravity=(0.0, 0.0, 0.0), obstacles=[obstacle])
    y = top + RADIUS
    hose.reset([[-0.5, y, 0.0], [0.5, y, 0.0]])
    each, half = round(0.3 / _RISES / dt), round(0.3 / dt)
    for k in range(_RISES):
        now = force * (k + 1) / _RISES / math.sqrt(2.0)
        hose.clear_loads()
        hose.apply_force(1.0, (now, -now, 0.0))
        hose.apply_force(0.0, (-now, -now, 0.0))
        hose.step(each)
    pull, drag = np.array([0.0, -math.sqrt(2.0) * force, 0.0]), hose.spec.drag
    left = hose.momentum().linear
    for _ in range(half):
        hose.step()
        moving = hose.momentum().linear
        carried = hose.contacts.compute_forces().sum(axis=0)
        left = left + dt * (pull + carried - drag / hose.spec.linear_density * moving)
    unbalanced = float(np.linalg.norm(left - moving)) / (half * dt * float(np.linalg.norm(pull)))
    gaps = hose.contacts.measure_obstacles(hose.position(np.linspace(0.0, 1.0, 1001)))
    is_through = hose.position(0.5)[0, 1] < 0.0
    sink = math.inf if is_through else 1.0 - float(gaps.min()) / RADIUS
    return Pull(sink, hose.iterations / (_RISES * each + half), unbalanced)


def drop_on_bar(place: float, half: float, length: float) -> tuple[GedsHose, float]:
    """Lets a hose fall across a bar, `half` its width (m), at a place along it (m), for 0.25 s.

    Returns the hose and the most energy that it gained, of its weight times 0.06 m.
    """
    hose = make_light_hose(length, timestep=0.005, obstacles=[_make_bar(place, half)])
    hose.reset([[0.0, 0.0, 0.06], [length, 0.0, 0.06]])
    start, most = hose.energies().total, -math.inf
    for _ in range(50):
        hose.step()
        most = max(most, hose.energies().total)
    return hose, (most - start) / (hose.spec.mass * GRAVITY * 0.06)


def throw_at_wall(
    speed: float, rng: np.random.Generator, dt: float = 0.005
) -> tuple[GedsHose, Array, Array]:
    """Throws a hose, turned at random, at a wall of 5 mm at x = 0, at a speed (m/s).

    Returns the hose, times (k,), s, and energies (k,), J, until 0.1 s after all of it has arrived.
    """
    wall = Obstacle(kind="box", size=(0.0025, 1.0, 1.0), friction=0.3)
    hose = make_light_hose(timestep=dt, gravity=(0.0, 0.0, 0.0), obstacles=[wall])
    turn = rng.uniform(-1.0, 1.0)
    middle = np.array([-0.55 - rng.uniform(0.0, 0.3), 0.0, 0.0])
    along = 0.5 * np.array([math.cos(turn), math.sin(turn), 0.0])
    hose.reset([middle - along, middle + along], (speed, 0.0, 0.0))
    times, energies = [0.0], [hose.energies().total]
    with hose.unwatched():  # steps that do not resolve the hit are what this is about
        for _ in range(round(1.5 / speed / dt + 0.1 / dt)):
            hose.step()
            times.append(hose.time)
            energies.append(hose.energies().total)
    return hose, np.array(times), np.array(energies)


def measure_post_pull(is_quick: bool, rng: np.random.Generator) -> Findings:
    """A taut hose round posts and an edge; nothing is left to chance, and no grid is smaller."""
    posts = [Obstacle(kind="cylinder", size=(r, 1.0), friction=0.3) for r in POSTS]
    pulls: list[Pull] = []
    lines = {}
    for force in (20.0, 200.0):
        for dt in (0.001, 0.005):
            found = [pull_round(p, r, force, dt) for p, r in zip(posts, POSTS, strict=True)]
            pulls += [*found, pull_round(EDGE, 0.1 / _ROOT, force, dt)]
            label = f"{force:g} N, {1e3 * dt:g} ms"
            lines[label] = ([1e3 * r for r in POSTS], [pull.sink for pull in found])
    checks = [
        Check("largest sink of the hose (radii)", max(pull.sink for pull in pulls), 0.2),
        Check("Newton iterations a step", max(pull.iterations for pull in pulls), 6.0),
        Check("forces out of balance (of the pull)", max(pull.unbalanced for pull in pulls), 0.01),
    ]
    title = "How far a hose of 20 mm sinks into a post that it is pulled round"
    axes = ("sink (radii of the hose)", lines, {"limit": 0.2}, "radius of the post (mm)", True)
    return Findings(checks, {"post-pull": LinePlot(title, *axes)})


def measure_bar_drop(is_quick: bool, rng: np.random.Generator) -> Findings:
    """Hoses that fall on bars at random places, and that are thrown at a wall."""
    n_places, n_throws = (6, 8) if is_quick else (20, 40)
    n_through, gains, hung = 0, [], {}
    for length in (1.0, 3.0):
        for half in (0.01, 0.02, 0.05):
            for k in range(n_places):
                place = rng.uniform(0.3, 0.7) * length
                hose, gain = drop_on_bar(place, half, length)
                n_through += hose.position(place)[0, 2] < 0.0
                gains.append(gain)
                if (length, half) == (1.0, 0.01) and k < _N_SHOWN:
                    places = hose.position(np.linspace(0.0, length, 101))
                    hung[f"at {100 * place / length:.0f} % of the hose"] = places - [place, 0, 0]
    n_pierced, left, lines = 0, [], {}
    for speed in (5.0, 20.0, 50.0):
        for k in range(n_throws):
            hose, times, energies = throw_at_wall(speed, rng)
            n_pierced += hose.position(np.linspace(0.0, 1.0, 201))[:, 0].max() >= 0.0
            left.append(energies[-1] / energies[0])
            if k == 0:
                lines[f"{speed:g} m/s"] = _trace(speed, times, energies)
    finer = []
    for k in range(n_throws // 2):
        _, times, energies = throw_at_wall(5.0, rng, 0.0005)
        finer.append(max(energies) / energies[0])
        if k == 0:
            lines["5 m/s, 0.5 ms"] = _trace(5.0, times, energies)
    checks = [
        Check(f"of {len(gains)} hoses that fell on a bar, through it", n_through, 0),
        Check("energy gained in falling (of m g 60 mm)", max(gains), 1e-3),
        Check(f"of {len(left)} hoses thrown at a wall of 5 mm, through it", n_pierced, 0),
        Check("energy left after the throw (of that before)", max(left), 1.0),
        Check("largest energy during a throw at 5 m/s, 0.5 ms (of that before)", max(finer), 1.02),
    ]
    bar = _make_bar(0.0, 0.01)
    shown = ShapePlot(
        "Hoses of 1 m, 0.25 s after they were let go over a bar of 20 mm", hung, (bar,)
    )
    title = "Energy of a hose thrown at a wall of 5 mm, steps of 5 ms but for one"
    axes = ("energy (of that before)", lines, {"as before": 1.0}, "way without the wall (m)")
    return Findings(checks, {"bar-drop": shown, "bar-drop-energy": LinePlot(title, *axes)})


def _trace(speed: float, times: Array, energies: Array) -> tuple[Array, Array]:
    """The energy over the way that a hose would have gone without the wall, of `_WAY`."""
    shown = speed * times <= _WAY
    return speed * times[shown], energies[shown] / energies[0]


def _make_bar(place: float, half: float) -> Obstacle:
    return Obstacle(kind="box", position=(place, 0.0, 0.0), size=(half, 0.5, 0.02))
