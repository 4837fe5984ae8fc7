"""Trials of ropes: a slack wire that a robot carries, a rope that whirls, ropes that swing."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from hose_mj.checks import Check
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.protocol import Array, Hold
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import reference
from hose_mj.validation.case import GRAVITY
from hose_mj.validation.trial import Findings, LinePlot

WIRE = HoseSpec(
    length=3.0,
    axial_stiffness=3.3e5,
    bending_stiffness=1.23e-3,
    torsional_stiffness=9.48e-4,
    linear_density=0.0149,
    outer_radius=0.001,
    damping_time=0.002,
)
"""A steel wire rope of 2 mm."""
SPAN = 0.6 * WIRE.length
EVERY = 0.01  # time between two readings of the wire's force (s)


_POINTS = (8, 16, 32, 64, 128)
_QUICK = {0.01: (8, 16, 32), 0.005: (8, 16, 128), 0.002: (16, 64), 0.0005: (16, 32)}
_FULL = dict.fromkeys((0.01, 0.005, 0.002, 0.001, 0.0005), _POINTS)
"""Control points of the slack wire by time step (s)."""
_TURNS = 3
_TIGHT = {"tolerance": 1e-8, "force_tolerance": 1e-8}
_SWINGS = (
    (2e5, 1e-3, 32, 0.005),
    (2e5, 1e-3, 64, 0.002),
    (1e6, 1e-3, 64, 0.005),
    (1e7, 0.05, 32, 0.01),
)
"""EA (N), EI (N m^2), control points and time step (s) of ropes that swing."""


@cache
def find_catenary() -> tuple[Array, CubicSpline]:
    """The wire as if it did not resist bending; see `reference.elastic_catenary`."""
    return reference.elastic_catenary(WIRE, SPAN, WIRE.linear_density * GRAVITY)


def hang_wire(n: int, dt: float, spec: HoseSpec = WIRE, **options: Any) -> tuple[GedsHose, Hold]:
    """Hangs the wire between two attachments, at rest; the hold is that of the robot."""
    hose = GedsHose(spec, timestep=dt, control_points=n, **options)
    with hose.unwatched():  # few control points are strained along the catenary; at rest they rest
        hose.reset(find_catenary()[1])
    hose.attach(0.0, (0.0, 0.0, 0.0))
    robot = hose.attach(WIRE.length, (SPAN, 0.0, 0.0))
    hose.solve_static()
    return hose, robot


def carry_wire(n: int, dt: float, duration: float, **options: Any) -> Array:
    """Forces on a robot that carries the wire's end round a circle, each `EVERY` s, (k, 3), N."""
    hose, robot = hang_wire(n, dt, **options)
    forces, every = [], round(EVERY / dt)
    for k in range(round(duration / dt)):
        t = (k + 1) * dt
        wide = 0.1 * WIRE.length * min(1.0, t)
        x, y = SPAN + wide * math.sin(math.pi * t), 0.7 * wide * (1.0 - math.cos(math.pi * t))
        hose.move(robot, (x, y, 0.0))
        hose.step()
        if k % every == every - 1:
            forces.append(hose.reaction(robot).force)
    return np.array(forces)


def compare_forces(found: Array, true: Array) -> float:
    """Root mean square of the difference of forces (k, 3) over that of the true ones."""
    return float(np.sqrt(((found - true) ** 2).sum() / (true**2).sum()))


def measure_slack_wire(is_quick: bool, rng: np.random.Generator) -> Findings:
    """The wire at rest against the elastic catenary, carried against tight tolerances."""
    (pull, weight), curve = find_catenary()
    s = np.linspace(0.0, WIRE.length, 301)
    far: dict[str, list[float]] = {"shape": [], "force": []}
    soft = replace(WIRE, bending_stiffness=1e-3 * WIRE.bending_stiffness)
    for n in _POINTS[1:]:
        for spec in (WIRE, soft):
            hose, robot = hang_wire(n, 0.005, spec)
            gaps = np.linalg.norm(hose.position(s) - curve(s), axis=1)
            far["shape"].append(float(gaps.max()) / WIRE.length)
            force = hose.reaction(robot).force - [pull, 0.0, weight]
            far["force"].append(float(np.linalg.norm(force)) / math.hypot(pull, weight))
    true = carry_wire(64, 0.0005, 3.0, **_TIGHT)
    of_tolerance: dict[bool, list[float]] = {True: [], False: []}  # with 8 control points, more
    lines = {}
    for dt, ns in (_QUICK if is_quick else _FULL).items():
        off = []
        for n in ns:
            found = carry_wire(n, dt, 3.0)
            tight = carry_wire(n, dt, 3.0, **_TIGHT)
            of_tolerance[n == 8].append(compare_forces(found, tight))
            off.append(compare_forces(found, true))
        lines[f"{1e3 * dt:g} ms"] = (ns, off)
    worst = max(e for ns, off in lines.values() for n, e in zip(ns, off, strict=True) if n > 8)
    checks = [
        Check("shape at rest, off the elastic catenary (of L)", max(far["shape"]), 3e-3),
        Check("end force at rest, off the elastic catenary's", max(far["force"]), 0.02),
        Check("shape with a thousandth of EI (of L)", max(far["shape"][1::2]), 2e-4),
        Check("end force with a thousandth of EI", max(far["force"][1::2]), 1e-3),
        Check("force, off that with a tolerance of 1e-8 L", max(of_tolerance[False]), 0.02),
        Check("the same with 8 control points", max(of_tolerance[True]), 0.1),
        Check("force with 16 or more, off 64 at 0.5 ms", worst, 0.05),
    ]
    title = "Slack wire rope of 2 mm: force on the robot that carries its end"
    axes = ("error of the force", lines, {"limit": 0.05}, "control points", True)
    return Findings(checks, {"slack-wire": LinePlot(title, *axes)})


