"""MuJoCo's composite cable as a hose, its moduli chosen such that physical EI and GJ come out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.hoses.mujoco import chain_layout
from hose_mj.hoses.mujoco.chain import MujocoChainHose
from hose_mj.hoses.mujoco.chain_settings import ChainSettings, check_obstacles
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec, check_number

_XML = """
<mujoco>
  <extension><plugin plugin="mujoco.elasticity.cable"/></extension>
  <worldbody>
    <composite type="cable" curve="s" count="{nodes} 1 1" size="{size:.17g} 1 1"
               initial="{initial}">
      <plugin plugin="mujoco.elasticity.cable">
        <config key="twist" value="{twist:.17g}"/><config key="bend" value="{bend:.17g}"/>
        <config key="flat" value="true"/><config key="vmax" value="0"/>
      </plugin>
      <joint kind="main" damping="{damping:.17g}" armature="0"/>
      <geom type="capsule" size="{radius:.17g}" contype="0" conaffinity="0"/>
    </composite>
  </worldbody>
</mujoco>
"""


class CableHose(MujocoChainHose):
    """`<composite type="cable">` with the elasticity plugin of MuJoCo 3.17.

    Rigid segments of equal length, ball joints between them, contacts with obstacles alone. The
    plugin multiplies
    `bend` and `twist` (Pa) by the section of a solid cylinder of the geom's radius r: they are set
    to EI / (pi r^4 / 4) and GJ / (pi r^4 / 2). Its forces are explicit with any integrator, so the
    largest stable time step falls with stiffness and number of segments; with few segments the
    twist limits it, because a thin hose has little rotational inertia about its own axis.
    Kelvin-Voigt damping is joint damping tau EI / h, which a ball joint also applies to twist. Not
    mapped: stretching (inextensible), drag, rest_strain and rest_curvature (errors unless 0). A
    clamp also holds the twist, as the material's angle when it is made; `move` may spin it. Each of
    the N - 1 joints keeps less than half a turn: MuJoCo knows its rotation only up to full turns.

    Args:
        spec: what the hose is made of.
        timestep: length of one step (s).
        gravity: (3,) m/s^2.
        segments: number of rigid segments, at least 2.
        integrator: euler, implicit, implicitfast, discrete or rk4.
        clamp_correction: False for MuJoCo's documented clamp, which fixes a whole first segment;
            True centres the segment of a clamped end on that end.
        torsional_stiffness: GJ (N m^2) in place of the spec's, for larger time steps.
        iterations: most iterations of MuJoCo's constraint solver.
        tolerance: its termination tolerance.
        jacobian: dense, sparse or auto; MuJoCo's auto is sparse from 60 coordinates on, which
            makes a hose that is held twice as slow.
        hold_solref: MuJoCo's solref of holds; None for twice the time step, critically damped.
        hold_solimp: their solimp.
        obstacles: static shapes that the segments collide with.

    Raises:
        InputError: a value outside its valid set.
    """

    def __init__(
        self,
        spec: HoseSpec,
        *,
        timestep: float,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        segments: int = 40,
        integrator: str = "implicitfast",
        clamp_correction: bool = False,
        torsional_stiffness: float | None = None,
        iterations: int = 100,
        tolerance: float = 1e-8,
        jacobian: str = "dense",
        hold_solref: Sequence[float] | None = None,
        hold_solimp: Sequence[float] = (0.9999, 0.9999, 0.001, 0.5, 2.0),
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        twist = spec.torsional_stiffness if torsional_stiffness is None else torsional_stiffness
        check_number("torsional_stiffness", twist, may_be_zero=True)
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
            obstacles=check_obstacles(obstacles),
        )
        super().__init__(spec, BallJoints(spec, twist), settings)


class BallJoints(chain_layout.ChainKind):
    """The composite cable's joints; `torsional_stiffness` is GJ (N m^2)."""

    def __init__(self, spec: HoseSpec, torsional_stiffness: float) -> None:
        self.spec = spec
        self.base_frame = np.array([1.0, 0.0, 0.0, 0.0])
        self.stiffness = (torsional_stiffness, spec.bending_stiffness)
        self.twists = True

    def make_chain(
        self, layout: chain_layout.ChainLayout, root: tuple[Array, Array] | None
    ) -> tuple[mujoco.MjSpec, list[Any]]:
        """The composite, with its nodes (single precision in MuJoCo's compiler) set exactly."""
        h, second_moment = layout.segment_length, math.pi * self.spec.outer_radius**4 / 4
        xml = _XML.format(
            nodes=layout.segments + 1,
            size=h * layout.segments,
            initial="free" if root is None else "none",
            twist=self.stiffness[0] / (2 * second_moment),
            bend=self.stiffness[1] / second_moment,
            damping=self.spec.damping_time * self.stiffness[1] / h,
            radius=self.spec.outer_radius,
        )
        maker = mujoco.MjSpec.from_string(xml)
        bodies = [body for body in maker.bodies if body.name.startswith("B_")]
        for body in bodies[1:]:
            body.pos = [h, 0.0, 0.0]
        bodies[0].pos, bodies[0].quat = ([0.0] * 3, self.base_frame) if root is None else root
        return maker, bodies

    def to_qpos(self, start: Array, frames: Array, rooted: bool) -> Array:
        """Free joint unless rooted, then one quaternion per ball joint."""
        relative = chain_layout.multiply(chain_layout.conjugate(frames[:-1]), frames[1:]).ravel()
        return relative if rooted else np.concatenate([start, frames[0], relative])

    def to_qvel(self, velocity: Array, spins: Array, frames: Array, rooted: bool) -> Array:
        """Velocity in the world frame, spins relative to the segment before in the own frame."""
        change = np.concatenate([spins[:1], np.diff(spins, axis=0)])
        own = [
            chain_layout.rotation_matrix(q).T @ spin for q, spin in zip(frames, change, strict=True)
        ]
        return np.concatenate([*own[1:]] if rooted else [velocity, *own])

    def spread(self, force: Array, axes: Array, rooted: bool) -> Array:
        """Joint moments act on a segment and against the one before it."""
        first = np.zeros(6) if rooted else force[:6]
        own = np.concatenate([first[3:], force if rooted else force[6:]]).reshape(-1, 3)
        moments = np.einsum("nij,nj->ni", axes, own)
        moments[:-1] -= moments[1:]
        return np.concatenate([first[:3], moments.ravel()])

    def freedoms(self, segments: int, rooted: bool) -> Array:
        """All, but for a root those of the first segment."""
        return np.eye(3 + 3 * segments)[6 if rooted else 0 :]
