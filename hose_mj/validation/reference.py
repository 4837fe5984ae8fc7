"""Closed forms, one-dimensional boundary value problems and benchmarks that need no hose model.

Unit system of every function: lengths in hose lengths L, forces in EI / L^2, moments in EI / L,
unless its docstring says otherwise. The elastica is solved as an initial value problem with a
shooting angle to 1e-12; it is exact for an inextensible, unshearable rod.
"""

import cmath
import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from scipy.special import jn_zeros

from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec


def _shoot(load: float, weight: float) -> tuple[float, float]:
    """Tip (x, y) of a horizontal cantilever under a tip load and its own weight, both downward.

    Shoots from the tip, where only the angle is unknown, to the wall, where it must vanish.
    """

    def rates(sigma: float, state: Array) -> list[float]:
        angle, curvature = state[:2]
        force = load + weight * sigma
        return [-curvature, force * math.cos(angle), math.cos(angle), math.sin(angle)]

    def integrate(tip_angle: float) -> Array:
        start = [tip_angle, 0.0, 0.0, 0.0]
        end = solve_ivp(rates, (0.0, 1.0), start, method="DOP853", rtol=1e-12, atol=1e-13)
        return np.asarray(end.y[:, -1])

    tip_angle = brentq(lambda a: integrate(a)[0], 0.0, 0.5 * math.pi, xtol=1e-15, rtol=1e-14)
    x, y = integrate(tip_angle)[2:]
    return float(x), float(y)


def heavy_cantilever(gamma: float) -> float:
    """Drop over width H / W of a heavy cantilever (Romero 2021), gamma = rho A g L^3 / EI."""
    x, y = _shoot(0.0, gamma)
    return y / x


def tip_load(alpha: float) -> tuple[float, float]:
    """Axial and transverse displacement of the tip under a transverse load alpha = P L^2 / EI."""
    x, y = _shoot(alpha, 0.0)
    return 1.0 - x, y


def end_moment(turn: float) -> tuple[float, float]:
    """Tip (x, y) of a cantilever rolled up by an end moment, turn = M L / EI."""
    return math.sin(turn) / turn, (1.0 - math.cos(turn)) / turn


_CHARACTERISTIC = {
    "clamped-free": lambda b: math.cos(b) + 1.0 / math.cosh(b),
    "free-free": lambda b: math.cos(b) - 1.0 / math.cosh(b),
    "clamped-pinned": lambda b: math.sin(b) - math.tanh(b) * math.cos(b),
}
_FIRST_ROOT = {"clamped-free": 0.6, "free-free": 1.5, "clamped-pinned": 1.25}


def beam_frequencies(ends: str, n_modes: int = 3) -> Array:
    """First (beta L)^2 of an Euler-Bernoulli beam: omega = (beta L)^2 sqrt(EI / (rho A L^4)).

    Args:
        ends: "clamped-free", "free-free" or "clamped-pinned".
        n_modes: how many.
    """
    roots = []
    for mode in range(n_modes):
        middle = (_FIRST_ROOT[ends] + mode) * math.pi
        roots.append(brentq(_CHARACTERISTIC[ends], middle - 0.5, middle + 0.5, xtol=1e-14))
    return np.array(roots) ** 2


def chain_frequencies(n_modes: int = 3) -> Array:
    """First omega sqrt(L / g) of a hanging chain: half the zeros of the Bessel function J0."""
    return np.asarray(jn_zeros(0, n_modes)) / 2.0


def catenary(length_over_span: float) -> tuple[float, float]:
    """Sag over length, largest tension over weight of a chain between points of one height."""
    # Span 1: length = 2 a sinh(1 / (2 a)).
    a = brentq(lambda a: 2.0 * a * math.sinh(0.5 / a) - length_over_span, 0.05, 50.0, xtol=1e-15)
    height = a * math.cosh(0.5 / a)
    return (height - a) / length_over_span, height / length_over_span


def euler_load(ends: str) -> float:
    """Critical thrust P L^2 / EI: "clamped-free" or "pinned"."""
    return {"clamped-free": math.pi**2 / 4.0, "pinned": math.pi**2}[ends]


def capstan(friction: float, angle: float, bending: float = 0.0) -> float:
    """Ratio of the pulls on a rope that slides over a drum: exp(mu theta) (Euler, Eytelwein).

    To first order in its bending, b = EI / (2 T rho^2) with T the lesser pull and rho the radius of
    its centre line: it leaves the drum where its moment is EI / rho, cos(alpha) = 1 - b before its
    legs are straight, and the point forces T sin(alpha) there rub too.
    """
    ratio = math.exp(friction * angle)
    return ratio * (1.0 - (1.0 + friction**2) * bending * (1.0 - 1.0 / ratio))


BEND_45 = {300.0: (58.78, 22.25, 40.19), 600.0: (47.15, 15.68, 53.47)}
"""Tip of the 45-degree bend by load: along the first tangent, across in the plane, out of it.

Bathe and Bolourchi (1979), in the digits that later codes agree on."""


def ring_twist(ratio: float) -> float:
    """Angle (rad) at which a closed ring leaves its plane, ratio = GJ / EI (Michell 1889)."""
    return 2.0 * math.pi * math.sqrt(3.0) / ratio


