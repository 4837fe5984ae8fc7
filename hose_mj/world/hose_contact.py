"""Which parts of a hose inside a scene's mjModel touch which of its geoms, and how.

The hose has bits of MuJoCo's contype that no geom of the scene uses, and the geoms' conaffinity
takes them on, so contacts within the scene stay as they are. Parts of the hose that pass by the
same robots share a bit; a robot's own geoms do not take on the bits of the parts near its site.
Planes have a bit of their own: of a capsule they touch the two ends, so spheres at the nodes are
the same contacts, each of them once.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.scenes.mjcf.model import START
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.world.scene_geoms import OWN_ARC, SceneGeoms, find_colliding, find_radius

_BITS = 31
_TORSION, _ROLLING = 0.005, 0.0001


@dataclass(frozen=True)
class HoseContact:
    """How the hose touches things.

    Attributes:
        friction: MuJoCo's five coefficients, of which the first two, Coulomb's, count.
        priority: above that of all geoms of the scene: in a contact with the hose its friction and
            hardness count.
        solref: critically damped, two of the world's time steps.
        bits: contype of each piece of the hose (N,), for all but planes.
        plane_bit: contype for planes.
    """

    friction: list[float]
    priority: int
    solref: list[float]
    bits: np.ndarray
    plane_bit: int

    def write(self, item: mujoco.MjsGeom | mujoco.MjsFlex, bits: int) -> None:
        """Lets a geom or flex of the hose touch what takes on these bits."""
        item.contype, item.conaffinity, item.condim = bits, 0, 3
        item.friction = self.friction[: len(item.friction)]
        item.priority, item.solref = self.priority, self.solref


def open_scene(
    scene: Scene, maker: mujoco.MjSpec, nodes: Array, step: float
) -> tuple[HoseContact, list[Obstacle]]:
    """Lets the geoms of a scene touch the pieces of a hose between nodes (N + 1,), m.

    Args:
        scene: checked.
        maker: its spec, compiled; what its geoms collide with is changed.
        nodes: arc lengths.
        step: the world's time step (s).

    Returns:
        how the hose touches them, and where the simple ones stand at the start.

    Raises:
        InputError: a scene that leaves too few bits.
    """
    model = maker.compile()
    data = _place_bodies(model)
    passes = _find_neighbours(scene, model, data, nodes)
    groups, group = np.unique(passes, axis=0, return_inverse=True)
    used = int(np.bitwise_or.reduce([*model.geom_contype, *model.flex_contype, 0]))
    free = [1 << k for k in range(1, _BITS) if not used >> k & 1]
    if len(free) < len(groups) + 1:
        valid = f"at least {len(groups) + 1} bits that no geom uses, for the hose"
        raise InputError("bits of contype", bin(used), valid)
    plane_bit, bits = free[0], np.array(free[1 : len(groups) + 1])
    owner = _find_owners(scene, model)
    touched = set(find_colliding(model).tolist())
    for geom in maker.geoms:
        if geom.id in touched:
            robot = owner[geom.id]
            open_to = bits if robot < 0 else bits[~groups[:, robot]]
            is_plane = geom.type == mujoco.mjtGeom.mjGEOM_PLANE
            geom.conaffinity |= plane_bit if is_plane else int(open_to.sum())
    sites = np.array([model.site(p.site).id for p in (*scene.robots, scene.source)])
    arc_lengths = np.array([*(robot.arc_length for robot in scene.robots), 0.0])
    geoms = SceneGeoms.find(model, data, sites, arc_lengths)
    contact = HoseContact(
        [scene.friction, scene.friction, _TORSION, _ROLLING, _ROLLING],
        int(model.geom_priority.max(initial=0)) + 1,
        [2.0 * step, 1.0],
        bits[group.ravel()],
        plane_bit,
    )
    return contact, geoms.make_obstacles(model, data, scene.friction)


def _place_bodies(model: mujoco.MjModel) -> mujoco.MjData:
    """The scene's bodies where it starts."""
    data = mujoco.MjData(model)
    key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, START)
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_kinematics(model, data)
    return data


def _find_neighbours(
    scene: Scene, model: mujoco.MjModel, data: mujoco.MjData, nodes: Array
) -> np.ndarray:
    """Whether a piece (row) passes by a robot (column) too closely to touch it, (N, robots)."""
    owner = _find_owners(scene, model)
    passes = np.zeros((len(nodes) - 1, len(scene.robots)), dtype=bool)
    for k, robot in enumerate(scene.robots):
        own = np.flatnonzero(owner == k)
        arc = OWN_ARC * find_radius(model, data, model.site(robot.site).id, own)
        low, high = robot.arc_length - arc, robot.arc_length + arc
        passes[:, k] = (nodes[1:] > low) & (nodes[:-1] < high)
    return passes


def _find_owners(scene: Scene, model: mujoco.MjModel) -> np.ndarray:
    """Number of the robot that each geom belongs to, -1 for none, (ngeom,)."""
    owner = np.full(model.ngeom, -1)
    for k, robot in enumerate(scene.robots):
        root = model.body_rootid[model.site_bodyid[model.site(robot.site).id]]
        owner[model.body_rootid[model.geom_bodyid] == root] = k
    return owner
