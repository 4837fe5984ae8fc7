"""Closed forms and one-dimensional boundary value problems that need no hose model.

Unit system of every function: lengths in hose lengths L, forces in EI / L^2, moments in EI / L,
unless its docstring says otherwise. The elastica is solved as an initial value problem with a
shooting angle to 1e-12; it is exact for an inextensible, unshearable rod.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import jn_zeros

from hose_mj.hoses.protocol import Array


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


def capstan(friction: float, angle: float) -> float:
    """Ratio of the pulls on a rope that slides over a drum: exp(mu theta) (Euler, Eytelwein)."""
    return math.exp(friction * angle)
