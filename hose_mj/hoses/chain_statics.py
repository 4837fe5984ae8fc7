"""Static equilibrium and small motions of a chain inside an mjModel.

Unknowns are changes dq of the joint coordinates in MuJoCo's tangent space. With the generalised
force g(q) of springs, gravity and loads at zero velocity, the hold errors c(q), their Jacobian J
and the forces lambda of the holds, equilibrium is g + J^T lambda = 0 and c = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.errors import StepError
from hose_mj.hoses.chain_layout import conjugate, multiply, rotation_vector
from hose_mj.hoses.model import Array, Linearization

_MAX_TURN = 0.5  # rad a segment may turn in one iteration
_NEWTON_ITERATIONS = 60
_DAMPED_ITERATIONS = 400
_TOLERANCE = 1e-9  # of the residual against the largest moments around, and of c against L


@dataclass(frozen=True)
class BodyPoint:
    """A point of a segment: body id and coordinates in its frame (3,), m."""

    body: int
    local: Array


@dataclass(frozen=True)
class StaticHold:
    """A point held at a position (3,), m, and for a clamp a frame (4,)."""

    point: BodyPoint
    position: Array
    frame: Array | None


@dataclass(frozen=True)
class StaticLoad:
    """A fixed force (3,) N and moment (3,) N m at a point of a segment."""

    point: BodyPoint
    force: Array
    moment: Array


class StaticSystem:
    """The functions g, c and J on a scratch mjData of its own.

    Args:
        model: the hose.
        qpos: where it starts.
        holds: equality constraints, as exact ones.
        loads: point loads.
        scale: moment that makes residuals dimensionless (N m).
        length: of the hose (m).
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        qpos: Array,
        holds: list[StaticHold],
        loads: list[StaticLoad],
        scale: float,
        length: float,
    ) -> None:
        self.model, self.holds, self.loads = model, holds, loads
        self.scale, self.length = scale, length
        self.data = mujoco.MjData(model)
        self.data.qpos[:] = qpos
        mujoco.mj_forward(model, self.data)

    @property
    def qpos(self) -> Array:
        """Present joint coordinates, a copy."""
        return np.array(self.data.qpos)

    def set_qpos(self, qpos: Array) -> None:
        """Moves there and updates the kinematics."""
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def advance(self, change: Array) -> None:
        """Moves by a change of the joint coordinates (nv,)."""
        qpos = self.qpos
        mujoco.mj_integratePos(self.model, qpos, change, 1.0)
        self.set_qpos(qpos)

    def force(self, multipliers: Array) -> Array:
        """g + J^T lambda here (nv,)."""
        model, data = self.model, self.data
        bias, total = np.zeros(model.nv), np.zeros(model.nv)
        mujoco.mj_passive(model, data)
        mujoco.mj_rne(model, data, 0, bias)
        total += data.qfrc_passive - bias
        for load in self.loads:
            self._add_wrench(load.point, load.force, load.moment, total)
        row = 0
        for hold in self.holds:
            moment = np.zeros(3) if hold.frame is None else multipliers[row + 3 : row + 6]
            self._add_wrench(hold.point, multipliers[row : row + 3], moment, total)
            row += 3 if hold.frame is None else 6
        return total

    def errors(self) -> Array:
        """c here (c,): metres and, for clamps, radians, in the world frame."""
        parts = [np.zeros(0)]
        for hold in self.holds:
            parts.append(self._world(hold.point) - hold.position)
            if hold.frame is not None:
                now = self.data.xquat[hold.point.body]
                parts.append(rotation_vector(multiply(now, conjugate(hold.frame))))
        return np.concatenate(parts)

    def constraints(self) -> Array:
        """J here (c, nv)."""
        rows = [np.zeros((0, self.model.nv))]
        for hold in self.holds:
            linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
            point = self._world(hold.point)
            mujoco.mj_jac(self.model, self.data, linear, angular, point, hold.point.body)
            rows.append(linear)
            if hold.frame is not None:
                rows.append(angular)
        return np.concatenate(rows)

    def mass(self) -> Array:
        """Mass matrix here (nv, nv)."""
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_makeM(self.model, self.data)
        mujoco.mj_fullM(self.model, self.data, full)
        return full

    def stiffness(self, multipliers: Array, *, central: bool = False, width: float = 1e-6) -> Array:
        """-d(g + J^T lambda)/dq at fixed lambda by finite differences (nv, nv)."""
        here, start = self.qpos, self.force(multipliers)
        columns = []
        for k in range(self.model.nv):
            change = np.zeros(self.model.nv)
            change[k] = width
            self.advance(change)
            ahead = self.force(multipliers)
            behind, span = start, width
            if central:
                self.set_qpos(here)
                self.advance(-change)
                behind, span = self.force(multipliers), 2 * width
            columns.append((behind - ahead) / span)
            self.set_qpos(here)
        return np.stack(columns, axis=1)

    def largest_turn(self, change: Array) -> float:
        """Largest rotation of any segment in a change of the coordinates (rad)."""
        self.data.qvel[:] = change
        mujoco.mj_comVel(self.model, self.data)
        largest = float(np.linalg.norm(self.data.cvel[:, :3], axis=1).max())
        self.data.qvel[:] = 0.0
        mujoco.mj_comVel(self.model, self.data)
        return largest

    def estimate_multipliers(self) -> Array:
        """The lambda that come closest to equilibrium here, measured in the mass metric."""
        rows = self.constraints()
        free = self.force(np.zeros(len(rows)))
        weighted = np.linalg.solve(self.mass(), np.column_stack([rows.T, free]))
        return np.asarray(-np.linalg.lstsq(rows @ weighted[:, :-1], rows @ weighted[:, -1])[0])

    def residual(self, multipliers: Array) -> float:
        """Largest dimensionless residual of both equations."""
        force = np.abs(self.force(multipliers)).max(initial=0.0) / self.scale
        errors = np.abs(self.errors()).max(initial=0.0) / min(self.length, 1.0)
        return float(max(force, errors))

    def _world(self, point: BodyPoint) -> Array:
        axes = self.data.xmat[point.body].reshape(3, 3)
        return np.asarray(self.data.xpos[point.body] + axes @ point.local)

    def _add_wrench(self, point: BodyPoint, force: Array, moment: Array, total: Array) -> None:
        where = self._world(point)
        mujoco.mj_applyFT(self.model, self.data, force, moment, where, point.body, total)


