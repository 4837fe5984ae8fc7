"""A chain of rigid segments: where its nodes lie along the hose, how it lies and moves.

A frame is a unit quaternion (w, x, y, z) whose first axis is the tangent of its segment.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from hose_mj.hoses.protocol import Array, Energies, Momentum


@dataclass(frozen=True)
class ChainLayout:
    """N segments of equal length h joined at N - 1 elastic joints.

    An elastic joint stands for the h of hose around it. A clamp fixes a whole segment, so the hose
    would be held half a segment too late; at a corrected end the segment is centred on the end of
    the hose instead, half of it beyond, and h = L / (N - corrected ends / 2).

    Attributes:
        length: of the hose, L (m).
        segments: N.
        first_corrected: the segment at s = 0 is centred on s = 0.
        last_corrected: the segment at s = L is centred on s = L.
    """

    length: float
    segments: int
    first_corrected: bool = False
    last_corrected: bool = False

    @cached_property
    def segment_length(self) -> float:
        """h (m)."""
        return self.length / (self.segments - 0.5 * (self.first_corrected + self.last_corrected))

    @cached_property
    def nodes(self) -> Array:
        """Arc lengths of the nodes, shape (N + 1,), the first below 0 where corrected (m)."""
        steps = np.arange(self.segments + 1, dtype=np.float64) - 0.5 * self.first_corrected
        return np.asarray(steps * self.segment_length)

    @cached_property
    def covered(self) -> Array:
        """The part of each segment that is hose, measured from its first node, shape (N, 2), m."""
        ends = np.stack([self.nodes[:-1], self.nodes[1:]], axis=1)
        return np.asarray(np.clip(ends, 0.0, self.length) - ends[:, :1])

    def locate(self, arc_lengths: Array) -> tuple[np.ndarray, Array]:
        """Returns the segment of each arc length and the distance from its first node (m)."""
        index = np.floor((arc_lengths - self.nodes[0]) / self.segment_length).astype(np.int64)
        index = np.clip(index, 0, self.segments - 1)
        return index, arc_lengths - self.nodes[index]

    def interpolate(self, arc_lengths: Array, at_joints: Array) -> Array:
        """Returns values between the N - 1 joints by straight lines, continued to both ends."""
        if self.segments == 2:
            return np.full(len(arc_lengths), at_joints[0])
        first = 2 * at_joints[0] - at_joints[1]
        last = 2 * at_joints[-1] - at_joints[-2]
        values = np.concatenate([[first], at_joints, [last]])
        return np.asarray(np.interp(arc_lengths, self.nodes, values))


def multiply(left: Array, right: Array) -> Array:
    """Product of quaternions, shapes (..., 4): `right` is turned by `left`."""
    w, x, y, z = np.moveaxis(left, -1, 0)
    a, b, c, d = np.moveaxis(right, -1, 0)
    return np.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ],
        axis=-1,
    )


def conjugate(quaternion: Array) -> Array:
    """Inverse of unit quaternions, shape (..., 4)."""
    return np.asarray(quaternion * np.array([1.0, -1.0, -1.0, -1.0]))


def rotation_vector(quaternion: Array) -> Array:
    """Axis times angle in [0, pi] of unit quaternions (..., 4), shape (..., 3), rad."""
    turned = np.where(quaternion[..., :1] < 0, -quaternion, quaternion)
    sine = np.linalg.norm(turned[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, turned[..., :1])
    small = sine < 1e-9
    return np.asarray(turned[..., 1:] * np.where(small, 2.0, angle / np.where(small, 1.0, sine)))


def exponential(vectors: Array) -> Array:
    """Unit quaternions (..., 4) of rotation vectors (..., 3), rad."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) * vectors / 2], axis=-1)


def rotation_matrix(quaternion: Array) -> Array:
    """The three axes of a frame as columns, shape (3, 3)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def turn_frame(frame: Array, tangent: Array) -> Array:
    """Returns a frame turned by the least rotation that points its first axis along a unit tangent.

    A frame that points the other way turns about its own third axis, the normal of a planar hose.
    """
    axes = rotation_matrix(frame)
    cosine = float(axes[:, 0] @ tangent)
    if cosine > 1.0 - 1e-15:
        return frame
    turn = np.concatenate([[1.0 + cosine], np.cross(axes[:, 0], tangent)])
    if 1.0 + cosine < 1e-12:
        turn = np.concatenate([[0.0], axes[:, 2]])
    turned = multiply(turn / np.linalg.norm(turn), frame)
    return np.asarray(turned / np.linalg.norm(turned))


def transport_frames(points: Array, first: Array) -> Array:
    """Returns twist-free frames (N, 4) of the chords between points (N + 1, 3), `first` turned."""
    chords = np.diff(points, axis=0)
    chords /= np.linalg.norm(chords, axis=1, keepdims=True)
    frames = [turn_frame(first, chords[0])]
    for chord in chords[1:]:
        frames.append(turn_frame(frames[-1], chord))
    return np.array(frames)


class ChainKind(ABC):
    """What the joints of a chain are.

    Attributes:
        base_frame: frame (4,) from which the first segment's is turned.
        stiffness: GJ, EI of the joints (N m^2).
        twists: a segment can turn about the tangent against its neighbours.
    """

    base_frame: Array
    stiffness: tuple[float, float]
    twists: bool

    @abstractmethod
    def make_chain(
        self, layout: ChainLayout, root: tuple[Array, Array] | None
    ) -> tuple[mujoco.MjSpec, list[Any]]:
        """Returns a model with N bodies from node to node; `root` is the pose of a fixed first."""

    @abstractmethod
    def to_qpos(self, start: Array, frames: Array, rooted: bool) -> Array:
        """Joint coordinates of a chain that starts at a point with these frames (N, 4)."""

    @abstractmethod
    def to_qvel(self, velocity: Array, spins: Array, frames: Array, rooted: bool) -> Array:
        """Joint velocities from the start's velocity and the spins (N, 3) in the world frame."""

    @abstractmethod
    def spread(self, force: Array, axes: Array, rooted: bool) -> Array:
        """The dual of `to_qvel`: generalised forces (nv,) on velocity and spins, (3 + 3 N,)."""

    @abstractmethod
    def freedoms(self, segments: int, rooted: bool) -> Array:
        """Orthonormal rows (n, 3 + 3 N): the velocities and spins that this chain can have."""

    def check_points(self, name: str, points: Array) -> None:  # noqa: B027
        """Raises `InputError` for points (k, 3), m, where this chain cannot be; by default none."""

    def check_tangent(self, tangent: Array) -> None:  # noqa: B027
        """Raises `InputError` for a unit tangent that this chain cannot have; by default none."""


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
