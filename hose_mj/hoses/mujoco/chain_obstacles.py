"""Obstacles of a chain inside an mjModel: static geoms that its segments collide with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.obstacles import Obstacle

IMPEDANCE_RATIO = 10.0
"""MuJoCo's impratio: how much harder friction is than the normal force; 1 lets contacts slip."""


def check_obstacles(obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """Returns the obstacles; raises `InputError` for what is none, or for one that moves."""
    for obstacle in obstacles:
        if not isinstance(obstacle, Obstacle):
            raise InputError("obstacles", obstacle, "records of the class Obstacle")
        if np.any(obstacle.velocity) or np.any(obstacle.angular_velocity):
            raise InputError("velocity of an obstacle", obstacle.velocity, "0 for a chain")
    return tuple(obstacles)


def add_obstacles(
    maker: mujoco.MjSpec, bodies: Sequence[Any], obstacles: Sequence[Obstacle], timestep: float
) -> None:
    """Adds obstacles to a chain that is being made, and lets its segments touch them alone.

    Friction is the obstacle's: MuJoCo takes the larger of two geoms', the segments' is zero.
    Contacts are as hard as the time step allows (solref of two steps, critically damped), friction
    cones are elliptic.
    """
    if not obstacles:
        return
    maker.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    maker.option.impratio = IMPEDANCE_RATIO
    solref = [2.0 * timestep, 1.0]
    for body in bodies:
        for geom in body.geoms:
            geom.contype, geom.conaffinity, geom.condim = 0, 1, 3
            geom.friction, geom.solref = [0.0, 0.0, 0.0], solref
    for obstacle in obstacles:
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.asarray(obstacle.rotation).ravel())
        size = np.asarray(obstacle.size)
        maker.worldbody.add_geom(
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{obstacle.kind.upper()}"),
            pos=np.asarray(obstacle.position),
            quat=quaternion,
            size=[0.0, 0.0, 1.0] if obstacle.kind == "plane" else size,
            friction=[obstacle.friction, 0.0, 0.0],
            contype=1,
            conaffinity=0,
            condim=3,
            solref=solref,
        )
