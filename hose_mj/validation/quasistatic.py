"""Slow towing over a rough floor: the reference, a chain that minimises increment by increment.

Moved slowly, a hose on a floor is in equilibrium with friction at every moment. Over a small
increment of the towed end that is the minimum, over the nodes' places x in the plane, of

    sum_e EA/2 h (|d_e| / h - 1)^2 + sum_i EI/2 |d_(i+1) - d_i|^2 / h^3
        + mu w sum_i h_i sqrt(|x_i - x_i^before|^2 + delta^2),

d the chords of a chain of rest lengths h, w the weight per length (the incremental principle of
rate-independent plasticity; Mielke and Theil 2004). No spline, no time, no velocity: it shares
nothing with the hose models but the Cholesky factorization. delta is a small part of the increment.
"""

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.band import factorize, solve_lower, solve_upper
from hose_mj.hoses.protocol import Array
from hose_mj.jit import compiled, kernel

_AXES = (0.0, 0.0)
WIDTH = 8  # columns of the band that `factorize` expects; the chain fills six
_ITERATIONS = 200  # Newton steps after which an increment that has not converged is given up


class Chain(NamedTuple):
    """A chain on a rough floor."""

    h: float  # rest length of a link (m)
    # stretch, bend: EA (N) and EI (N m^2).
    stretch: float
    bend: float
    drag: float  # friction per length (N/m)
    delta: float  # slip below which friction is smoothed (m)
    tolerance: float  # largest change of a coordinate in a converged Newton step (m)


@kernel
def _compute_energy(x: Array, before: Array, chain: Chain) -> float:
    """The function that is minimised (J)."""
    h, stretch, bend, drag, delta, _ = chain
    n = len(x) // 2
    energy = 0.0
    for i in range(n):
        share = 0.5 if i == 0 or i == n - 1 else 1.0
        m0, m1 = x[2 * i] - before[2 * i], x[2 * i + 1] - before[2 * i + 1]
        energy += share * h * drag * (np.sqrt(m0 * m0 + m1 * m1 + delta * delta) - delta)
    for e in range(n - 1):
        d0, d1 = x[2 * e + 2] - x[2 * e], x[2 * e + 3] - x[2 * e + 1]
        energy += 0.5 * stretch * h * (np.sqrt(d0 * d0 + d1 * d1) / h - 1.0) ** 2
        if e > 0:
            c0 = x[2 * e + 2] - 2.0 * x[2 * e] + x[2 * e - 2]
            c1 = x[2 * e + 3] - 2.0 * x[2 * e + 1] + x[2 * e - 1]
            energy += 0.5 * bend * (c0 * c0 + c1 * c1) / h**3
    return energy


@kernel
def _build(x: Array, before: Array, chain: Chain, gradient: Array, band: Array) -> None:
    """Writes the gradient and a positive definite second derivative (compression is left out)."""
    h, stretch, bend, drag, delta, _ = chain
    n = len(x) // 2
    gradient[:] = 0.0
    band[:, :] = 0.0
    for i in range(n):
        share = 0.5 if i == 0 or i == n - 1 else 1.0
        k = 2 * i
        m0, m1 = x[k] - before[k], x[k + 1] - before[k + 1]
        s = np.sqrt(m0 * m0 + m1 * m1 + delta * delta)
        c = share * h * drag / s
        gradient[k] += c * m0
        gradient[k + 1] += c * m1
        band[k, 0] += c * (1.0 - m0 * m0 / (s * s))
        band[k, 1] -= c * m0 * m1 / (s * s)
        band[k + 1, 0] += c * (1.0 - m1 * m1 / (s * s))
    for e in range(n - 1):
        k = 2 * e
        d0, d1 = x[k + 2] - x[k], x[k + 3] - x[k + 1]
        far = np.sqrt(d0 * d0 + d1 * d1)
        t0, t1 = d0 / far, d1 / far
        tension = stretch * (far / h - 1.0)
        across = max(tension, 0.0) / far
        along = stretch / h - across
        h00, h01, h11 = along * t0 * t0 + across, along * t0 * t1, along * t1 * t1 + across
        gradient[k] -= tension * t0
        gradient[k + 1] -= tension * t1
        gradient[k + 2] += tension * t0
        gradient[k + 3] += tension * t1
        for j in (k, k + 2):
            band[j, 0] += h00
            band[j, 1] += h01
            band[j + 1, 0] += h11
        band[k, 2] -= h00
        band[k, 3] -= h01
        band[k + 1, 1] -= h01
        band[k + 1, 2] -= h11
        if e == 0:
            continue
        stiff = bend / h**3
        for c in range(2):
            kink = x[k + 2 + c] - 2.0 * x[k + c] + x[k - 2 + c]
            for i, left in ((-2, 1.0), (0, -2.0), (2, 1.0)):
                gradient[k + i + c] += stiff * left * kink
                for j, right in ((-2, 1.0), (0, -2.0), (2, 1.0)):
                    if i >= j:
                        band[k + j + c, i - j] += stiff * left * right


@compiled
def settle(
    x: Array, before: Array, chain: Chain, gradient: Array, band: Array, row: Array, trial: Array
) -> bool:
    """Newton's iteration with a line search on the energy; the last node stays. False if stuck."""
    size = len(x)
    energy = _compute_energy(x, before, chain)
    for _ in range(_ITERATIONS):
        _build(x, before, chain, gradient, band)
        # The towed node: its unknowns leave the system.
        for k in range(size - 2, size):
            gradient[k] = 0.0
            for m in range(1, WIDTH):
                if k - m >= 0:
                    band[k - m, m] = 0.0
            band[k, 1] = 0.0
            band[k, 0] = 1.0
        if not factorize(_AXES, size, band):
            return False
        row[0, :] = 0.0
        for k in range(size):
            row[0, k] = -gradient[k]
        solve_lower(_AXES, size, band, row)
        solve_upper(_AXES, size, band, row[0])
        largest = 0.0
        slope = 0.0
        for k in range(size):
            largest = max(largest, abs(row[0, k]))
            slope += gradient[k] * row[0, k]
        factor = 1.0
        while True:
            for k in range(size):
                trial[k] = x[k] + factor * row[0, k]
            found = _compute_energy(trial, before, chain)
            if found <= energy + 1e-4 * factor * slope or factor < 1e-6:
                break
            factor *= 0.5
        for k in range(size):
            x[k] = trial[k]
        energy = found
        if largest * factor <= chain.tolerance:
            return True
    return False
