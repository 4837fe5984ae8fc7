"""What stands in the way of robots: the scene's geoms that they collide with, and how far it is."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from hose_mj.hoses.protocol import Array
from hose_mj.world.world import World


class Obstacles:
    """Distances of a robot to the scene around it.

    Planes that face up are floors and stand in nobody's way, nor does what the robot stands on or
    touches at the start.

    Args:
        world: with robots and scene, at the state of which the distances are.
        robot: number of the robot.
    """

    def __init__(self, world: World, robot: int) -> None:
        model = world.model
        self._model = model
        self._data = mujoco.MjData(model)
        self._data.qpos[:] = world.data.qpos
        mujoco.mj_kinematics(model, self._data)
        self.geoms = find_solid(world, np.asarray(world.robot_bodies[robot]))
        self._own = np.array(self._data.geom_xpos[self.geoms])
        moving = np.concatenate(world.robot_bodies)
        fixed = np.flatnonzero(model.body_weldid == 0)
        fixed = np.setdiff1d(fixed, moving)
        self.others = np.array(
            [g for g in find_solid(world, fixed) if not self._is_ground(int(g))], np.int64
        )

    def measure(self, offset: Array, most: float) -> float:
        """Clearance (m) of the robot moved by an offset (3,); `most` where it is larger."""
        return min((self.find(int(g), offset, most)[0] for g in self.others), default=most)

    def find(self, obstacle: int, offset: Array, most: float) -> tuple[float, Array]:
        """Clearance (m) to one obstacle, and the vector (3,) to it from the robot moved."""
        data, model = self._data, self._model
        data.geom_xpos[self.geoms] = self._own + offset
        best, towards = most, np.zeros(3)
        ends = np.zeros(6)
        for geom in self.geoms:
            reach = model.geom_rbound[geom] + model.geom_rbound[obstacle] + best
            apart = data.geom_xpos[geom] - data.geom_xpos[obstacle]
            if model.geom_rbound[obstacle] > 0.0 and apart @ apart > reach * reach:
                continue
            distance = mujoco.mj_geomDistance(model, data, int(geom), obstacle, best, ends)
            if distance < best:
                best, towards = distance, ends[3:] - ends[:3]
        return best, towards

    def _is_ground(self, geom: int) -> bool:
        if self._model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_PLANE:
            return self.find(geom, np.zeros(3), 1e-3)[0] < 1e-3
        return bool(self._data.geom_xmat[geom, 8] > 0.7)


def find_solid(world: World, bodies: NDArray[np.int64]) -> NDArray[np.int64]:
    """The geoms of some bodies that collide with anything."""
    model = world.model
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return np.flatnonzero(solid & np.isin(model.geom_bodyid, bodies))


def compute_reach(world: World, robot: int) -> float:
    """Returns how far (m) a robot's colliding geoms reach around its site, seen from above."""
    model, data = world.model, world.data
    site = data.site_xpos[world.sites[robot], :2]
    reach = 0.0
    for geom in find_solid(world, np.asarray(world.robot_bodies[robot])):
        away = float(np.linalg.norm(data.geom_xpos[geom, :2] - site))
        if model.geom_type[geom] in (_CYLINDER, _ELLIPSOID):
            away += float(model.geom_size[geom, 0])
        else:
            away += float(np.linalg.norm(model.geom_aabb[geom, 3:5]))
        reach = max(reach, away)
    return reach


_CYLINDER, _ELLIPSOID = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_ELLIPSOID
