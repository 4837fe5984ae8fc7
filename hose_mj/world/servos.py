"""Motors and the servos that bring a robot's site to a place with them.

`find_motors` says which robot each motor belongs to and how it pulls at the joints.

**Motors between the world and the site** (`SlideServo`, `ArmServo`). The site's wanted velocity
points to its target and falls with the distance d,

    v(d) = min(w d / 2, sqrt(2 b d), v_max),

with bandwidth w and braking b that half the motors' strength suffices for; the wanted acceleration
is 2 w (v - site's velocity). Near the target this is the critically damped oscillator
x'' = -w^2 x - 2 w x'. The force f = Lambda a needs the site's apparent mass Lambda =
(J M^-1 J^T)^-1; the motors take J^T f by least squares, each up to its limit. Weight is left to the
scene (`gravcomp`).

**Two driven wheels** (`WheelServo`). A base moves along the middle of its axle and turns about it.
A target is reached when the base turns until the target lies on the line through the axle's middle
along which it drives, forwards or backwards, whichever needs less turning, and drives until its
site, not the axle, is there. The wheels' speeds follow by motors with limits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from hose_mj.errors import InputError
from hose_mj.hoses.protocol import Array
from hose_mj.world.world import World

Indices = npt.NDArray[np.int64]
_MOTOR = {
    "gaintype": int(mujoco.mjtGain.mjGAIN_FIXED),
    "biastype": int(mujoco.mjtBias.mjBIAS_NONE),
    "dyntype": int(mujoco.mjtDyn.mjDYN_NONE),
}


@dataclass(frozen=True)
class Motors:
    """The motors of one robot."""

    robot: int  # its number
    ids: Indices  # of the actuators (k,)
    gains: Array  # force of a control of 1 (k,), N or N m
    # low, high: the controls allowed (k,); infinite where there is no limit.
    low: Array
    high: Array
    chain: Indices  # the degrees of freedom between the world and the robot's site (c,)
    # Which of the motors pull at these (k,); the others turn wheels or the like.
    in_chain: npt.NDArray[np.bool_]

    def choose(self, which: npt.NDArray[np.bool_]) -> Motors:
        """Some of the motors alone."""
        parts = (self.ids[which], self.gains[which], self.low[which], self.high[which])
        return Motors(self.robot, *parts, self.chain, self.in_chain[which])


def find_motors(world: World) -> list[Motors]:
    """Returns the motors of each robot, the tip's first.

    A motor is a robot's when it pulls at a joint of the robot's bodies. `InputError` is raised for
    an actuator of a robot that is no motor.
    """
    model = world.model
    data = mujoco.MjData(model)
    data.qpos[:] = world.data.qpos
    mujoco.mj_forward(model, data)
    roots = model.body_rootid[model.dof_bodyid]
    moments = read_moments(model, data)
    found = []
    for robot, bodies in enumerate(world.robot_bodies):
        own = np.flatnonzero(roots == model.body_rootid[bodies[0]])
        ids = np.flatnonzero(np.any(moments[:, own] != 0.0, axis=1))
        for actuator in ids:
            _check_motor(model, int(actuator))
        chain = _list_chain(model, int(model.site_bodyid[world.sites[robot]]))
        low, high = _read_limits(model, ids)
        in_chain = np.any(moments[ids][:, chain] != 0.0, axis=1)
        gains = np.array(model.actuator_gainprm[ids, 0])
        found.append(Motors(robot, ids, gains, low, high, chain, in_chain))
    return found


def read_moments(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Returns how each actuator's force pulls at each degree of freedom, (nu, nv), for `data`."""
    dense = np.zeros((model.nu, model.nv))
    for k in range(model.nu):
        start = data.moment_rowadr[k]
        row = slice(start, start + data.moment_rownnz[k])
        dense[k, data.moment_colind[row]] = data.actuator_moment[row]
    return dense


def _list_chain(model: mujoco.MjModel, body: int) -> Indices:
    dofs: list[int] = []
    while body:
        first = int(model.body_dofadr[body])
        dofs += range(first, first + int(model.body_dofnum[body]))
        body = int(model.body_parentid[body])
    return np.array(sorted(dofs), np.int64)


def _check_motor(model: mujoco.MjModel, actuator: int) -> None:
    name = model.actuator(actuator).name or str(actuator)
    for field, wanted in _MOTOR.items():
        if getattr(model, f"actuator_{field}")[actuator] != wanted:
            valid = "a <motor>, to be driven to a place; else set world.control yourself"
            raise InputError(f"actuator {name}", "no motor", valid)
    if model.actuator_gainprm[actuator, 0] == 0.0:
        raise InputError(f"actuator {name}: gain", 0.0, "a number other than 0")


