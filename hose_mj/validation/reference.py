"""Closed forms, one-dimensional boundary value problems and benchmarks that need no hose model.

Unit system of every function: lengths in hose lengths L, forces in EI / L^2, moments in EI / L,
unless its docstring says otherwise. The elastica is solved as an initial value problem with a
shooting angle to 1e-12; it is exact for an inextensible, unshearable rod.
"""

import cmath
import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, fsolve
from scipy.special import ellipe, ellipj, ellipk, jn_zeros

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


def elastic_catenary(spec: HoseSpec, span: float, weight: float) -> tuple[Array, CubicSpline]:
    """A rope that stretches and does not resist bending between two points of one height.

    x(s) = H s / EA + (H / w) [asinh(V / H) - asinh((V - w s) / H)], V = w L / 2, likewise z (Irvine
    1981), with the H for which x(L) is the span.

    Args:
        spec: of the rope.
        span: between its ends (m).
        weight: w, per length at rest (N/m).

    Returns:
        force (2,) of the far support on it along x and z (N), and places (k, 3), m, by arc length
        at rest; the near end is at the origin, z is up.
    """
    length, stiffness, pull = spec.length, spec.axial_stiffness, 0.5 * weight * spec.length

    def place(s: Array, h: float) -> Array:
        up = (pull - weight * s) / h
        x = h * s / stiffness + h / weight * (np.arcsinh(pull / h) - np.arcsinh(up))
        bent = h / weight * (np.sqrt(1.0 + up**2) - np.sqrt(1.0 + (pull / h) ** 2))
        return np.stack([x, 0.0 * x, bent - s * (pull - 0.5 * weight * s) / stiffness], axis=-1)

    h = brentq(lambda h: place(np.array(length), h)[0] - span, 1e-6 * pull, stiffness, xtol=1e-14)
    s = np.linspace(0.0, length, 4001)
    return np.array([h, pull]), CubicSpline(s, place(s, h))


def whirling_rope(k: float, half_span: float) -> tuple[float, float, CubicSpline]:
    """A rope without weight and stiffness that turns about the line through its ends.

    r(x) = rm sn(K (1 + x / a), k) with rm = 2 k a / (k'^2 K), K and E the complete elliptic
    integrals, k'^2 = 1 - k^2, a the half span; its length is 2 a (2 E / (k'^2 K) - 1).

    Args:
        k: modulus, above 0 and below 1; the larger, the more the rope bulges.
        half_span: a (m).

    Returns:
        its length (m); the axial force over linear density and squared rate of turning, a^2 / (K
        k')^2 (m^2); and places (n, 2), m, along and off the axis by arc length.
    """
    m = k * k
    rest, whole = 1.0 - m, float(ellipk(m))
    x = half_span * np.linspace(-1.0, 1.0, 20001)
    sn, cn, dn, _ = ellipj(whole * (1.0 + x / half_span), m)
    slope = 2.0 * k / rest * cn * dn
    s = cumulative_simpson(np.sqrt(1.0 + slope**2), x=x, initial=0.0)
    radius = 2.0 * k * half_span / (rest * whole) * sn
    length = 2.0 * half_span * (2.0 * float(ellipe(m)) / (rest * whole) - 1.0)
    curve = CubicSpline(s * length / s[-1], np.stack([x, radius], axis=1))
    return length, half_span**2 / (whole**2 * rest), curve


@dataclass(frozen=True)
class MooringLine:
    """A line without bending stiffness from an anchor on the sea bed, at the origin, to a fairlead.

    Friction holds the part on the bed back from sliding towards the fairlead, all along it.
    """

    span: float  # m, to the fairlead along x
    height: float  # m, to the fairlead
    length: float  # at rest (m)
    axial_stiffness: float  # N
    weight: float  # per length at rest, in water (N/m)
    friction: float  # Coulomb's coefficient of the bed
    slope: float  # of the bed, rising towards the fairlead (rad)
    horizontal: float  # force at the fairlead (N)
    vertical: float  # the same
    anchor: float  # force at the anchor (N)
    rests: float  # length at rest on the bed (m); 0 where there is none