def whirl(n: int, dt: float, turns: int) -> tuple[Array, Array, Array, float, float]:
    """Turns a rope about the line through its ends, once a second, from the closed form.

    Returns times (k,), s; how far it is from where it should be, and from the shape, whatever the
    angle, (k,) each, of L; the mean axial force at an end and the energy gained, as fractions.
    """
    rate, half = 2.0 * math.pi, 0.5
    length, unit, curve = reference.whirling_rope(0.7, half)
    spec = HoseSpec(length=length, axial_stiffness=1e5, bending_stiffness=1e-6, linear_density=0.1)
    hose = GedsHose(spec, timestep=dt, control_points=n, gravity=(0.0, 0.0, 0.0))

    def place(s: Array, angle: float = 0.0) -> Array:
        x, r = curve(s).T
        return np.stack([x, -r * math.sin(angle), r * math.cos(angle)], axis=1)

    hose.reset(place, lambda s: rate * place(s, 0.5 * math.pi) * [0.0, 1.0, 1.0])
    hose.attach(0.0, (-half, 0.0, 0.0))
    end = hose.attach(length, (half, 0.0, 0.0))
    s, start = np.linspace(0.0, length, 101), hose.energies().total
    rows = []
    for _ in range(round(turns / dt / 10)):
        hose.step(10)
        now, wanted = hose.position(s), place(s, rate * hose.time)
        off = np.linalg.norm(now - wanted, axis=1).max()
        radius = np.hypot(now[:, 1], now[:, 2]) - np.hypot(wanted[:, 1], wanted[:, 2])
        bulge = np.hypot(now[:, 0] - wanted[:, 0], radius).max()
        force = hose.reaction(end).force[0] / (spec.linear_density * rate**2 * unit)
        rows.append((hose.time, off / length, bulge / length, force, hose.energies().total))
    t, off, bulge, force, energy = np.array(rows).T
    return t, off, bulge, float(force.mean()), float(energy.max() / start - 1.0)


def measure_whirling_rope(is_quick: bool, rng: np.random.Generator) -> Findings:
    """A rope that whirls, against its closed form, and ropes that swing, which gain no energy."""
    runs = [whirl(32, dt, _TURNS) for dt in (0.01, 0.005, 0.0025)]
    names = ("10 ms", "5 ms", "2.5 ms")
    lines = {name: (run[0], 100.0 * run[1]) for name, run in zip(names, runs, strict=True)}
    off = [float(run[1].max()) / _TURNS for run in runs]
    swings = {}
    for axial, bending, n, dt in _SWINGS:
        label = f"EA {axial:.0e} N, {n} points, {1e3 * dt:g} ms".replace("e+0", "e")
        swings[label] = swing(axial, bending, n, dt, 2.0 if is_quick else 10.0)
    gain = max(float(energies.max()) for _, energies in swings.values())
    checks = [
        Check("shape of the whirling rope (of L)", max(run[2].max() for run in runs), 3e-4),
        Check("mean force at its end, off", max(abs(run[3] - 1.0) for run in runs[1:]), 5e-3),
        Check("lag at 2.5 ms (of L a turn)", off[2], 2e-3),
        Check("order of the lag in the time step", math.log2(off[1] / off[2]), 1.8, ">="),
        Check("energy gained in whirling", max(run[4] for run in runs), 1e-4),
        Check("energy gained in a free swing (of m g L)", gain, 1e-3),
    ]
    title = "A rope whirls about its ends once a second: distance from the closed form"
    change = {label: (times, 100.0 * energies) for label, (times, energies) in swings.items()}
    swung = LinePlot(
        "A rope is let go from the horizontal: change of its energy",
        *("change (% of m g L)", change, {"limit, +0.1 %": 0.1}),
    )
    plots = {"whirling-rope": LinePlot(title, "distance (% of L)", lines, {}), "free-swing": swung}
    return Findings(checks, plots)


def swing(axial: float, bending: float, n: int, dt: float, duration: float) -> tuple[Array, Array]:
    """Lets a clamped rope of 1 m go from the horizontal.

    Args:
        axial: EA (N).
        bending: EI (N m^2).
        n: control points.
        dt: time step (s).
        duration: s.

    Returns:
        times (k,), s, every five steps, and how much energy was gained, (k,), of m g L.
    """
    spec = HoseSpec(
        length=1.0, axial_stiffness=axial, bending_stiffness=bending, linear_density=0.1
    )
    hose = GedsHose(spec, timestep=dt, control_points=n)
    hose.clamp(0.0)
    start, rows = hose.energies().total, []
    for _ in range(round(duration / dt / 5)):
        hose.step(5)
        rows.append((hose.time, (hose.energies().total - start) / (spec.mass * GRAVITY)))
    times, gains = np.array(rows).T
    return times, gains
