"""The static cases in space: twist, rest shapes, unequal ways out of the plane."""

from __future__ import annotations

import math
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np
from scipy.interpolate import CubicSpline

from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import torsion
from hose_mj.validation.case import BENDING_STIFFNESS, LENGTH, STOUT, Case
from hose_mj.validation.modes import compute_critical_twist, turn_about_x


def _check_spline(hose: HoseModel) -> GedsHose:
    """The hose of a case that only GEDS runs, for what the protocol does not have."""
    assert isinstance(hose, GedsHose)
    return hose


LARGEST_SPIN = 2.0
"""Clamps are spun by at most this at once, which models of rigid segments can follow (rad)."""


def spin_clamp(hose: HoseModel, hold: Hold, angle: float, most: float = LARGEST_SPIN) -> None:
    """Spins a clamp by an angle (rad), equilibrium after equilibrium."""
    n_parts = max(math.ceil(abs(angle) / most), 1)
    for _ in range(n_parts):
        hose.move(hold, spin=angle / n_parts)
        hose.solve_static()


def make_bend(load: float) -> Case:
    """An arc of 45 degrees loaded out of its plane (Bathe and Bolourchi 1979)."""
    radius, modulus = 100.0, 1e7
    length = radius * math.pi / 4.0
    spec = HoseSpec(
        length=length,
        axial_stiffness=modulus,
        bending_stiffness=modulus / 12.0,
        # The benchmark takes J = 1/6 for the unit square and G = E / 2.
        torsional_stiffness=modulus / 12.0,
        linear_density=1.0,
        rest_curvature=1.0 / radius,
    )

    def lay(hose: HoseModel) -> list[Hold]:
        angle_of = 1.0 / radius
        _check_spline(hose).reset(
            lambda s: (
                radius
                * np.stack([np.sin(angle_of * s), 1.0 - np.cos(angle_of * s), 0.0 * s], axis=1)
            ),
            director=(0.0, 0.0, 1.0),
        )
        return [hose.clamp(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))]

    def probe(hose: HoseModel) -> Array:
        hose.apply_force(length, (0.0, 0.0, load))
        hose.solve_static()
        return np.asarray(hose.position(length)[0])

    return Case(
        id=f"bend-45-load-{load:g}",
        family="bend-45",
        title=f"45-degree bend, load {load:g}",
        about="An arc of 45 degrees (radius 100, unit square section, E = 1e7, J = 1/6) is clamped "
        "at one end and loaded out of its plane at the other. Compared: the place of the tip.",
        spec=spec,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        planar=False,
        truth=lambda: np.array(torsion.BEND_45[load]),
        models=("geds",),
        resolutions={"geds": (6, 8, 12)},
        promised={12: 1e-3},
    )


def make_ring(ratio: float) -> Case:
    """A ring whose ends are clamped to each other and twisted, ratio = GJ / EI."""
    radius = LENGTH / (2.0 * math.pi)
    clamps: WeakKeyDictionary[HoseModel, Hold] = WeakKeyDictionary()

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset(
            lambda s: (
                radius * np.stack([np.sin(s / radius), 0.0 * s, 1.0 - np.cos(s / radius)], axis=1)
            )
        )
        place, tangent = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
        holds = [hose.clamp(0.0, place, tangent), hose.clamp(LENGTH, place, tangent)]
        clamps[hose] = holds[1]
        return holds

    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        flat = hose.linearize()
        angle = 0.5 * torsion.ring_twist(ratio)
        spin_clamp(hose, clamps[hose], angle)
        # A turn about the clamps' tangent costs nothing, so the ring may have taken one.
        middle = hose.position(0.5 * LENGTH)[0]
        twisted = turn_about_x(hose.linearize(), math.atan2(middle[1], middle[2]))
        critical = compute_critical_twist(flat, twisted, angle, n_neutral=1)
        return np.array([critical])

    return Case(
        id=f"ring-twist-{ratio:g}",
        family="ring-twist",
        title=f"Twisted ring (Michell), GJ / EI = {ratio:g}",
        about="A hose bent into a ring, its ends clamped to each other, is twisted until it leaves "
        "its plane. Compared: the angle at which the flat ring loses its stability, "
        "2 pi sqrt(3) EI / GJ. A turn about the clamps' tangent costs nothing; the mode after it "
        "counts.",
        spec=replace(STOUT, torsional_stiffness=ratio * BENDING_STIFFNESS),
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        planar=False,
        truth=lambda: np.array([torsion.ring_twist(ratio)]),
        # With other ratios the statics of the cable, whose joints mix bending and twist, get stuck.
        models=("geds", "cable") if ratio == 1.0 else ("geds",),
        resolutions={"geds": (16, 24), "cable": (20, 40)},
        promised={16: 5e-3, 24: 5e-4},
    )