_LONG = (848.67, 250.0, 902.2, 384.243e6, 698.094)
_SHORT = (8.0, 3.0, 8.8, 1e4, 5.0)
MOORINGS = {
    "long": MooringLine(*_LONG, 0.0, 0.0, 736938.32, 535727.45, 736938.32, 134.7855),
    "long-rough": MooringLine(*_LONG, 1.0, 0.0, 737375.92, 535869.34, 643424.86, 134.5823),
    "short": MooringLine(*_SHORT, 0.0, 0.0, 38.175784, 36.919238, 38.175784, 1.416152),
    "short-rough": MooringLine(*_SHORT, 0.5, 0.0, 38.198937, 36.928551, 34.663212, 1.414290),
    "slack": MooringLine(
        *(9.0, 3.0, 10.0, 300.0, 5.0), 1.0, 0.0, 12.172664, 23.278997, 0.0, 5.344201
    ),
    "slope": MooringLine(
        *_SHORT, 0.0, math.radians(5.0), 31.030032, 32.372963, 29.898590, 2.868363
    ),
    "slope-rough": MooringLine(
        *_SHORT, 0.5, math.radians(5.0), 31.138345, 32.425275, 22.888768, 2.859795
    ),
    "hanging": MooringLine(
        *(8.0, 3.0, 10.0, 1e4, 5.0), 0.0, 0.0, 18.934319, 34.544744, 24.441189, 0.0
    ),
}
"""Lines by name, computed with MoorPy 1.3 (function `catenary`, tolerance 1e-11) and a shooting
code of our own, which agrees to 1e-7. "slope-rough" is of the latter: MoorPy's friction does not
count that the bed carries the weight times the cosine of its slope."""


def lay_slack_line(line: MooringLine, pull: float, s: Array) -> Array:
    """Returns places (k, 3), m, of a mooring line at arc lengths s (k,), drawn by a smaller pull.

    It is inextensible: straight on the bed, then a catenary of horizontal force `pull` (N) up to
    the height of the fairlead.
    """
    start = pull * math.tan(line.slope)

    def rise(up: Array) -> Array:
        return (np.hypot(pull, start + line.weight * up) - math.hypot(pull, start)) / line.weight

    def miss(up: float) -> float:
        return float((line.length - up) * math.sin(line.slope) + rise(np.array(up)) - line.height)

    touchdown = line.length - float(brentq(miss, 0.0, line.length))
    flat, up = np.minimum(s, touchdown), np.maximum(s - touchdown, 0.0)
    turn = np.arcsinh((start + line.weight * up) / pull) - math.asinh(start / pull)
    x = flat * math.cos(line.slope) + pull / line.weight * turn
    return np.stack([x, 0.0 * s, flat * math.sin(line.slope) + rise(up)], axis=1)


def stream_slope(weight: float, drag: float) -> float:
    """Cosine of the angle to a current at which a line hangs straight in it.

    Across the line its weight w and drag D sin^2 are in balance: w cos = D sin^2.

    Args:
        weight: w, per length in the fluid (N/m).
        drag: D, of a line across the current (N/m).
    """
    return (math.hypot(weight, 2.0 * drag) - weight) / (2.0 * drag)


_KNOT = np.array(
    [(150, 200, 300, 500, 700, 1000), (1.326, 1.262, 1.196, 1.139, 1.113, 1.0905)], dtype=float
)


def find_knot_pull(shortening: float) -> float:
    """Pull T on an overhand knot without friction, as T e^2 / (2 pi^2 EI), for e in 150 to 1000.

    Audoly, Clauvelin and Neukirch, PRL 99, 164301 (2007): elastica for loop and tails, joined by a
    braid in contact.

    Args:
        shortening: e, how much nearer the ends are than the rope is long, in radii of the rope.
    """
    # Nearly linear in sqrt(radius / e), by which the limit 1 is approached.
    return float(np.interp(-(shortening**-0.5), -(_KNOT[0] ** -0.5), _KNOT[1]))


def find_plectoneme_moment(tension: float) -> float:
    """Moment M h / EI of a long plectoneme without friction at a tension T h^2 / EI, h the radius.

    Clauvelin, Audoly and Neukirch, Macromolecules 41, 4479 (2008): two strands in contact wound
    at an angle a to their axis, T h^2 / EI = sin^4 a (1/2 + 1 / cos 2a) and M h / EI = 2 cos a
    sin^3 a / cos 2a.
    """

    def pull(a: float) -> float:
        return math.sin(a) ** 4 * (0.5 + 1.0 / math.cos(2.0 * a))

    a = brentq(lambda a: pull(a) - tension, 0.0, 0.78)  # below pi / 4, where strands jam
    return 2.0 * math.cos(a) * math.sin(a) ** 3 / math.cos(2.0 * a)
