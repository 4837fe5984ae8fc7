"""Whether an equilibrium is stable: signs of the tangent stiffness on what the holds leave free.

A motion that grows must grow faster than a rate: rounding alone, or a motion that nothing resists
(a hanging hose about the vertical, a hose without holds), is not called unstable.
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds import records
from hose_mj.hoses.geds.band import factorize_indefinite
from hose_mj.hoses.geds.kkt import add_constraint_weight, solve_with_constraints
from hose_mj.hoses.geds.newton import add_mass
from hose_mj.hoses.geds.records import NOT_POSITIVE
from hose_mj.jit import compiled

_ROUNDING = 1e-12
"""Of the largest stiffness over mass (1/s^2): what is below is no sign of anything."""
_SLOW = 1e-2
"""Of EI / (rho L^4), whose square root is the slowest bending motion's angular frequency over 3.5:
the square of a rate below which growth counts as none."""


def find_least_rate(hose: records.Hose, length: float, work: records.Work) -> float:
    """Returns the square of the slowest growth that counts (1/s^2), with the stiffness in work."""
    size = len(work.signs)
    mass = float(np.mean(hose.mass[:, 0]))
    density = float(hose.mass.sum() * 2.0 - hose.mass[:, 0].sum()) / length
    bending = float(np.max(hose.elasticity.bending_stiffness)) / (density * length**4)
    return max(_ROUNDING * float(np.abs(work.band[:size, 0]).max()) / mass, _SLOW * bending)


@compiled
def is_positive(axes, hose, constraints, least_rate, work):
    """Whether stiffness plus `least_rate` times mass is positive definite on what rows leave free.

    Args:
        axes: (0.0,) * n_dof.
        hose: constants.
        constraints: holds and twist, at the present shape.
        least_rate: (1/s^2).
        work: with the exact stiffness in its band; written.
    """
    size = len(work.signs)
    add_mass(axes, hose, least_rate, work.band)
    for k in range(len(work.gradient)):
        work.gradient[k] = 0.0
    for row in range(len(work.shift)):
        work.shift[row] = 0.0
    add_constraint_weight(axes, constraints, 1.0, size, work)
    n_negative = factorize_indefinite(axes, size, work.band, work.signs)
    if n_negative < 0:
        return False
    verdict = solve_with_constraints(axes, constraints, 0.0, 1.0, n_negative, size, work)
    return verdict != NOT_POSITIVE
