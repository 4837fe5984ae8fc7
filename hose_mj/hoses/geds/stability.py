"""Whether an equilibrium is stable: signs of the tangent stiffness on what the holds leave free.

A motion that grows must grow faster than a rate: rounding alone, or a motion that nothing resists
(a hanging hose about the vertical, a hose without holds), is not called unstable.
"""

from __future__ import annotations

from hose_mj.hoses.geds.band import factorize_indefinite
from hose_mj.hoses.geds.kkt import add_constraint_weight, solve_with_constraints
from hose_mj.hoses.geds.newton import add_mass
from hose_mj.hoses.geds.records import NOT_POSITIVE
from hose_mj.jit import compiled


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
