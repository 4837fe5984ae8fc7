"""`CableWorld`: MuJoCo's composite cable among the bodies of a scene."""

import math

import mujoco
import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.mujoco import chain_layout
from hose_mj.hoses.mujoco.cable import BallJoints
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec, check_number
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.world.mujoco_scene import HoseContact, Numerics
from hose_mj.world.mujoco_world import MujocoWorld
from hose_mj.world.world import check_scene

_SAFETY = 0.5  # of MuJoCo's default step over the largest stable one of a free chain
_LONGEST = 5e-4
"""Largest default step of MuJoCo's (s): a taut chain that jerks is stiff, whatever bends it."""

_HIDDEN = 4  # group of geoms that viewers do not draw unless asked


class CableWorld(MujocoWorld):
    """Robots on a chain of rigid segments with ball joints (see `CableHose`).

    The elastic forces are explicit, so that a hose with little damping needs small steps, of the
    order of h^2 in the length h of a segment. A step of the world therefore is several of MuJoCo's,
    each at most 0.5 ms and half as long as a free chain can bear. The integrator is "discrete",
    whatever the scene says: all others leave the joints' implicit damping out of constraint forces,
    and such a hose lets go of its robots. The first segment does not roll about its axis, or
    friction would set the whole hose spinning.

    Args:
        scene: checked.
        timestep: length of one step of the world (s); None for the scene's.
        segments: number of rigid segments, at least 2; no two robots may share one.
        substeps: MuJoCo's steps in one of the world's; None for as many as stability asks for.
        torsional_stiffness: GJ (N m^2) in place of the scene's, for larger steps.

    Raises:
        InputError: a value outside its valid set; a hose with drag, fittings or a rest shape.
    """

    hose_model = "cable"
    _advice = "try more substeps, fewer segments or a lower torsional stiffness"

    def __init__(
        self,
        scene: Scene,
        *,
        timestep: float | None = None,
        segments: int = 40,
        substeps: int | None = None,
        torsional_stiffness: float | None = None,
    ) -> None:
        check_scene(scene)
        spec = scene.spec
        twist = spec.torsional_stiffness if torsional_stiffness is None else torsional_stiffness
        check_number("torsional_stiffness", twist, may_be_zero=True)
        check_count("segments", segments, 2)
        timestep = check_number("timestep", scene.timestep if timestep is None else timestep)
        self._layout = chain_layout.ChainLayout(spec.length, segments)
        self._kind = BallJoints(spec, twist)
        arcs = np.array([*(robot.arc_length for robot in scene.robots), 0.0])
        index, along = self._layout.locate(arcs)
        if len(set(index.tolist())) < len(index):
            valid = "so many that each robot, and the source, holds one of its own"
            raise InputError("segments", segments, valid)
        self._held = list(zip(index.tolist(), along.tolist(), strict=True))
        if substeps is None:
            stable = compute_stable_step(spec, self._layout.segment_length, twist)
            most = min(_LONGEST, _SAFETY * stable)
            substeps = math.ceil(timestep / most * (1.0 - 1e-9))
        nodes = self._layout.nodes.copy()
        nodes[-1] = spec.length
        self._tension_places = nodes[1:-1]
        super().__init__(scene, nodes, Numerics(timestep, substeps, "discrete", "sparse"))

    def _make_hose(
        self, spec: HoseSpec, contact: HoseContact, ties: dict[str, list[float]]
    ) -> mujoco.MjSpec:
        maker, bodies = self._kind.make_chain(self._layout, None)
        h = self._layout.segment_length
        chain_layout.ChainMass.of_hose(self._layout, spec.linear_density, spec.outer_radius).write(
            bodies
        )
        for body, bit in zip(bodies, contact.bits, strict=True):
            for geom in body.geoms:
                contact.write(geom, int(bit))
        for body, along in [*((body, 0.0) for body in bodies), (bodies[-1], h)]:
            ball = body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                pos=[along, 0.0, 0.0],
                size=[spec.outer_radius, 0.0, 0.0],
                group=_HIDDEN,
            )
            contact.write(ball, contact.plane_bit)
        for k, (index, along) in enumerate(self._held):
            bodies[index].add_site(name=f"hold{k}", pos=[along, 0.0, 0.0])
        return maker

    def _finish_model(self, spec: HoseSpec, model: mujoco.MjModel) -> None:
        """Keeps the first segment from rolling about its axis, as a coupling does.

        MuJoCo's solver measures its errors by the model's mean inertia; that stays as it was.
        """
        scale = model.stat.meaninertia
        roll = int(model.body_dofadr[self.hose_bodies[0]]) + 3
        model.dof_armature[roll] = spec.mass * spec.length**2
        mujoco.mj_setConst(model, mujoco.MjData(model))
        model.stat.meaninertia = scale

    def _set_nodes(self, nodes: Array) -> None:
        frames = chain_layout.transport_frames(nodes, self._kind.base_frame)
        first = self.model.jnt_qposadr[self.model.body_jntadr[self.hose_bodies[0]]]
        qpos = self._kind.to_qpos(nodes[0], frames, rooted=False)
        self.data.qpos[first : first + len(qpos)] = qpos

    def _read_motion(self) -> chain_layout.ChainMotion:
        return chain_layout.ChainMotion.read(self.model, self.data, self._layout, self.hose_bodies)

    def _read_tensions(self) -> Array:
        mujoco.mj_rnePostConstraint(self.model, self.data)
        return self._read_motion().joint_tensions(self.data, self.hose_bodies)


def compute_stable_step(spec: HoseSpec, segment_length: float, torsional_stiffness: float) -> float:
    """Largest stable step (s) of a free chain of rigid links with explicit joint stiffness.

    Undamped, 2 / omega for the fastest motion of bending or twist (docs/mujoco_cable.md, "Time
    step"), by h (m), EI and GJ (N m^2). Damping taken implicitly, with a relaxation time T, bears
    dt = T + sqrt(T^2 + (2 / omega)^2): Jury's condition for v' = (v - dt omega^2 x) / (1 + dt
    omega^2 T), x' = x + dt v'. A ball joint has one damping, tau EI / h, so of the twist T is tau
    EI / GJ.
    """
    h, density, stiffness = segment_length, spec.linear_density, spec.bending_stiffness
    bend = h**2 / (2.0 * math.sqrt(3.0)) * math.sqrt(density / stiffness)
    steps = [spec.damping_time + math.hypot(spec.damping_time, bend)]
    if torsional_stiffness > 0.0:
        twist = h * spec.outer_radius * math.sqrt(density / (2.0 * torsional_stiffness))
        relaxation = spec.damping_time * stiffness / torsional_stiffness
        steps.append(relaxation + math.hypot(relaxation, twist))
    return min(steps)
