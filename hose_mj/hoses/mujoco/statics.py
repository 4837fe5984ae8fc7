"""Static equilibrium and small motions of a hose inside an mjModel, whatever its unknowns are.

With the force f(x) of springs, gravity and loads at zero velocity, the errors c(x) of holds and
rigid parts, their Jacobian J and their forces lambda, equilibrium is f + J^T lambda = 0 and c = 0.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from hose_mj.errors import StepError
from hose_mj.hoses.protocol import Array, Linearization

_MOST_TURN, _LEAST_TURN = 0.5, 0.02  # rad a segment may turn in one iteration
_PLAIN, _GUARDED = 60, 300  # most iterations
_TOLERANCE = 1e-9  # of forces against the largest around, of errors against L
_RANK = 1e-6  # holds weaker than this, against the strongest, are redundant


class StaticSystem(ABC):
    """The functions f, c and J of a hose with n unknowns x.

    Attributes:
        pose: where the hose is.
        conservative: the forces have an energy; that of a moment which keeps its direction in
            space has none.
        softest: the least stiffness over mass that a Newton step believes (1/s^2); a coordinate
            without stiffness, such as the twist of a hose without GJ, stays where it is.
    """

    pose: Any
    conservative: bool
    softest: float

    @abstractmethod
    def set_pose(self, pose: Any) -> None:
        """Moves the hose there."""

    @abstractmethod
    def advance(self, change: Array) -> None:
        """Moves by a change of the unknowns (n,)."""

    @abstractmethod
    def force(self, multipliers: Array) -> Array:
        """F + J^T lambda here (n,)."""

    @abstractmethod
    def errors(self) -> Array:
        """The errors c here (c,)."""

    @abstractmethod
    def constraints(self) -> Array:
        """Their Jacobian J here (c, n)."""

    @abstractmethod
    def mass(self) -> Array:
        """Mass matrix here (n, n)."""

    @abstractmethod
    def stiffness(self, multipliers: Array, *, central: bool = False) -> Array:
        """-d(f + J^T lambda)/dx at fixed lambda by finite differences (n, n)."""

    @abstractmethod
    def largest_turn(self, change: Array) -> float:
        """Largest rotation of any segment in a change of the unknowns (rad)."""

    @abstractmethod
    def residual(self, multipliers: Array) -> float:
        """Largest dimensionless residual of both equations."""

    def idle_motions(self) -> Array:
        """Rows (k, n) of the motions that nothing resists; they count as held."""
        return np.zeros((0, len(self.force(np.zeros(len(self.errors()))))))

    def drop_idle(self) -> None:
        """Undoes what nothing resists."""
        return None


class Metric:
    """Directions that the holds fix and leave, in coordinates where the mass matrix is 1.

    With M = L L^T, y = L^T dx and J L^-T = U S V^T, the columns of V beyond the rank are free.
    Redundant holds (a straight hose held at both ends, a planar one out of its plane) lower the
    rank; spins that nothing resists count as held.

    Attributes:
        multipliers: the lambda that come closest to equilibrium.
    """

    def __init__(self, system: StaticSystem) -> None:
        self._factor = np.linalg.cholesky(system.mass())
        holds, idle = system.constraints(), system.idle_motions()
        rows = self._lower(np.concatenate([holds, idle]).T).T
        left, singular, right = np.linalg.svd(rows)
        rank = int(np.sum(singular > _RANK * singular.max(initial=0.0)))
        self._singular, self._left = singular[:rank], left[:, :rank]
        self._fixed, self._free = right[:rank].T, right[rank:].T
        bare = self._lower(system.force(np.zeros(len(holds))))
        forces = -self._left @ (self._fixed.T @ bare / self._singular)
        self.multipliers: Array = forces[: len(holds)]

    def newton_step(self, system: StaticSystem, guarded: bool) -> Array:
        """Returns the dx that closes the holds and brings the rest to equilibrium.

        Guarded, negative eigenvalues of the reduced stiffness change their sign, so that an
        unstable equilibrium repels. That takes forces that have an energy.
        """
        stiffness = system.stiffness(self.multipliers)
        if guarded:
            stiffness = (stiffness + stiffness.T) / 2
        stiffness = self._lower(self._lower(stiffness).T).T
        errors = self._left[: len(self.multipliers)].T @ system.errors()
        closing = -self._fixed @ (errors / self._singular)
        force = self._lower(system.force(self.multipliers)) - stiffness @ closing
        force, stiffness = self._free.T @ force, self._free.T @ stiffness @ self._free
        if guarded:
            values, vectors = np.linalg.eigh(stiffness)
            values = np.maximum(np.abs(values), system.softest)
            change = vectors @ (vectors.T @ force / values)
        else:
            change = np.linalg.solve(stiffness + system.softest * np.eye(len(force)), force)
        return np.asarray(np.linalg.solve(self._factor.T, closing + self._free @ change))

    def is_stable(self, system: StaticSystem) -> bool:
        """No direction that the holds leave has a clearly negative stiffness."""
        stiffness = self._lower(self._lower(system.stiffness(self.multipliers)).T)
        reduced = self._free.T @ stiffness @ self._free
        values = np.linalg.eigvalsh((reduced + reduced.T) / 2)
        return bool(values.min(initial=0.0) > -1e3 * system.softest)

    def _lower(self, right: Array) -> Array:
        """L^-1 times a vector or matrix."""
        return np.asarray(np.linalg.solve(self._factor, right))


def solve_equilibrium(system: StaticSystem) -> Array:
    """Brings the system to a static equilibrium near its state; returns lambda.

    Plain Newton steps first. Where they fail or end in an unstable equilibrium, guarded ones follow
    from the start; not with moments, which have no energy when they keep their direction in space.
    The cable's own forces have none either where GJ differs from EI: last come more plain steps.

    Raises:
        StepError: it did not come to rest.
    """
    start = system.pose
    attempts = [(False, _PLAIN), (True, _GUARDED), (False, _GUARDED)]
    for guarded, iterations in attempts if system.conservative else attempts[2:]:
        system.set_pose(start)
        multipliers = _iterate(system, guarded, iterations)
        if multipliers is None:
            continue
        if iterations == _GUARDED or Metric(system).is_stable(system):
            return multipliers
    raise StepError(
        "no static equilibrium was found: a residual of "
        f"{system.residual(Metric(system).multipliers):.1e} of the largest moments is left "
        f"(wanted {_TOLERANCE:.0e}) after {_GUARDED} Newton steps; start from a shape closer to "
        "it, or apply the loads in steps"
    )


def _iterate(system: StaticSystem, guarded: bool, iterations: int) -> Array | None:
    """Newton's method, capped by the rotation of the segments; None where it does not converge.

    The cap shrinks while the residual grows.
    """
    cap, last = _MOST_TURN, np.inf
    for _ in range(iterations):
        system.drop_idle()
        metric = Metric(system)
        residual = system.residual(metric.multipliers)
        if residual < _TOLERANCE:
            return metric.multipliers
        cap = min(2 * cap, _MOST_TURN) if residual < last else max(cap / 2, _LEAST_TURN)
        last = residual
        change = metric.newton_step(system, guarded)
        system.advance(min(1.0, cap / max(system.largest_turn(change), 1e-300)) * change)
    return None


def linearize(system: StaticSystem) -> Linearization:
    """Mass, tangent stiffness and constraints at the system's state.

    The stiffness includes the change of the hold forces' directions, at the forces that come
    closest to equilibrium, and is symmetrised (exact at an equilibrium).
    """
    stiffness = system.stiffness(Metric(system).multipliers, central=True)
    return Linearization(system.mass(), (stiffness + stiffness.T) / 2, system.constraints())
