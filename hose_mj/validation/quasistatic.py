"""Slow towing over a rough floor: the reference, a chain that minimises increment by increment.

Moved slowly, a hose on a floor is in equilibrium with friction at every moment. Over a small
increment of the towed end that is the minimum, over the nodes' places x in the plane, of

    sum_e EA/2 h (|d_e| / h - 1)^2 + sum_i EI/2 |d_(i+1) - d_i|^2 / h^3
        + mu w sum_i h_i sqrt(|x_i - x_i^before|^2 + delta^2),

d the chords of a chain of rest lengths h, w the weight per length (the incremental principle of
rate-independent plasticity; Mielke and Theil 2004). No spline, no time, no velocity: it shares
nothing with the hose models but the Cholesky factorization. delta is a small part of the increment.
"""

from __future__ import annotations

import numpy as np

from hose_mj.errors import StepError
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation.quasistatic_kernels import WIDTH, settle


def tow_chain(
    spec: HoseSpec, friction: float, start: Array, path: Array, delta: float, gravity: float = 9.81
) -> Array:
    """Tows a chain by its last node.

    Args:
        spec: the hose; stretching, bending and weight count.
        friction: Coulomb's coefficient of the floor.
        start: nodes (N + 1, 2) of the chain at rest, evenly spaced along it, m.
        path: places of the last node, one an increment, (k, 2), m.
        delta: slip below which friction is smoothed (m), well below an increment.
        gravity: m/s^2.

    Returns:
        nodes after each increment, (k, N + 1, 2), m.

    Raises:
        StepError: an increment that does not converge.
    """
    n = len(start)
    h = spec.length / (n - 1)
    drag = friction * spec.linear_density * gravity
    numbers = (h, spec.axial_stiffness, spec.bending_stiffness, drag, delta, 1e-3 * delta)
    x = np.array(start, dtype=np.float64).ravel()
    padded = 2 * n + WIDTH
    work = np.zeros(padded), np.zeros((padded, 2 * WIDTH)), np.zeros((1, padded)), np.zeros(2 * n)
    shapes = np.empty((len(path), n, 2))
    for k, place in enumerate(path):
        before = x.copy()
        x[-2:] = place
        if not settle(x, before, numbers, *work):
            raise StepError(f"increment {k} of the tow did not converge")
        shapes[k] = x.reshape(n, 2)
    return shapes
