"""Where the nodes of a chain of rigid segments lie along the hose, and rotations of its frames.

A frame is a unit quaternion (w, x, y, z) whose first axis is the tangent of its segment.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from hose_mj.hoses.protocol import Array


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