def greenhill(pull: float) -> float:
    """Moment M L / EI at which a clamped straight rod under tension writhes, pull = T L^2 / EI.

    With w = y + i z: w'''' - i M w''' - T w'' = 0, w = w' = 0 at both ends. Its solutions are
    1, s and exp(r s) with r = i M / 2 +- sqrt(T - M^2 / 4); M is where the four conditions depend
    on each other.
    """
    if pull == 0.0:
        # r = 0 twice more; what is left is tan(M / 2) = M / 2.
        half = brentq(lambda x: math.sin(x) - x * math.cos(x), math.pi, 1.5 * math.pi, xtol=1e-14)
        return 2.0 * float(half)

    def determinant(moment: float) -> float:
        root = cmath.sqrt(pull - 0.25 * moment**2)
        rows = []
        for end in (-0.5, 0.5):
            powers = [0.5j * moment + root, 0.5j * moment - root]
            values = [cmath.exp(power * end) for power in powers]
            slopes = [power * value for power, value in zip(powers, values, strict=True)]
            rows += [[1.0, end, *values], [0.0, 1.0, *slopes]]
        # Divided by what makes it real and takes out the double root at M^2 = 4 T.
        return float((np.linalg.det(np.array(rows)) / root).real)

    start = 2.0 * math.sqrt(pull) + 1e-3
    grid = np.linspace(start, start + 12.0, 400)
    values = [determinant(moment) for moment in grid]
    first = next(k for k in range(len(grid)) if values[k] * values[k + 1] < 0.0)
    return float(brentq(determinant, grid[first], grid[first + 1], xtol=1e-12))


@dataclass(frozen=True)
class TwistedRod:
    """A long rod between two clamps: stiffnesses (N m^2), length and slack (m), turns."""

    bending_stiffness: float
    torsional_stiffness: float
    length: float
    slack: float
    turns: float


HELIX = TwistedRod(1.345, 0.789, 9.29, 0.3, 27.0)
"""The rod of van der Heijden et al. (2003), a common benchmark of discrete rods."""


def solve_localized_helix(rod: TwistedRod) -> tuple[float, float, float]:
    """Envelope angle phi0 (rad), tension T (N) and moment M (N m) of the localized helix.

    Coyne (1990): M^2 = 2 B T (1 + cos phi0), slack = 4 sqrt(B / T) sin(phi0 / 2), and turns in
    radians = M L / C + 4 arccos(M / (2 sqrt(B T))). Exact for an infinite rod; the ends of this one
    are off by 1e-10.
    """
    bending, length = rod.bending_stiffness, rod.length

    def miss(unknowns: Array) -> list[float]:
        angle, tension = unknowns
        moment = math.sqrt(2.0 * bending * tension * (1.0 + math.cos(angle)))
        slack = 4.0 * math.sqrt(bending / tension) * math.sin(0.5 * angle)
        writhe = 4.0 * math.acos(moment / (2.0 * math.sqrt(bending * tension)))
        turns = moment * length / rod.torsional_stiffness + writhe
        return [slack - rod.slack, turns - 2.0 * math.pi * rod.turns]

    angle, tension = fsolve(miss, [0.9, 47.0], xtol=1e-13)
    moment = math.sqrt(2.0 * bending * tension * (1.0 + math.cos(angle)))
    return float(angle), float(tension), moment


def compute_localized_tangents(rod: TwistedRod, s: Array, angle: float, tension: float) -> Array:
    """Returns unit tangents (k, 3) of the localized helix about x, its middle at s = 0.

    cos phi = 1 - 2 (1 - m^2) sech^2(s sqrt((1 - m^2) T / B)) with m = cos(angle / 2); the plane of
    the bend turns by M / (B (1 + cos phi)).
    """
    m = math.cos(0.5 * angle)
    rate = math.sqrt((1.0 - m * m) * tension / rod.bending_stiffness)
    cosine = 1.0 - 2.0 * (1.0 - m * m) / np.cosh(rate * s) ** 2
    moment = 2.0 * m * math.sqrt(rod.bending_stiffness * tension)
    turning = moment / (rod.bending_stiffness * (1.0 + cosine))
    steps = 0.5 * (turning[1:] + turning[:-1]) * np.diff(s)
    azimuth = np.concatenate([[0.0], np.cumsum(steps)])
    azimuth -= np.interp(0.0, s, azimuth)
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    return np.stack([cosine, sine * np.cos(azimuth), sine * np.sin(azimuth)], axis=1)


def coil_softness(spec: HoseSpec, radius: float, pitch_angle: float) -> float:
    """Extension over axial force (m/N) of a coil whose ends may turn about its axis.

    L [(R cos a)^2 / GJ + (R sin a)^2 / EI] for the rod's bending and twist, L sin^2 a / EA for its
    stretching (Love 1927).
    """
    cosine, sine = math.cos(pitch_angle), math.sin(pitch_angle)
    twisting = (radius * cosine) ** 2 / spec.torsional_stiffness
    bending = (radius * sine) ** 2 / spec.bending_stiffness
    return spec.length * (twisting + bending + sine**2 / spec.axial_stiffness)
