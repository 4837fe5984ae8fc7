"""`PlanarPointRobots`: masses on slides, stepped with their hose in compiled code.

Their motion is what MuJoCo makes of them as long as they touch nothing; where one may, the step is
MuJoCo's (tests/world/test_planar_point_robots.py).
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.geds.point_masses import PointMasses
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array, Hold
from hose_mj.world.geds_contact import GedsContact
from hose_mj.world.scene_geoms import KIND_NAMES, compute_radius
from hose_mj.world.world import World

_ALIGNED = 1.0 - 1e-12


class PlanarPointRobots:
    """The robots of a world in which nothing else moves, each a body on slides along world axes.

    Each degree of freedom goes along one of the `axes` (nv,), up or down by the `signs` (nv,).
    """

    def __init__(
        self, world: World, hose: GedsHose, contact: GedsContact, axes: np.ndarray, signs: Array
    ) -> None:
        model, data = world.model, world.data
        self._world, self._hose, self._contact = world, hose, contact
        k, roots = world.n_robots, model.body_rootid
        self._sites = world.sites[:-1]
        root_of = {int(roots[model.site_bodyid[site]]): i for i, site in enumerate(self._sites)}
        owners = np.array([root_of[int(roots[body])] for body in model.dof_bodyid], dtype=np.int64)
        self._at, self._signs = (owners, axes), signs
        mass, drag = np.full((k, 3), np.inf), np.zeros((k, 3))
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        mass[self._at], drag[self._at] = np.diag(full), model.dof_damping
        # What acts at rest, (nv,): weight, and what MuJoCo takes off it.
        rest = mujoco.MjData(model)
        rest.qpos[:] = data.qpos
        mujoco.mj_forward(model, rest)
        self._constant = np.array(rest.qfrc_smooth)
        flat = bool(np.isinf(mass[:, 2]).all())
        reach, radius = np.zeros((2, k))
        for i, site in enumerate(self._sites):
            own = np.flatnonzero(roots[model.geom_bodyid] == roots[model.site_bodyid[site]])
            away = np.linalg.norm(data.geom_xpos[own] - data.site_xpos[site], axis=1)
            room = away + model.geom_rbound[own] + model.geom_margin[own]
            reach[i] = room.max(initial=0.0)
            radius[i] = compute_radius(model, data, site, own) if flat else reach[i]
        geoms = contact.geoms
        owner = np.full(len(geoms.ids), -1, dtype=np.int64)
        arm = np.zeros((len(geoms.ids), 3))
        for place in geoms.moving:
            i = root_of[int(roots[model.geom_bodyid[geoms.ids[place]]])]
            owner[place] = i
            arm[place] = data.geom_xpos[geoms.ids[place]] - data.site_xpos[self._sites[i]]
        if not len(geoms.moving):
            owner, arm = owner[:0], arm[:0]
        self._masses = PointMasses(
            position=np.zeros((k, 3)),
            velocity=np.zeros((k, 3)),
            mass=mass,
            drag=drag,
            force=np.zeros((k, 3)),
            radius=radius,
            across=2 if flat else 3,
            reach=reach,
            walls=hose.contacts.make_shapes(_find_walls(model, data, flat)),
            owner=owner,
            arm=arm,
            push=np.zeros((k, 3)),
        )

    @classmethod
    def find(cls, world: World, hose: GedsHose, contact: GedsContact) -> PlanarPointRobots | None:
        """Returns the robots of a world, None where one of them is something else."""
        model, data = world.model, world.data
        mujoco.mj_forward(model, data)
        slides = model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
        robots = {int(model.body_rootid[model.site_bodyid[site]]) for site in world.sites[:-1]}
        plain = (
            len(robots) == world.n_robots
            and model.nv > 0
            and bool(slides.all())
            and set(model.body_rootid[model.dof_bodyid].tolist()) <= robots
            and not (model.jnt_stiffness.any() or model.dof_frictionloss.any())
            and not (model.jnt_limited.any() or model.neq or model.ntendon or model.nplugin)
            and not (model.opt.density or model.opt.viscosity or data.nefc)
            and not len(contact.geoms.measured)
            and _has_motors(model)
        )
        if not plain:
            return None
        directions = data.xaxis
        axes = np.argmax(np.abs(directions), axis=1)
        signs = directions[np.arange(model.nv), axes]
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        owners = model.body_rootid[model.dof_bodyid].tolist()
        own_axis = len(set(zip(owners, axes.tolist(), strict=True))) == model.nv
        diagonal = not np.any(full - np.diag(np.diag(full)))
        if not (own_axis and diagonal and np.all(np.abs(signs) > _ALIGNED)):
            return None
        return cls(world, hose, contact, axes, np.sign(signs))

    def step(self, holds: Sequence[Hold], n_steps: int) -> int:
        """Advances hose and robots by up to n_steps steps; returns how many it was.

        Raises:
            StepError: a step that the hose cannot finish; the steps before count.
        """
        world, masses, contact = self._world, self._masses, self._contact
        data = world.data
        world.check_control()
        masses.position[:] = data.site_xpos[self._sites]
        masses.velocity[self._at] = self._signs * data.qvel
        masses.force[self._at] = self._signs * (self._constant + self._find_motor_forces())
        masses.force[:] += world.robot_forces
        masses.push[:] = 0.0
        moving, owner = contact.geoms.moving, masses.owner
        if len(moving):
            np.add.at(masses.push, owner[moving], contact.pushes[:, :3])
        start = masses.position.copy()
        try:
            return self._finish(self._hose.coupling.step_with_masses(holds, masses, n_steps), start)
        except BaseException:
            self._finish(0, start)
            raise

    def _finish(self, done: int, start: Array) -> int:
        """Hands the masses back to MuJoCo."""
        world, masses, contact = self._world, self._masses, self._contact
        data = world.data
        moved = (masses.position - start)[self._at]
        data.qpos[:] += self._signs * moved
        data.qvel[:] = self._signs * masses.velocity[self._at]
        data.time += done * world.timestep
        mujoco.mj_kinematics(world.model, data)
        mujoco.mj_comPos(world.model, data)
        moving = contact.geoms.moving
        if len(moving):
            contact.pushes[:] = 0.0
            owner = masses.owner[moving]
            first = np.unique(owner, return_index=True)
            contact.pushes[first[1], :3] = masses.push[first[0]]
        return done

    def _find_motor_forces(self) -> Array:
        """Generalised forces (nv,) of the motors under the world's controls."""
        model, control = self._world.model, self._world.control
        forces = np.zeros(model.nv)
        if not model.nu:
            return forces
        limited = model.actuator_ctrllimited.astype(bool)
        low, high = model.actuator_ctrlrange.T
        clipped = np.where(limited, np.minimum(np.maximum(control, low), high), control)
        made = model.actuator_gainprm[:, 0] * clipped
        limited = model.actuator_forcelimited.astype(bool)
        low, high = model.actuator_forcerange.T
        made = np.where(limited, np.minimum(np.maximum(made, low), high), made)
        dofs = model.jnt_dofadr[model.actuator_trnid[:, 0]]
        np.add.at(forces, dofs, model.actuator_gear[:, 0] * made)
        return forces