def make_greenhill(pull: float) -> Case:
    """A straight rod, clamped at both ends, under tension and twist; pull = T L^2 / EI."""
    tension = pull * BENDING_STIFFNESS / LENGTH**2
    clamps: WeakKeyDictionary[HoseModel, Hold] = WeakKeyDictionary()

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]])
        tangent = (1.0, 0.0, 0.0)
        far = LENGTH * (1.0 + tension / hose.spec.axial_stiffness)
        holds = [hose.clamp(0.0, (0.0, 0.0, 0.0), tangent)]
        holds.append(hose.clamp(LENGTH, (far, 0.0, 0.0), tangent))
        clamps[hose] = holds[1]
        return holds

    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        straight = hose.linearize()
        spin_clamp(hose, clamps[hose], 1.0)
        moment = float(hose.torque(0.5 * LENGTH)[0])
        critical = compute_critical_twist(straight, hose.linearize(), moment)
        return np.array([critical * LENGTH / BENDING_STIFFNESS])

    return Case(
        id=f"greenhill-pull-{pull:g}",
        family="greenhill",
        title=f"Twisted rod under tension (Greenhill), T L^2 / EI = {pull:g}",
        about="A straight rod, both ends clamped, under tension T is twisted until it writhes. "
        "Compared: the moment M at which the straight state loses its stability, as M L / EI.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        planar=False,
        truth=lambda: np.array([torsion.greenhill(pull)]),
        # A chain of rigid segments takes no tension from where its ends are.
        models=("geds", "cable") if pull == 0.0 else ("geds",),
        resolutions={"geds": (8, 12, 16, 24), "cable": (20, 40)},
        promised={16: 2e-3},
    )


def make_helix() -> Case:
    """The localized helix of a long twisted rod: 27 turns, slack of 0.3."""
    rod = torsion.HELIX
    spec = HoseSpec(
        length=rod.length,
        # The slack is off by 1.5e-4 of itself where EA is this, and rounding is still small.
        axial_stiffness=1e7,
        bending_stiffness=rod.bending_stiffness,
        torsional_stiffness=rod.torsional_stiffness,
        linear_density=0.1,
    )
    clamps: WeakKeyDictionary[HoseModel, Hold] = WeakKeyDictionary()

    def lay(hose: HoseModel) -> list[Hold]:
        s = np.linspace(0.0, rod.length, 20001)
        # Not the solution: an angle and a tension of some percent more.
        tangents = torsion.compute_localized_tangents(rod, s - 0.5 * rod.length, 1.0, 50.0)
        spline = _check_spline(hose)
        spline.reset(CubicSpline(s, tangents).antiderivative(), director=(0.0, 1.0, 0.0))
        tangent, director = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
        holds = [spline.clamp(0.0, (0.0, 0.0, 0.0), tangent, director)]
        far = (rod.length - rod.slack, 0.0, 0.0)
        holds.append(spline.clamp(rod.length, far, tangent, director))
        clamps[hose] = holds[1]
        return holds

    def probe(hose: HoseModel) -> Array:
        hose.move(clamps[hose], spin=2.0 * math.pi * rod.turns)
        hose.solve_static()
        s = np.linspace(0.4, 0.6, 2001) * rod.length
        envelope = float(np.arccos(hose.tangent(s)[:, 0]).max())
        reaction = hose.reaction(clamps[hose])
        return np.array([envelope, reaction.force[0], reaction.moment[0]])

    return Case(
        id="helix",
        family="helix",
        title="Localized helix with 27 turns",
        about="A long rod with 27 turns of twist and a slack of 3 % coils up in its middle. "
        "Compared: the largest angle to the axis, tension and moment, with the infinite rod's.",
        spec=spec,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        planar=False,
        truth=lambda: np.array(torsion.solve_localized_helix(rod)),
        models=("geds",),
        resolutions={"geds": (64, 100, 130)},
        promised={100: 5e-3, 130: 1e-3},
    )


def make_coil() -> Case:
    """A coil spring of 12 turns under an axial wrench."""
    n_turns, radius, pitch_angle = 12, 0.02, 0.1
    turning = math.cos(pitch_angle) / radius
    length = 2.0 * math.pi * n_turns / turning
    rise = math.sin(pitch_angle)
    stiffness, twist_stiffness = 1e-2, 0.8e-2
    spec = HoseSpec(
        length=length,
        axial_stiffness=1e4 * stiffness / radius**2,
        bending_stiffness=stiffness,
        torsional_stiffness=twist_stiffness,
        linear_density=0.05,
        outer_radius=1e-3,
        rest_curvature=turning * math.cos(pitch_angle),
        rest_torsion=turning * rise,
    )
    force = 1e-6 * stiffness / radius**2

    def curve(s: Array) -> Array:
        angle = turning * s
        places = [radius * np.cos(angle), radius * np.sin(angle), rise * s]
        return np.stack(places, axis=1)

    def lay(hose: HoseModel) -> list[Hold]:
        binormal = (0.0, -rise, math.cos(pitch_angle))
        _check_spline(hose).reset(curve, director=binormal)
        holds = [hose.clamp(0.0)]
        hose.solve_static()
        return holds

    def probe(hose: HoseModel) -> Array:
        tip = hose.position(length)[0]
        # A force along the axis, carried over to the end of the wire.
        hose.apply_force(length, (0.0, 0.0, force))
        hose.apply_moment(length, (-tip[1] * force, tip[0] * force, 0.0))
        hose.solve_static()
        longer = float(hose.position(length)[0, 2] - tip[2])
        return np.array([longer / force])

    return Case(
        id="coil",
        family="coil",
        title="Coil spring of 12 turns under an axial wrench",
        about="A hose that is a coil at rest (pitch angle .1) is pulled along its axis, a little. "
        "Compared: its softness, L [(R cos a)^2 / GJ + (R sin a)^2 / EI].",
        spec=spec,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        planar=False,
        truth=lambda: np.array([torsion.coil_softness(spec, radius, pitch_angle)]),
        models=("geds",),
        resolutions={"geds": (6 * n_turns, 8 * n_turns, 12 * n_turns)},
        promised={8 * n_turns: 5e-3},
    )