def _read_limits(model: mujoco.MjModel, ids: Indices) -> tuple[Array, Array]:
    """Controls that neither the range of the control nor that of the force cuts off."""
    low, high = np.full(len(ids), -np.inf), np.full(len(ids), np.inf)
    for k, actuator in enumerate(ids):
        if model.actuator_ctrllimited[actuator]:
            low[k], high[k] = model.actuator_ctrlrange[actuator]
        if model.actuator_forcelimited[actuator]:
            ends = model.actuator_forcerange[actuator] / model.actuator_gainprm[actuator, 0]
            low[k], high[k] = max(low[k], ends.min()), min(high[k], ends.max())
    return low, high


_RANK = 1e-9  # relative size below which a direction counts as out of the motors' reach
_TINY = 1e-12


def count_axes(world: World, motors: Motors) -> int:
    """Counts how many axes of space the motors move the site along: 3, 2 (x and y), or 0."""
    jacobian, moments, _ = _measure(world, motors, world.data)
    reach = jacobian @ moments.T
    if np.linalg.matrix_rank(reach, _RANK * (1.0 + abs(reach).max(initial=0.0))) == 3:
        return 3
    plane = reach[:2]
    return (
        2 if np.linalg.matrix_rank(plane, _RANK * (1.0 + abs(plane).max(initial=0.0))) == 2 else 0
    )


def is_constant(world: World, motors: Motors) -> bool:
    """Says whether masses and Jacobians stay the same in every pose: all joints slide."""
    model = world.model
    bodies = world.robot_bodies[motors.robot]
    joints = np.isin(model.jnt_bodyid, bodies)
    slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
    at_joints = model.actuator_trntype[motors.ids] == mujoco.mjtTrn.mjTRN_JOINT
    return bool(np.all(slides) and np.all(at_joints))


class SlideServo:
    """All robots whose joints slide, at once: their gains never change.

    `robots` are the motors of each in the sites' chains, `bandwidth` is w (1/s), `speed` v_max
    (m/s).
    """

    def __init__(
        self, world: World, robots: Sequence[Motors], bandwidth: float, speed: float
    ) -> None:
        self._world, self._bandwidth, self._speed = world, bandwidth, speed
        self.robots = np.array([motors.robot for motors in robots])
        self._sites = world.sites[self.robots]
        self._ids = np.concatenate([motors.ids for motors in robots])
        self._low = np.concatenate([motors.low for motors in robots])
        self._high = np.concatenate([motors.high for motors in robots])
        n = len(robots)
        self._axes = np.ones((n, 3))
        self._jacobian = np.zeros((3 * n, world.model.nv))
        self._gains = np.zeros((len(self._ids), 3 * n))
        self._braking = np.empty(n)
        first = 0
        for k, motors in enumerate(robots):
            axes = count_axes(world, motors)
            self._axes[k, axes:] = 0.0
            jacobian, moments, inverse = _measure(world, motors, world.data)
            self._jacobian[3 * k : 3 * k + 3, motors.chain] = jacobian
            gains = _make_gains(jacobian, moments, inverse, axes) / motors.gains[:, None]
            rows = slice(first, first + len(motors.ids))
            self._gains[rows, 3 * k : 3 * k + axes] = gains
            self._braking[k] = _compute_braking(motors, gains)
            first += len(motors.ids)

    def update(self, targets: Array) -> None:
        """Writes the controls of the next step; targets (N, 3), m."""
        data = self._world.data
        error = (targets[self.robots] - data.site_xpos[self._sites]) * self._axes
        distance = np.sqrt(np.einsum("ij,ij->i", error, error)) + _TINY
        rate = _choose_rate(distance, self._bandwidth, self._braking, self._speed)
        velocity = self._jacobian @ data.qvel
        wanted = 2.0 * self._bandwidth * ((error * rate[:, None]).ravel() - velocity)
        control = self._gains @ wanted
        self._world.control[self._ids] = np.minimum(np.maximum(control, self._low), self._high)


