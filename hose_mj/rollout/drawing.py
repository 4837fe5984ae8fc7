"""Draws a hose as capsules into a scene of MuJoCo's own pictures, coloured by tension."""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

from hose_mj.hoses.protocol import Array
from hose_mj.recording.palette import color_tension
from hose_mj.world.world import World

N_PIECES = 80


def draw_hose(scn: mujoco.MjvScene, world: World, limit: float, n_pieces: int = N_PIECES) -> int:
    """Adds the hose of a world to the geoms of a scene.

    Args:
        scn: added to, behind what it holds: the `user_scn` of a passive viewer, or the scene of a
            renderer after its update.
        world: shown as it stands.
        limit: the tension that is red (N).
        n_pieces: capsules.

    Returns:
        How many capsules were added: fewer where the scene is full.
    """
    arcs = np.linspace(0.0, world.scene.spec.length, n_pieces + 1)
    points = world.position(arcs)
    colors = color_pieces(world, arcs, limit)
    n = int(min(n_pieces, scn.maxgeom - scn.ngeom))
    radius = world.scene.spec.outer_radius
    for k in range(n):
        geom = scn.geoms[scn.ngeom + k]
        mujoco.mjv_initGeom(geom, _CAPSULE, np.zeros(3), np.zeros(3), np.eye(3).ravel(), colors[k])
        mujoco.mjv_connector(geom, _CAPSULE, radius, points[k], points[k + 1])
    scn.ngeom += n
    return n


def color_pieces(world: World, arcs: Array, limit: float) -> npt.NDArray[np.float32]:
    """Red, green, blue, opacity from 0 to 1, float32 (k, 4), of the pieces between arc lengths."""
    middles = 0.5 * (arcs[1:] + arcs[:-1])
    colors = np.ones((len(middles), 4), np.float32)
    colors[:, :3] = color_tension(world.tension(middles), limit) / 255.0
    return colors


_CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
