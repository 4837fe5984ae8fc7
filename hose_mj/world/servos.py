"""Servos that bring a robot's site to a place with the motors between the world and the site.

The site's wanted velocity points to its target and falls with the distance d,

    v(d) = min(w d / 2, sqrt(2 b d), v_max),

with bandwidth w and braking b that half the motors' strength suffices for; the wanted acceleration
is 2 w (v - site's velocity). Near the target this is the critically damped oscillator
x'' = -w^2 x - 2 w x'. The force f = Lambda a needs the site's apparent mass Lambda =
(J M^-1 J^T)^-1; the motors take J^T f by least squares, each up to its limit. Weight is left to the
scene (`gravcomp`).
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.world.motors import Motors, read_moments
from hose_mj.world.world import World

_RANK = 1e-9
"""Relative size below which a direction counts as out of the motors' reach."""
_TINY = 1e-12


def find_axes(world: World, motors: Motors) -> int:
    """How many axes of space the motors move the site along: 3, 2 (x and y), or 0."""
    jacobian, moments, _ = _measure(world, motors, world.data)
    reach = jacobian @ moments.T
    if np.linalg.matrix_rank(reach, _RANK * (1.0 + abs(reach).max(initial=0.0))) == 3:
        return 3
    plane = reach[:2]
    return (
        2 if np.linalg.matrix_rank(plane, _RANK * (1.0 + abs(plane).max(initial=0.0))) == 2 else 0
    )


def is_constant(world: World, motors: Motors) -> bool:
    """Whether masses and Jacobians stay the same in every pose: all joints slide."""
    model = world.model
    bodies = world.robot_bodies[motors.robot]
    joints = np.isin(model.jnt_bodyid, bodies)
    slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
    at_joints = model.actuator_trntype[motors.ids] == mujoco.mjtTrn.mjTRN_JOINT
    return bool(np.all(slides) and np.all(at_joints))


class SlideServo:
    """All robots whose joints slide, at once: their gains never change.

    Args:
        world: with the robots.
        robots: the motors of each, in the sites' chains.
        bandwidth: w (1/s).
        speed: v_max (m/s).
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
            axes = find_axes(world, motors)
            self._axes[k, axes:] = 0.0
            jacobian, moments, inverse = _measure(world, motors, world.data)
            self._jacobian[3 * k : 3 * k + 3, motors.chain] = jacobian
            gains = _make_gains(jacobian, moments, inverse, axes) / motors.gains[:, None]
            rows = slice(first, first + len(motors.ids))
            self._gains[rows, 3 * k : 3 * k + axes] = gains
            self._braking[k] = _find_braking(motors, gains)
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

    Args:
        world: with the robot.
        motors: those in the site's chain.
        bandwidth: w (1/s).
        speed: v_max (m/s).
    """

    def __init__(self, world: World, motors: Motors, bandwidth: float, speed: float) -> None:
        self._world, self._motors = world, motors
        self._bandwidth, self._speed = bandwidth, speed
        self._axes = find_axes(world, motors)

    def update(self, targets: Array) -> None:
        """Writes the controls of the next step; targets (N, 3), m."""
        motors, axes, data = self._motors, self._axes, self._world.data
        jacobian, moments, inverse = _measure(self._world, motors, data)
        gains = _make_gains(jacobian, moments, inverse, axes) / motors.gains[:, None]
        site = self._world.sites[motors.robot]
        error = (targets[motors.robot] - data.site_xpos[site])[:axes]
        distance = np.array([np.linalg.norm(error) + _TINY])
        braking = np.array([_find_braking(motors, gains)])
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


def _find_braking(motors: Motors, gains: Array) -> float:
    """Half the acceleration that the motors reach along every axis (m/s^2)."""
    limit = np.maximum(abs(motors.low), abs(motors.high))[:, None]
    with np.errstate(divide="ignore"):
        reach = limit / abs(gains)
    return 0.5 * float(np.min(reach, initial=np.inf))
