"""Static equilibrium and small motions of a hose inside an mjModel; the equations of a chain.

With the force f(x) of springs, gravity and loads at zero velocity, the errors c(x) of holds and
rigid parts, their Jacobian J and their forces lambda, equilibrium is f + J^T lambda = 0 and c = 0.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from hose_mj.errors import StepError
from hose_mj.hoses.mujoco import chain_layout
from hose_mj.hoses.mujoco.chain_holds import Held, Load
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
        """No motion that the holds leave has a clearly negative stiffness.

        By the eigenvalues themselves: where forces have no energy (the cable's with GJ unlike EI)
        those of the symmetric part are negative in a hanging chain.
        """
        stiffness = self._lower(self._lower(system.stiffness(self.multipliers)).T)
        reduced = self._free.T @ stiffness @ self._free
        values = np.linalg.eigvals(reduced).real
        return bool(values.min(initial=0.0) > -1e3 * system.softest)

    def _lower(self, right: Array) -> Array:
        """L^-1 times a vector or matrix."""
        return np.asarray(np.linalg.solve(self._factor, right))


def solve_equilibrium(system: StaticSystem) -> tuple[Array, bool]:
    """Brings the system to an equilibrium near its state; returns lambda and if it is stable.

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
        is_stable = Metric(system).is_stable(system)
        if iterations == _GUARDED or is_stable:
            return multipliers, is_stable
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


# A chain: the unknowns x are the change of the first node and the rotation vectors of the segments
# in the world frame; relative rotations would do for planar chains, but in space they make a hose
# with little torsional stiffness look unstable wherever it is out of equilibrium.


@dataclass(frozen=True)
class BodyPoint:
    """A point of a segment: body id and coordinates in its frame (3,), m."""

    body: int
    local: Array


@dataclass(frozen=True)
class StaticChain:
    """A compiled chain: its joints, model, body ids, whether its first segment is fixed, nodes."""

    kind: chain_layout.ChainKind
    model: mujoco.MjModel
    bodies: np.ndarray
    rooted: bool
    layout: chain_layout.ChainLayout


class ChainSystem(StaticSystem):
    """The functions f, c and J on a scratch mjData of its own.

    The chain starts at `start` (3,), m, with the frames (N, 4) of its segments. Holds are exact
    here; each, and each load, comes with its point. `scale` is the sum of the moments that weight,
    loads and stiffness can make (N m).
    """

    def __init__(
        self,
        chain: StaticChain,
        start: Array,
        frames: Array,
        holds: list[tuple[BodyPoint, Held]],
        loads: list[tuple[BodyPoint, Load]],
    ) -> None:
        self.chain, self.holds, self.loads = chain, holds, loads
        self.model, self.data = chain.model, mujoco.MjData(chain.model)
        self._freedoms = chain.kind.freedoms(chain.layout.segments, chain.rooted)
        self.n_unknowns = len(self._freedoms)
        length, mass = chain.layout.length, float(self.model.body_mass.sum())
        pull = mass * float(np.linalg.norm(self.model.opt.gravity))
        pull += sum(float(np.linalg.norm(load.force)) for _, load in loads)
        bend = sum(float(np.linalg.norm(load.moment)) for _, load in loads)
        self.scale = pull * length + bend + chain.kind.stiffness[1] / length
        self.softest = 1e-6 * self.scale / (mass * length**2)
        self.conservative = not any(np.any(load.moment) for _, load in loads)
        self.set_pose((start, frames))

    def set_pose(self, pose: tuple[Array, Array]) -> None:
        """Moves the first node and the frames there and updates the kinematics."""
        self.pose = pose
        self.data.qpos[:] = self.chain.kind.to_qpos(*pose, self.chain.rooted)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def advance(self, change: Array) -> None:
        """Moves by a change of the unknowns (n,)."""
        full = change @ self._freedoms
        turns = chain_layout.exponential(full[3:].reshape(-1, 3))
        self.set_pose((self.pose[0] + full[:3], chain_layout.multiply(turns, self.pose[1])))

    def drop_idle(self) -> None:
        """Undoes the twist of the joints of a hose without GJ, but next to clamps."""
        if self.chain.kind.stiffness[0] != 0.0:
            return
        start, frames = self.pose[0], self.pose[1].copy()
        held = {point.body for point, item in self.holds if item.hold.fixes_tangent}
        for k in range(1, len(frames)):
            if self.chain.bodies[k] not in held:
                frames[k] = chain_layout.turn_frame(
                    frames[k - 1], chain_layout.rotation_matrix(frames[k])[:, 0]
                )
        self.set_pose((start, frames))

    def force(self, multipliers: Array) -> Array:
        """F + J^T lambda here (n,)."""
        model, data = self.model, self.data
        bias, total = np.zeros(model.nv), np.zeros(model.nv)
        mujoco.mj_passive(model, data)
        mujoco.mj_rne(model, data, 0, bias)
        total += data.qfrc_passive - bias
        for point, load in self.loads:
            self._add_wrench(point, load.force, load.moment, total)
        row = 0
        for point, item in self.holds:
            clamped = item.hold.fixes_tangent
            moment = multipliers[row + 3 : row + 6] if clamped else np.zeros(3)
            self._add_wrench(point, multipliers[row : row + 3], moment, total)
            row += 6 if clamped else 3
        return self._spread(total)

    def errors(self) -> Array:
        """The hold errors c here (c,): metres and, for clamps, radians, in the world frame."""
        parts = [np.zeros(0)]
        for point, item in self.holds:
            parts.append(self._world(point) - item.position)
            if item.hold.fixes_tangent:
                now = self.data.xquat[point.body]
                parts.append(
                    chain_layout.rotation_vector(
                        chain_layout.multiply(now, chain_layout.conjugate(item.frame))
                    )
                )
        return np.concatenate(parts)

    def constraints(self) -> Array:
        """Their Jacobian J here (c, n)."""
        rows = [np.zeros((0, self.n_unknowns))]
        for point, item in self.holds:
            linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
            place = self._world(point)
            mujoco.mj_jac(self.model, self.data, linear, angular, place, point.body)
            rows.extend(self._spread(row)[None] for row in linear)
            if item.hold.fixes_tangent:
                rows.extend(self._spread(row)[None] for row in angular)
        return np.concatenate(rows)

    def idle_motions(self) -> Array:
        """Rows (k, n) of the spins about tangents that nothing resists in a hose without GJ."""
        tangents = self.data.xmat[self.chain.bodies].reshape(-1, 3, 3)[:, :, 0]
        held = {point.body for point, item in self.holds if item.hold.fixes_tangent}
        rows = np.zeros((len(tangents), self._freedoms.shape[1]))
        for k, body in enumerate(self.chain.bodies):
            if self.chain.kind.stiffness[0] == 0.0 and body not in held:
                rows[k, 3 + 3 * k : 6 + 3 * k] = tangents[k]
        rows = rows @ self._freedoms.T
        return np.asarray(rows[np.abs(rows).max(axis=1) > 1e-9])

    def mass(self) -> Array:
        """Mass matrix here (n, n)."""
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_makeM(self.model, self.data)
        mujoco.mj_fullM(self.model, self.data, full)
        to_qvel = np.stack([self._spread(unit) for unit in np.eye(self.model.nv)])
        return np.asarray(to_qvel.T @ full @ to_qvel)

    def stiffness(self, multipliers: Array, *, central: bool = False, width: float = 1e-6) -> Array:
        """-d(f + J^T lambda)/dx at fixed lambda by finite differences (n, n)."""
        here, start = self.pose, self.force(multipliers)
        columns = []
        for change in width * np.eye(self.n_unknowns):
            self.advance(change)
            ahead = self.force(multipliers)
            behind, span = start, width
            if central:
                self.set_pose(here)
                self.advance(-change)
                behind, span = self.force(multipliers), 2 * width
            columns.append((behind - ahead) / span)
            self.set_pose(here)
        return np.stack(columns, axis=1)

    def largest_turn(self, change: Array) -> float:
        """Largest rotation of any segment in a change of the unknowns (rad)."""
        turns = (change @ self._freedoms)[3:].reshape(-1, 3)
        return float(np.linalg.norm(turns, axis=1).max())

    def residual(self, multipliers: Array) -> float:
        """Largest dimensionless residual of both equations."""
        force = np.abs(self.force(multipliers)).max(initial=0.0) / self.scale
        errors = np.abs(self.errors()).max(initial=0.0) / min(self.chain.layout.length, 1.0)
        return float(max(force, errors))

    def _spread(self, generalized: Array) -> Array:
        axes = self.data.xmat[self.chain.bodies].reshape(-1, 3, 3)
        full = self.chain.kind.spread(generalized, axes, self.chain.rooted)
        return np.asarray(self._freedoms @ full)

    def _world(self, point: BodyPoint) -> Array:
        axes = self.data.xmat[point.body].reshape(3, 3)
        return np.asarray(self.data.xpos[point.body] + axes @ point.local)

    def _add_wrench(self, point: BodyPoint, force: Array, moment: Array, total: Array) -> None:
        where = self._world(point)
        mujoco.mj_applyFT(self.model, self.data, force, moment, where, point.body, total)
