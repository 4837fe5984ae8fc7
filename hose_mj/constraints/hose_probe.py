"""`HoseProbe`: distances between the hose and geoms of shapes that only MuJoCo can measure.

Meshes and ellipsoids. Where the hose is near, MuJoCo measures the distance to capsules of its
radius, laid along chords of the centre line. The chords miss it by their sagitta, a quarter of a
piece's length squared times its curvature over 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from hose_mj.hoses.model import Array
from hose_mj.world.centre_line import CentreLine

CHORDS = 4
"""In a piece of the centre line."""


class HoseProbe:
    """A small mjModel of the geoms in question and one capsule.

    Args:
        model: the world's.
        geoms: numbers of the geoms.
        radius: of the hose, m.
        arcs: arc lengths at the ends of the centre line's pieces (K + 1,), m.
    """

    def __init__(self, model: Any, geoms: Sequence[int], radius: float, arcs: Array) -> None:
        self._geoms, self._radius = list(geoms), radius
        steps = np.arange(CHORDS) / CHORDS
        inner = arcs[:-1, None] + np.diff(arcs)[:, None] * steps
        self._arcs = np.append(inner.ravel(), arcs[-1])
        spec = mujoco.MjSpec()
        for geom in self._geoms:
            _copy_geom(spec, model, geom)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, radius, 0.0])
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)

    def measure(
        self, data: Any, geom: int, line: CentreLine, ends: tuple[float, float], most: float
    ) -> tuple[float, float, Array]:
        """Distance between a geom and the surface of a stretch of the hose.

        Args:
            data: the world's.
            geom: its number in the world.
            line: the hose's centre line.
            ends: arc lengths (m) of the stretch.
            most: farther than this (m) is not looked for.

        Returns:
            distance (m), at most `most`; arc length (m); the middle of the nearest chord (3,), m.
        """
        own = self._place(data, geom)
        inside = (self._arcs > ends[0]) & (self._arcs < ends[1])
        arcs = np.concatenate([[ends[0]], self._arcs[inside], [ends[1]]])
        points = line.position(arcs)
        middles, along = 0.5 * (points[:-1] + points[1:]), np.diff(points, axis=0)
        lengths = np.linalg.norm(along, axis=1)
        center, bound = self._data.geom_xpos[own], self._model.geom_rbound[own]
        gaps = np.linalg.norm(middles - center, axis=1) - 0.5 * lengths - bound - self._radius
        best, nearest = most, 0
        for k in np.argsort(gaps):
            if gaps[k] >= best:
                break
            self._lay(middles[k], along[k], lengths[k])
            capsule = self._model.ngeom - 1
            found = mujoco.mj_geomDistance(self._model, self._data, own, capsule, best, None)
            if found < best:
                best, nearest = found, int(k)
        return best, float(0.5 * (arcs[nearest] + arcs[nearest + 1])), middles[nearest]

    def _place(self, data: Any, geom: int) -> int:
        """Puts the copy of a geom where it is in the world; returns its number."""
        own = self._geoms.index(geom)
        rotation = data.geom_xmat[geom].reshape(3, 3)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, self._model.geom_quat[own])
        self._data.geom_xpos[own] = data.geom_xpos[geom] + rotation @ self._model.geom_pos[own]
        self._data.geom_xmat[own] = (rotation @ turn.reshape(3, 3)).ravel()
        return own

    def _lay(self, middle: Array, along: Array, length: float) -> None:
        """Lays the capsule along a chord."""
        quaternion, matrix = np.zeros(4), np.zeros(9)
        mujoco.mju_quatZ2Vec(quaternion, along)
        mujoco.mju_quat2Mat(matrix, quaternion)
        self._data.geom_xpos[-1], self._data.geom_xmat[-1] = middle, matrix
        self._model.geom_size[-1, 1] = 0.5 * length


def _copy_geom(spec: Any, model: Any, geom: int) -> None:
    """Adds a geom of the world's model; a mesh's own frame is found anew at compilation."""
    if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
        spec.worldbody.add_geom(type=model.geom_type[geom], size=model.geom_size[geom])
        return
    mesh = model.geom_dataid[geom]
    points, faces = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    name = f"mesh {geom}"
    spec.add_mesh(
        name=name,
        uservert=model.mesh_vert[points : points + model.mesh_vertnum[mesh]].ravel(),
        userface=model.mesh_face[faces : faces + model.mesh_facenum[mesh]].ravel(),
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)
