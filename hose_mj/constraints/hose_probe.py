"""`HoseProbe`: distances between the hose and geoms of shapes that only MuJoCo can measure.

Meshes and ellipsoids. Where the hose is near, MuJoCo measures the distance to capsules of its
radius, laid along chords of the centre line. The chords miss it by their sagitta, a quarter of a
piece's length squared times its curvature over 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.world.centre_line import CentreLine

CHORDS = 4
"""In a piece of the centre line."""


class Nearest(NamedTuple):
    """Distance of the hose's surface, m; arc length of the chord's middle, m; its place (3,), m."""

    distance: float
    arc_length: float
    place: Array


class HoseProbe:
    """A small mjModel of the geoms in question and one capsule.

    Args:
        model: the world's.
        geoms: for each robot the numbers of its geoms to be measured.
        own: arc lengths between which a robot's own hose lies (N, 2), m.
        radius: of the hose, m.
        arcs: arc lengths at the ends of the centre line's pieces (K + 1,), m.
    """

    def __init__(
        self, model: Any, geoms: Sequence[Sequence[int]], own: Array, radius: float, arcs: Array
    ) -> None:
        self._geoms, self._radius = geoms, radius
        inner = arcs[:-1, None] + np.diff(arcs)[:, None] * (np.arange(CHORDS) / CHORDS)
        self._arcs = np.unique([*inner.ravel(), arcs[-1], *np.clip(own.ravel(), 0.0, arcs[-1])])
        self._middles = 0.5 * (self._arcs[:-1] + self._arcs[1:])
        self._chords = [
            np.flatnonzero((self._middles < low) | (self._middles > high)) for low, high in own
        ]
        self._copies: dict[int, int] = {}
        spec = mujoco.MjSpec()
        for geom in (geom for several in geoms for geom in several):
            self._copies[geom] = len(self._copies)
            _copy_geom(spec, model, geom)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, radius, 0.0])
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)

    def measure(self, data: Any, line: CentreLine, most: Array) -> list[Nearest | None]:
        """For each robot the place where the hose's surface is nearest to the geoms in question.

        Args:
            data: the world's.
            line: the hose's centre line.
            most: for each robot, farther than this (m) is not looked for.

        Returns:
            None for a robot where nothing is nearer.
        """
        points = line.position(self._arcs)
        middles, along = 0.5 * (points[:-1] + points[1:]), np.diff(points, axis=0)
        lengths = np.linalg.norm(along, axis=1)
        found: list[Nearest | None] = []
        for i, geoms in enumerate(self._geoms):
            best, nearest = float(most[i]), -1
            for geom in geoms:
                copy, chords = self._place(data, geom), self._chords[i]
                apart = np.linalg.norm(middles[chords] - self._data.geom_xpos[copy], axis=1)
                bound = self._model.geom_rbound[copy] + self._radius
                gaps = apart - 0.5 * lengths[chords] - bound
                for j in np.argsort(gaps):
                    if gaps[j] >= best:
                        break
                    chord = int(chords[j])
                    distance = self._lay(copy, middles[chord], along[chord], lengths[chord], best)
                    if distance < best:
                        best, nearest = distance, chord
            near = nearest >= 0
            arc = float(self._middles[nearest])
            found.append(Nearest(best, arc, middles[nearest].copy()) if near else None)
        return found

    def _place(self, data: Any, geom: int) -> int:
        """Puts the copy of a geom where it is in the world; returns the copy's number."""
        copy = self._copies[geom]
        rotation = data.geom_xmat[geom].reshape(3, 3)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, self._model.geom_quat[copy])
        self._data.geom_xpos[copy] = data.geom_xpos[geom] + rotation @ self._model.geom_pos[copy]
        self._data.geom_xmat[copy] = (rotation @ turn.reshape(3, 3)).ravel()
        return copy

    def _lay(self, copy: int, middle: Array, along: Array, length: float, most: float) -> float:
        """Lays the capsule along a chord; returns its distance from a copy, at most `most`."""
        quaternion, matrix = np.zeros(4), np.zeros(9)
        mujoco.mju_quatZ2Vec(quaternion, along)
        mujoco.mju_quat2Mat(matrix, quaternion)
        self._data.geom_xpos[-1], self._data.geom_xmat[-1] = middle, matrix
        self._model.geom_size[-1, 1] = 0.5 * length
        capsule = self._model.ngeom - 1
        return float(mujoco.mj_geomDistance(self._model, self._data, copy, capsule, most, None))


def _copy_geom(spec: Any, model: Any, geom: int) -> None:
    """Adds a geom of the world's model; a mesh's own frame is found anew at compilation."""
    kind = mujoco.mjtGeom(model.geom_type[geom])
    if kind != mujoco.mjtGeom.mjGEOM_MESH:
        spec.worldbody.add_geom(type=kind, size=model.geom_size[geom])
        return
    mesh = model.geom_dataid[geom]
    points, faces = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    name = f"mesh {geom}"
    spec.add_mesh(
        name=name,
        uservert=model.mesh_vert[points : points + model.mesh_vertnum[mesh]].ravel(),
        userface=model.mesh_face[faces : faces + model.mesh_facenum[mesh]].ravel(),
    )
    spec.worldbody.add_geom(type=kind, meshname=name)
