"""The motors of a scene's robots: which robot each belongs to, and how it pulls at the joints."""

from __future__ import annotations

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
    """The motors of one robot.

    Attributes:
        robot: its number.
        ids: of the actuators (k,).
        gains: force of a control of 1 (k,), N or N m.
        low, high: the controls allowed (k,); infinite where there is no limit.
        chain: the degrees of freedom between the world and the robot's site (c,).
        in_chain: which of the motors pull at these (k,); the others turn wheels or the like.
    """

    robot: int
    ids: Indices
    gains: Array
    low: Array
    high: Array
    chain: Indices
    in_chain: npt.NDArray[np.bool_]

    def choose(self, which: npt.NDArray[np.bool_]) -> Motors:
        """Some of the motors alone."""
        parts = (self.ids[which], self.gains[which], self.low[which], self.high[which])
        return Motors(self.robot, *parts, self.chain, self.in_chain[which])


def find_motors(world: World) -> list[Motors]:
    """Returns the motors of each robot, the tip's first.

    A motor is a robot's when it pulls at a joint of the robot's bodies.

    Raises:
        InputError: an actuator of a robot that is no motor.
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
        low, high = _find_limits(model, ids)
        in_chain = np.any(moments[ids][:, chain] != 0.0, axis=1)
        gains = np.array(model.actuator_gainprm[ids, 0])
        found.append(Motors(robot, ids, gains, low, high, chain, in_chain))
    return found


def read_moments(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """How each actuator's force pulls at each degree of freedom (nu, nv), at the pose of `data`."""
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


def _find_limits(model: mujoco.MjModel, ids: Indices) -> tuple[Array, Array]:
    """Controls that neither the range of the control nor that of the force cuts off."""
    low, high = np.full(len(ids), -np.inf), np.full(len(ids), np.inf)
    for k, actuator in enumerate(ids):
        if model.actuator_ctrllimited[actuator]:
            low[k], high[k] = model.actuator_ctrlrange[actuator]
        if model.actuator_forcelimited[actuator]:
            ends = model.actuator_forcerange[actuator] / model.actuator_gainprm[actuator, 0]
            low[k], high[k] = max(low[k], ends.min()), min(high[k], ends.max())
    return low, high