def _has_motors(model: mujoco.MjModel) -> bool:
    """Says whether all actuators are plain motors on joints."""
    return bool(
        np.all(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT)
        and np.all(model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE)
        and np.all(model.actuator_gaintype == mujoco.mjtGain.mjGAIN_FIXED)
        and np.all(model.actuator_biastype == mujoco.mjtBias.mjBIAS_NONE)
    )


def _find_walls(model: mujoco.MjModel, data: mujoco.MjData, flat: bool) -> list[Obstacle]:
    """Lists what stands still and may stop a robot; a sphere about what MuJoCo alone can measure.

    Robots that move horizontally keep their height over horizontal planes.
    """
    still = model.body_weldid[model.geom_bodyid] == 0
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    walls = []
    for g in np.flatnonzero(still & solid):
        kind = KIND_NAMES.get(int(model.geom_type[g]))
        level = kind == "plane" and abs(data.geom_xmat[g, 8]) > _ALIGNED
        if flat and level:
            continue
        margin = float(model.geom_margin[g])
        if kind is None or margin > 0.0:
            size = (float(model.geom_rbound[g]) + margin,)
            kind, size = "sphere", size
        else:
            size = tuple(model.geom_size[g])
        walls.append(
            Obstacle(kind=kind, position=data.geom_xpos[g], rotation=data.geom_xmat[g], size=size)
        )
    return walls
