"""A planar chain of rigid segments with hinges and joint springs: validation only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError, check_choice
from hose_mj.hoses.mujoco import chain_layout
from hose_mj.hoses.mujoco.chain import MujocoChainHose
from hose_mj.hoses.mujoco.chain_settings import ChainSettings
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec

_HALF = 0.5**0.5
PLANE_FRAMES = {
    "xy": np.array([1.0, 0.0, 0.0, 0.0]),
    "xz": np.array([_HALF, _HALF, 0.0, 0.0]),
    "yz": np.array([0.5, 0.5, 0.5, 0.5]),
}
"""Frames whose first two axes span the plane."""


class HingeChainHose(MujocoChainHose):
    """Rigid segments, hinges and joint springs EI / h: the form most favourable to MuJoCo.

    For validation only: it moves in one plane (xy, xz or yz) through the world's origin, without
    contacts. Its springs are MuJoCo's own, so the integrator "discrete" takes them implicitly.
    Kelvin-Voigt damping is joint damping tau EI / h. Not mapped: stretching (inextensible), twist,
    drag, rest_strain and rest_curvature (the last three are errors unless 0). Forces and holds act
    in the plane only. All other arguments are those of `CableHose`.
    """

    def __init__(
        self,
        spec: HoseSpec,
        *,
        timestep: float,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        segments: int = 40,
        plane: str = "xz",
        integrator: str = "implicitfast",
        clamp_correction: bool = False,
        iterations: int = 100,
        tolerance: float = 1e-8,
        jacobian: str = "dense",
        hold_solref: Sequence[float] | None = None,
        hold_solimp: Sequence[float] = (0.9999, 0.9999, 0.001, 0.5, 2.0),
    ) -> None:
        check_choice("plane", plane, tuple(PLANE_FRAMES))
        settings = ChainSettings(
            timestep=timestep,
            gravity=gravity,
            segments=segments,
            integrator=integrator,
            clamp_correction=clamp_correction,
            iterations=iterations,
            tolerance=tolerance,
            jacobian=jacobian,
            hold_solref=hold_solref,
            hold_solimp=hold_solimp,
        )
        super().__init__(spec, HingeJoints(spec, plane), settings)


class HingeJoints(chain_layout.ChainKind):
    """Hinges normal to a plane, a key of `PLANE_FRAMES`."""

    def __init__(self, spec: HoseSpec, plane: str) -> None:
        self.spec, self.plane = spec, plane
        self.base_frame = PLANE_FRAMES[plane]
        self.stiffness = (0.0, spec.bending_stiffness)
        self.twists = False
        self._axes = chain_layout.rotation_matrix(self.base_frame)

    def make_chain(
        self, layout: chain_layout.ChainLayout, root: tuple[Array, Array] | None
    ) -> tuple[mujoco.MjSpec, list[Any]]:
        """Bodies B_0, B_1, ...; without a root two slides and a hinge carry the first."""
        h, maker = layout.segment_length, mujoco.MjSpec()
        pos, quat = ([0.0, 0.0, 0.0], self.base_frame) if root is None else root
        bodies = [maker.worldbody.add_body(name="B_0", pos=pos, quat=quat)]
        if root is None:
            for axis in ([1, 0, 0], [0, 1, 0]):
                bodies[0].add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
            bodies[0].add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
        for k in range(1, layout.segments):
            bodies.append(bodies[-1].add_body(name=f"B_{k}", pos=[h, 0, 0]))
            joint = bodies[-1].add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
            joint.stiffness[0] = self.stiffness[1] / h
            joint.damping[0] = self.spec.damping_time * self.stiffness[1] / h
        for body in bodies:
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=[0, 0, 0, h, 0, 0],
                size=[self.spec.outer_radius, 0, 0],
                contype=0,
                conaffinity=0,
            )
        return maker, bodies

    def to_qpos(self, start: Array, frames: Array, rooted: bool) -> Array:
        """Two slides and an angle unless rooted, then one angle per hinge."""
        angles = chain_layout.rotation_vector(
            chain_layout.multiply(chain_layout.conjugate(frames[:-1]), frames[1:])
        )[:, 2]
        if rooted:
            return angles
        first = chain_layout.rotation_vector(
            chain_layout.multiply(chain_layout.conjugate(self.base_frame), frames[0])
        )[2]
        return np.concatenate([(self._axes.T @ start)[:2], [first], angles])

    def to_qvel(self, velocity: Array, spins: Array, frames: Array, rooted: bool) -> Array:
        """The same for velocities."""
        turning = spins @ self._axes[:, 2]
        angles = np.diff(turning)
        if rooted:
            return angles
        return np.concatenate([(self._axes.T @ velocity)[:2], turning[:1], angles])

    def spread(self, force: Array, axes: Array, rooted: bool) -> Array:
        """Joint moments act on a segment and against the one before it."""
        first = np.zeros(3) if rooted else force[:3]
        moments = np.concatenate([first[2:], force if rooted else force[3:]])
        moments[:-1] -= moments[1:]
        turning = np.outer(moments, self._axes[:, 2])
        return np.concatenate([self._axes[:, :2] @ first[:2], turning.ravel()])

    def freedoms(self, segments: int, rooted: bool) -> Array:
        """Two velocities, and one spin per segment."""
        rows = np.zeros((2 + segments, 3 + 3 * segments))
        rows[:2, :3] = self._axes[:, :2].T
        for k in range(segments):
            rows[2 + k, 3 + 3 * k : 6 + 3 * k] = self._axes[:, 2]
        return rows[3 if rooted else 0 :]

    def check_points(self, name: str, points: Array) -> None:
        """Raises `InputError` for a point off the plane."""
        off = points @ self._axes[:, 2]
        if np.any(np.abs(off) > 1e-9 * self.spec.length):
            worst = points[int(np.argmax(np.abs(off)))].tolist()
            raise InputError(name, worst, f"points in the plane {self.plane} through the origin")

    def check_tangent(self, tangent: Array) -> None:
        """Raises `InputError` for a tangent out of the plane."""
        if abs(tangent @ self._axes[:, 2]) > 1e-9:
            raise InputError("tangent", tangent.tolist(), f"a direction in the plane {self.plane}")
