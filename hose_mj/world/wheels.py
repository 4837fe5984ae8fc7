"""A servo for bases with two driven wheels, which a site on them follows where they let it.

A base moves along the middle of its axle and turns about it. A target is reached when the base
turns until the target lies on the line through the axle's middle along which it drives, forwards or
backwards, whichever needs less turning, and drives until its site, not the axle, is there. The
wheels' speeds follow by motors with limits.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.world.motors import Motors
from hose_mj.world.world import World

DRIVING_RATE = 4.0
"""Wanted speed by distance (1/s)."""
TURNING_RATE = 5.0
"""Wanted turning speed by angle (1/s)."""
FASTEST_TURN = 2.5
"""rad/s."""
WHEEL_RATE = 25.0
"""How fast a wheel's speed follows (1/s)."""
_KEPT = 0.2
"""Cosine up to which the direction of driving, forwards or backwards, is kept."""
_PARALLEL = 1e-3
_SHARE_OF_GRIP = 0.25
"""Acceleration that braking counts on, as a share of gravity's."""
_ROUND = {
    int(kind)
    for kind in (
        mujoco.mjtGeom.mjGEOM_SPHERE,
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        mujoco.mjtGeom.mjGEOM_CYLINDER,
        mujoco.mjtGeom.mjGEOM_MESH,
    )
}


class WheelServo:
    """One base with two driven wheels; `WheelServo.fits` tells whether a robot is one.

    Args:
        world: with the robot.
        motors: the two that turn the wheels.
        speed: highest speed (m/s).
    """

    def __init__(self, world: World, motors: Motors, speed: float) -> None:
        model = world.model
        self._world, self._motors, self._speed = world, motors, speed
        joints = model.actuator_trnid[motors.ids, 0]
        self._joints, self._dofs = joints, model.jnt_dofadr[joints]
        gear = model.actuator_gear[motors.ids, 0]
        self._site = int(world.sites[motors.robot])
        self._radius = np.array([_find_radius(model, int(model.jnt_bodyid[j])) for j in joints])
        mass = float(model.body_subtreemass[world.robot_bodies[motors.robot][0]])
        spin = model.dof_armature[self._dofs] + np.array(
            [model.body_inertia[model.jnt_bodyid[j]].max() for j in joints]
        )
        inertia = spin + 0.5 * mass * self._radius**2
        self._gains = WHEEL_RATE * inertia / (motors.gains * gear)
        self._drag = model.dof_damping[self._dofs] / (motors.gains * gear)
        one, other = world.data.xanchor[joints]
        self._track = float(np.linalg.norm(one - other))
        self._sense = 1.0

    @staticmethod
    def fits(world: World, motors: Motors) -> bool:
        """Whether these are two motors that turn parallel, level wheels of one moving body."""
        model, data = world.model, world.data
        if len(motors.ids) != 2 or np.any(motors.in_chain) or len(motors.chain) == 0:
            return False
        if np.any(model.actuator_trntype[motors.ids] != mujoco.mjtTrn.mjTRN_JOINT):
            return False
        joints = model.actuator_trnid[motors.ids, 0]
        if np.any(model.jnt_type[joints] != mujoco.mjtJoint.mjJNT_HINGE):
            return False
        bodies = model.jnt_bodyid[joints]
        one, other = data.xaxis[joints]
        apart = data.xanchor[joints[0]] - data.xanchor[joints[1]]
        return bool(
            model.body_parentid[bodies[0]] == model.body_parentid[bodies[1]]
            and abs(abs(one @ other) - 1.0) < _PARALLEL
            and abs(one[2]) < _PARALLEL
            and np.linalg.norm(apart[:2]) > _PARALLEL
            and all(_find_radius(model, int(body)) > 0.0 for body in bodies)
        )

    def update(self, targets: Array) -> None:
        """Writes the controls of the next step; targets (N, 3), m."""
        data, motors = self._world.data, self._motors
        axes, anchors = data.xaxis[self._joints], data.xanchor[self._joints]
        # A wheel that turns about its axis a rolls along a x up.
        ahead = np.array([axes[0, 1], -axes[0, 0]])
        ahead /= math.hypot(ahead[0], ahead[1])
        signs = np.sign(axes[:, 1] * ahead[0] - axes[:, 0] * ahead[1])
        middle = 0.5 * (anchors[0, :2] + anchors[1, :2])
        # How far each wheel stands to the left of the middle.
        left = (anchors[:, 1] - middle[1]) * ahead[0] - (anchors[:, 0] - middle[0]) * ahead[1]
        drive, turn = self._steer(targets[motors.robot, :2], middle, ahead)
        wanted = signs * (drive - turn * left) / self._radius
        speeds = data.qvel[self._dofs]
        control = self._gains * (wanted - speeds) + self._drag * wanted
        self._world.control[motors.ids] = np.clip(control, motors.low, motors.high)

    def _steer(self, target: Array, middle: Array, ahead: Array) -> tuple[float, float]:
        """Wanted speed along `ahead` (m/s) and turning speed (rad/s)."""
        x, y = target - middle
        along, aside = x * ahead[0] + y * ahead[1], y * ahead[0] - x * ahead[1]
        distance = math.hypot(x, y)
        if self._sense * along < -_KEPT * distance:
            self._sense = -self._sense
        offset = (self._world.data.site_xpos[self._site, :2] - middle) @ ahead
        angle = math.atan2(self._sense * aside, self._sense * along)
        # Close to the axle, which may pass over the target, the direction means nothing.
        angle *= min(1.0, distance / self._track)
        rest = self._sense * distance - offset
        braked = math.sqrt(2.0 * _SHARE_OF_GRIP * 9.81 * abs(rest))
        speed = min(DRIVING_RATE * abs(rest), braked, self._speed)
        drive = math.copysign(speed, rest) * max(0.0, math.cos(angle)) ** 2
        turn = max(-FASTEST_TURN, min(FASTEST_TURN, TURNING_RATE * angle))
        return drive, turn


def _find_radius(model: mujoco.MjModel, body: int) -> float:
    """Radius of the largest colliding round geom of a wheel (m); 0 without one."""
    first = int(model.body_geomadr[body])
    radii = [
        float(
            model.geom_aabb[g, 3:].max() if model.geom_type[g] == _MESH else model.geom_size[g, 0]
        )
        for g in range(first, first + int(model.body_geomnum[body]))
        if int(model.geom_type[g]) in _ROUND
        and (model.geom_contype[g] or model.geom_conaffinity[g])
    ]
    return max(radii, default=0.0)


_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
