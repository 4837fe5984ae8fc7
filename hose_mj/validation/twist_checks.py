"""What GEDS promises of its twist, measured: turns kept, no drift, two forms that agree, cost."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hose_mj.checks import Check
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.protocol import Array, Hold
from hose_mj.validation.case import LENGTH, ROD, STOUT, Case
from hose_mj.validation.cases import find_cases
from hose_mj.validation.numerics import Curves, measure_order
from hose_mj.validation.settings import Setting

FORMS = ("scalar", "theta")
_SETTLING = 20
"""Turns after which a precessing rod has settled."""


def check_turns() -> list[Check]:
    """27 turns, 40 degrees a step, on a straight rod under tension."""
    checks = []
    for form in FORMS:
        hose = GedsHose(STOUT, timestep=0.005, gravity=(0, 0, 0), control_points=16, twist=form)
        hose.reset([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]])
        hose.clamp(0.0)
        # Tight enough to stay straight: T above M^2 / (4 EI).
        moment = 54.0 * math.pi * STOUT.torsional_stiffness / LENGTH
        strain = moment**2 / STOUT.bending_stiffness / STOUT.axial_stiffness
        far = hose.clamp(LENGTH, (LENGTH * (1.0 + strain), 0.0, 0.0), (1.0, 0.0, 0.0))
        hose.solve_static()
        for _ in range(27 * 9):
            hose.move(far, spin=2.0 * math.pi / 9)
            hose.step()
        hose.step(400)
        error = abs(float(hose.torque(0.5 * LENGTH)[0]) / moment - 1.0)
        checks.append(
            Check(f"27 turns, 40 degrees a step, {form}: error of the torque", error, 1e-9)
        )
    return checks


def _turn_about_x(vector: Array, angle: float) -> Array:
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y, z = vector
    return np.array([x, cosine * y - sine * z, sine * y + cosine * z])


def _find_spin(tangent: Array, director: Array, angle: float) -> tuple[Array, Array, float]:
    """Tangent and director turned about x, and their spin beyond the smallest rotation."""
    ahead, wanted = _turn_about_x(tangent, angle), _turn_about_x(director, angle)
    factor = (director @ ahead) / (1.0 + tangent @ ahead)
    carried = director - factor * (tangent + ahead)
    spin = math.atan2(float(np.cross(carried, wanted) @ ahead), float(carried @ wanted))
    return ahead, wanted, spin


def precess(form: str, n_turns: int, steps_a_turn: int = 36) -> Iterator[GedsHose]:
    """Turns a bent, twisted rod about the axis of its first clamp as if it were rigid.

    Yields the hose at equilibrium before it begins, then after every turn.
    """
    spec = replace(ROD, damping_time=0.1)
    hose = GedsHose(
        spec, timestep=0.02, gravity=(0, 0, 0), control_points=16, twist=form, tolerance=1e-9
    )
    bend = 1.2
    hose.reset(
        lambda s: np.stack([np.sin(bend * s) / bend, (1 - np.cos(bend * s)) / bend, 0 * s], axis=1)
    )
    holds: list[Hold] = [hose.clamp(0.0), hose.clamp(LENGTH)]
    hose.move(holds[1], spin=1.0)
    hose.solve_static()
    yield hose
    place, tangent = hose.position(LENGTH)[0], hose.tangent(LENGTH)[0]
    director = np.cross(tangent, [0.0, 0.0, 1.0])
    angle = 2.0 * math.pi / steps_a_turn
    for _ in range(n_turns):
        for _ in range(steps_a_turn):
            place = _turn_about_x(place, angle)
            tangent, director, spin = _find_spin(tangent, director, angle)
            hose.move(holds[0], spin=angle)
            hose.move(holds[1], position=place, tangent=tangent, spin=spin)
            hose.step()
        yield hose


def check_precession() -> list[Check]:
    """A bent rod with twist precesses 100 turns: its twist must be what it was."""
    places = np.linspace(0.1, 0.9, 9) * LENGTH
    checks = []
    for form in FORMS:
        states = precess(form, _SETTLING + 100)
        scale = float(np.mean(np.abs(next(states).twist(places))))
        # The first turns set it moving; what is then must stay.
        twists = [hose.twist(places) for hose in states]
        settled, end = twists[_SETTLING - 1], twists[-1]
        name = f"precessing bent rod, {form}: drift of the twist over 100 turns"
        checks.append(Check(name, float(np.max(np.abs(end - settled))) / scale, 1e-6))
    return checks


def check_agreement() -> list[Check]:
    """Both forms on the localized helix with 100 control points, and on the largest ring."""
    checks = []
    for name, n, limit in (("helix", 100, 3e-3), ("ring-twist-1", 24, 3e-3)):
        case: Case = find_cases((name,))[0]
        found = []
        for form in FORMS:
            hose = Setting("geds", "statics", n).make(case, twist=form)
            case.lay(hose)
            found.append(case.probe(hose))
        gap = float(np.max(np.abs(found[1] / found[0] - 1.0)))
        text = f"{name} with {n} control points: theta differs from scalar twist by"
        checks.append(Check(text, gap, limit))
    return checks


def check_twist_cost() -> tuple[list[Check], Curves]:
    """A step with twist over the plain one, between two clamps, one Newton iteration each."""
    points = (16, 32, 64, 128)
    forms = ("plain", *FORMS)
    hoses = {(form, n): _make_twisted(form, n) for form in forms for n in points}
    least = dict.fromkeys(hoses, math.inf)
    for _ in range(15):
        for key, hose in hoses.items():
            start = time.thread_time()
            hose.step(100)
            least[key] = min(least[key], (time.thread_time() - start) / 100)
    checks: list[Check] = []
    curves: Curves = {}
    sizes = [float(n) for n in points]
    for form in forms:
        walls = [least[form, n] for n in points]
        curves[{"plain": "without twist", "scalar": "scalar twist"}.get(form, form)] = (
            sizes,
            walls,
        )
    for form, limit in (("scalar", 1.4), ("theta", 2.0)):
        ratio = max(least[form, n] / least["plain", n] for n in points)
        name = f"cost of a step with {form} twist over one without, 16 to 128 control points"
        checks.append(Check(name, ratio, limit))
        exponent = measure_order(sizes, [least[form, n] for n in points])
        checks.append(Check(f"exponent of the cost in control points, {form} twist", exponent, 1.1))
    return checks, curves


def _make_twisted(form: str, n: int) -> GedsHose:
    """A straight rod under tension between two clamps, with some twist."""
    spec = replace(ROD, torsional_stiffness=0.0) if form == "plain" else ROD
    twist = None if form == "plain" else form
    hose = GedsHose(spec, timestep=2e-4, control_points=n, twist=twist)
    hose.clamp(0.0)
    far = hose.clamp(LENGTH)
    if form != "plain":
        hose.move(far, spin=1.0)
    hose.step(100)
    return hose