def solve_equilibrium(system: StaticSystem) -> Array:
    """Returns the qpos of a static equilibrium near the system's state.

    Full Newton steps, capped by the rotation of the segments; where they fail, again from the start
    with a mass-proportional damping that fades with the residual.

    Raises:
        StepError: neither came to rest.
    """
    start = system.qpos
    for damping, iterations in ((0.0, _NEWTON_ITERATIONS), (1.0, _DAMPED_ITERATIONS)):
        system.set_qpos(start)
        residual = _iterate(system, damping, iterations)
        if residual < _TOLERANCE:
            return system.qpos
    raise StepError(
        f"no static equilibrium was found: the residual is {residual:.1e} of the largest moments "
        f"(wanted {_TOLERANCE:.0e}) after {_DAMPED_ITERATIONS} damped Newton steps; start from a "
        "shape closer to it, or apply the loads in steps"
    )


def _iterate(system: StaticSystem, damping: float, iterations: int) -> float:
    """Newton's method from the system's state; returns the last residual."""
    multipliers = system.estimate_multipliers()
    first = residual = system.residual(multipliers)
    for _ in range(iterations):
        if residual < _TOLERANCE or not np.isfinite(residual):
            break
        stiffness = system.stiffness(multipliers)
        if damping:
            mass = system.mass()
            shift = damping * np.abs(np.diag(stiffness)).max() / np.diag(mass).max()
            stiffness = stiffness + shift * min(residual / first, 1.0) * mass
        change, target = _newton_step(system, stiffness, multipliers)
        part = min(1.0, _MAX_TURN / max(system.largest_turn(change), 1e-300))
        system.advance(part * change)
        multipliers = multipliers + part * (target - multipliers)
        residual = system.residual(multipliers)
    return residual


def _newton_step(
    system: StaticSystem, stiffness: Array, multipliers: Array
) -> tuple[Array, Array]:
    """Solves K dq - J^T lambda = g, J dq = -c for dq and the new lambda.

    Coordinates without stiffness (the twist of a hose without GJ) and redundant holds get a tiny
    one each, which slows the last digits and changes no solution.
    """
    rows = system.constraints()
    nv, n_rows = system.model.nv, len(rows)
    matrix = np.zeros((nv + n_rows, nv + n_rows))
    matrix[:nv, :nv] = stiffness + 1e-10 * system.scale * np.eye(nv)
    matrix[:nv, nv:] = -rows.T
    matrix[nv:, :nv] = rows
    matrix[nv:, nv:] = 1e-10 * system.length**2 / system.scale * np.eye(n_rows)
    free = system.force(np.zeros(n_rows))
    right = np.concatenate([free, -system.errors() + np.diag(matrix)[nv:] * multipliers])
    solution = np.linalg.solve(matrix, right)
    return solution[:nv], solution[nv:]


def linearize(system: StaticSystem) -> Linearization:
    """Mass, tangent stiffness and constraints at the system's state.

    The stiffness includes the change of the hold forces' directions, at the forces that come
    closest to equilibrium, and is symmetrised (exact at an equilibrium).
    """
    multipliers = system.estimate_multipliers()
    stiffness = system.stiffness(multipliers, central=True)
    return Linearization(system.mass(), (stiffness + stiffness.T) / 2, system.constraints())
