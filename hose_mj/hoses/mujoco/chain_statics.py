"""The equations of static equilibrium of a chain inside an mjModel.

Unknowns x are the change of the first node and the rotation vectors of the segments in the world
frame; relative rotations would do for planar chains, but in space they make a hose with little
torsional stiffness look unstable wherever it is out of equilibrium. The constraints are the holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.hoses.mujoco.chain_holds import Held, Load
from hose_mj.hoses.mujoco.chain_layout import (
    ChainKind,
    ChainLayout,
    conjugate,
    exponential,
    multiply,
    rotation_matrix,
    rotation_vector,
    turn_frame,
)
from hose_mj.hoses.mujoco.statics import StaticSystem
from hose_mj.hoses.protocol import Array


@dataclass(frozen=True)
class BodyPoint:
    """A point of a segment: body id and coordinates in its frame (3,), m."""

    body: int
    local: Array


@dataclass(frozen=True)
class StaticChain:
    """A compiled chain: its joints, model, body ids, whether its first segment is fixed, nodes."""

    kind: ChainKind
    model: mujoco.MjModel
    bodies: np.ndarray
    rooted: bool
    layout: ChainLayout


class ChainSystem(StaticSystem):
    """The functions f, c and J on a scratch mjData of its own.

    Args:
        chain: the hose.
        start: its first node (3,), m.
        frames: of its segments (N, 4).
        holds: equality constraints, as exact ones, each with the point that is held.
        loads: point loads, each with its point.

    Attributes:
        scale: sum of the moments that weight, loads and stiffness can make (N m).
        conservative: no load is a moment; one that keeps its direction in space has no energy.
        softest: the least stiffness over mass that a Newton step believes (1/s^2); a coordinate
            without stiffness, such as the twist of a hose without GJ, stays where it is.
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
        turns = exponential(full[3:].reshape(-1, 3))
        self.set_pose((self.pose[0] + full[:3], multiply(turns, self.pose[1])))

    def drop_idle(self) -> None:
        """Undoes the twist of the joints of a hose without GJ, but next to clamps."""
        if self.chain.kind.stiffness[0] != 0.0:
            return
        start, frames = self.pose[0], self.pose[1].copy()
        held = {point.body for point, item in self.holds if item.hold.fixes_tangent}
        for k in range(1, len(frames)):
            if self.chain.bodies[k] not in held:
                frames[k] = turn_frame(frames[k - 1], rotation_matrix(frames[k])[:, 0])
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
                parts.append(rotation_vector(multiply(now, conjugate(item.frame))))
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