class ArmServo:
    """One robot whose site turns about joints: its gains follow its pose.

    `motors` are those in the site's chain, `bandwidth` is w (1/s), `speed` v_max (m/s).
    """

    def __init__(self, world: World, motors: Motors, bandwidth: float, speed: float) -> None:
        self._world, self._motors = world, motors
        self._bandwidth, self._speed = bandwidth, speed
        self._axes = count_axes(world, motors)

    def update(self, targets: Array) -> None:
        """Writes the controls of the next step; targets (N, 3), m."""
        motors, axes, data = self._motors, self._axes, self._world.data
        jacobian, moments, inverse = _measure(self._world, motors, data)
        gains = _make_gains(jacobian, moments, inverse, axes) / motors.gains[:, None]
        site = self._world.sites[motors.robot]
        error = (targets[motors.robot] - data.site_xpos[site])[:axes]
        distance = np.array([np.linalg.norm(error) + _TINY])
        braking = np.array([_compute_braking(motors, gains)])
        rate = _choose_rate(distance, self._bandwidth, braking, self._speed)
        velocity = (jacobian @ data.qvel[motors.chain])[:axes]
        control = gains @ (2.0 * self._bandwidth * (error * rate - velocity))
        self._world.control[motors.ids] = np.clip(control, motors.low, motors.high)


def _choose_rate(distance: Array, bandwidth: float, braking: Array, speed: float) -> Array:
    """v(d) / d (n,), 1/s."""
    braked = np.minimum(np.sqrt(2.0 * braking * distance), speed)
    return np.minimum(braked / distance, 0.5 * bandwidth)


def _measure(world: World, motors: Motors, data: mujoco.MjData) -> tuple[Array, Array, Array]:
    """Jacobian of the site (3, c), moments of the motors (k, c), inverse inertia (c, c)."""
    model = world.model
    mujoco.mj_makeM(model, data)
    mujoco.mj_transmission(model, data)
    rows = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, rows, None, int(world.sites[motors.robot]))
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    own = np.flatnonzero(
        model.body_rootid[model.dof_bodyid]
        == model.body_rootid[world.robot_bodies[motors.robot][0]]
    )
    inverse = np.zeros_like(inertia)
    inverse[np.ix_(own, own)] = np.linalg.inv(inertia[np.ix_(own, own)])
    moments = read_moments(model, data)[motors.ids]
    c = motors.chain
    return rows[:, c], moments[:, c], inverse[np.ix_(c, c)]


def _make_gains(jacobian: Array, moments: Array, inverse: Array, axes: int) -> Array:
    """Forces of the motors for an acceleration of the site: (k, axes)."""
    rows = jacobian[:axes]
    mobility = rows @ inverse @ rows.T
    force = rows.T @ np.linalg.pinv(mobility, rcond=_RANK, hermitian=True)
    return np.asarray(np.linalg.pinv(moments.T, rcond=_RANK) @ force)


def _compute_braking(motors: Motors, gains: Array) -> float:
    """Half the acceleration that the motors reach along every axis (m/s^2)."""
    limit = np.maximum(abs(motors.low), abs(motors.high))[:, None]
    with np.errstate(divide="ignore"):
        reach = limit / abs(gains)
    return 0.5 * float(np.min(reach, initial=np.inf))


DRIVING_RATE = 4.0  # wanted speed by distance (1/s)
TURNING_RATE = 5.0  # wanted turning speed by angle (1/s)
FASTEST_TURN = 2.5  # rad/s
WHEEL_RATE = 25.0  # how fast a wheel's speed follows (1/s)
_KEPT = 0.2  # cosine up to which the direction of driving, forwards or backwards, is kept
_PARALLEL = 1e-3
_SHARE_OF_GRIP = 0.25  # acceleration that braking counts on, as a share of gravity's
_ROUND = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
    for kind in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "MESH")
}
_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


class WheelServo:
    """One base with two driven wheels, where `fits`; `speed` is the highest (m/s)."""

    def __init__(self, world: World, motors: Motors, speed: float) -> None:
        model = world.model
        self._world, self._motors, self._speed = world, motors, speed
        joints = model.actuator_trnid[motors.ids, 0]
        self._joints, self._dofs = joints, model.jnt_dofadr[joints]
        gear = model.actuator_gear[motors.ids, 0]
        self._site = int(world.sites[motors.robot])
        self._radius = np.array(
            [_compute_wheel_radius(model, int(model.jnt_bodyid[j])) for j in joints]
        )
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
        """Says whether these are two motors that turn parallel, level wheels of one moving body."""
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
            and all(_compute_wheel_radius(model, int(body)) > 0.0 for body in bodies)
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


def _compute_wheel_radius(model: mujoco.MjModel, body: int) -> float:
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
