"""How a chain of rigid segments lies and moves at one moment: centre line, energies, momentum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.hoses.mujoco.chain_layout import ChainLayout, conjugate, multiply, rotation_vector
from hose_mj.hoses.protocol import Array, Energies, Momentum


@dataclass(frozen=True)
class ChainMass:
    """Masses (N,), centres (N, 3) and principal inertias (N, 3) in the frames of the segments.

    Only the part of a segment that is hose weighs. A part of length a has the inertia of a thin
    rod, m a^2 / 12, across, and that of a solid cylinder, m r^2 / 2, about its axis; across never
    less than half of that, or no body could have it. The section's own rotary inertia is left out.
    """

    mass: Array
    centre: Array
    inertia: Array

    @classmethod
    def of_hose(cls, layout: ChainLayout, linear_density: float, radius: float) -> ChainMass:
        """Masses of the segments of a hose."""
        begin, end = layout.covered.T
        mass = linear_density * (end - begin)
        centre = np.zeros((layout.segments, 3))
        centre[:, 0] = (begin + end) / 2
        about = mass * radius**2 / 2
        across = np.maximum(mass * (end - begin) ** 2 / 12, about / 2 * (1 + 1e-9))
        return cls(mass, centre, np.stack([about, across, across], axis=1))

    def write(self, bodies: Sequence[mujoco.MjsBody]) -> None:
        """Gives the bodies of a model that is being made these masses."""
        for k, body in enumerate(bodies):
            body.explicitinertial = True
            body.mass, body.inertia = max(self.mass[k], 1e-300), self.inertia[k]
            body.ipos, body.iquat = self.centre[k], [1.0, 0.0, 0.0, 0.0]


@dataclass(frozen=True)
class ChainMotion:
    """Copies of MuJoCo's arrays for the N segments.

    Attributes:
        layout: arc lengths of the nodes.
        starts: first node of each segment, (N, 3), m.
        axes: rotation matrices of the segments, (N, 3, 3).
        frames: the same as quaternions, (N, 4).
        start_velocities: of the first nodes, (N, 3), m/s.
        spins: angular velocities in the world frame, (N, 3), rad/s.
    """

    layout: ChainLayout
    starts: Array
    axes: Array
    frames: Array
    start_velocities: Array
    spins: Array

    @classmethod
    def read(
        cls, model: mujoco.MjModel, data: mujoco.MjData, layout: ChainLayout, bodies: np.ndarray
    ) -> ChainMotion:
        """Reads qpos and qvel; updates only what every MuJoCo step computes again."""
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        spins = data.cvel[bodies, :3]
        arms = data.xpos[bodies] - data.subtree_com[bodies[0]]
        return cls(
            layout,
            data.xpos[bodies],
            data.xmat[bodies].reshape(-1, 3, 3),
            data.xquat[bodies],
            data.cvel[bodies, 3:] + np.cross(spins, arms),
            spins,
        )

    def position(self, arc_lengths: Array) -> Array:
        """Points of the centre line (k, 3), m; beyond the ends the end segments go on straight."""
        index, along = self.layout.locate(arc_lengths)
        return np.asarray(self.starts[index] + along[:, None] * self.axes[index, :, 0])

    def velocity(self, arc_lengths: Array) -> Array:
        """Velocities of the centre line (k, 3), m/s."""
        index, along = self.layout.locate(arc_lengths)
        arms = along[:, None] * self.axes[index, :, 0]
        return np.asarray(self.start_velocities[index] + np.cross(self.spins[index], arms))

    def tangent(self, arc_lengths: Array) -> Array:
        """Unit tangents (k, 3): a segment's own, at a node the mean of its two neighbours."""
        slack = 1e-9 * self.layout.segment_length
        before, _ = self.layout.locate(arc_lengths - slack)
        after, _ = self.layout.locate(arc_lengths + slack)
        total = self.axes[before, :, 0] + self.axes[after, :, 0]
        return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))

    def joint_rotations(self) -> Array:
        """Rotation vector of each segment against the one before it, in its frame, (N - 1, 3)."""
        return rotation_vector(multiply(conjugate(self.frames[:-1]), self.frames[1:]))

    def curvature(self, arc_lengths: Array) -> Array:
        """Bending angle over segment length (k,), 1/m."""
        angles = np.linalg.norm(self.joint_rotations()[:, 1:], axis=1)
        at_joints = angles / self.layout.segment_length
        return np.maximum(self.layout.interpolate(arc_lengths, at_joints), 0.0)

    def twist(self, arc_lengths: Array) -> Array:
        """Angle about the tangent over segment length (k,), rad/m."""
        turns = self.joint_rotations()[:, 0]
        return self.layout.interpolate(arc_lengths, turns / self.layout.segment_length)

    def joint_tensions(self, data: mujoco.MjData, bodies: np.ndarray) -> Array:
        """Axial force in the joints (N - 1,), N, after MuJoCo's `mj_rnePostConstraint`."""
        tangents = self.tangent(self.layout.nodes[1:-1])
        return np.asarray(-np.einsum("ni,ni->n", data.cfrc_int[bodies[1:], 3:], tangents))

    def frame(self, arc_length: float) -> Array:
        """Frame (4,) of the segment there."""
        (index,), _ = self.layout.locate(np.array([arc_length]))
        return np.asarray(self.frames[index])

    def energies(self, mass: ChainMass, stiffness: tuple[float, float], gravity: Array) -> Energies:
        """Energies (J); `stiffness` is GJ, EI (N m^2)."""
        centres, velocities, spins = self._centre_motion(mass)
        turning = self.joint_rotations() ** 2 / (2 * self.layout.segment_length)
        return Energies(
            kinetic=float(mass.mass @ (velocities**2).sum(axis=1) + (mass.inertia * spins**2).sum())
            / 2,
            stretching=0.0,
            bending=stiffness[1] * float(turning[:, 1:].sum()),
            twisting=stiffness[0] * float(turning[:, 0].sum()),
            gravitational=-float(mass.mass @ centres @ gravity),
        )

    def momentum(self, mass: ChainMass) -> Momentum:
        """Linear and angular momentum about the world's origin."""
        centres, velocities, spins = self._centre_motion(mass)
        linear = mass.mass[:, None] * velocities
        own = np.einsum("nij,nj->ni", self.axes, mass.inertia * spins)
        return Momentum(linear.sum(axis=0), (np.cross(centres, linear) + own).sum(axis=0))

    def _centre_motion(self, mass: ChainMass) -> tuple[Array, Array, Array]:
        """Centres of mass, their velocities, and the spins in the segments' own frames, (N, 3)."""
        arms = np.einsum("nij,nj->ni", self.axes, mass.centre)
        velocities = self.start_velocities + np.cross(self.spins, arms)
        return self.starts + arms, velocities, np.einsum("nij,ni->nj", self.axes, self.spins)
