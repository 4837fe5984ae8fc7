"""What a kind of chain has to say about its joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import mujoco

from hose_mj.hoses.mujoco.chain_layout import ChainLayout
from hose_mj.hoses.protocol import Array


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

    @abstractmethod
    def check_points(self, name: str, points: Array) -> None:
        """Raises `InputError` for points (k, 3), m, where this chain cannot be."""

    @abstractmethod
    def check_tangent(self, tangent: Array) -> None:
        """Raises `InputError` for a unit tangent that this chain cannot have."""
