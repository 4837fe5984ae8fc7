"""Distances of a hose from geoms that only MuJoCo can measure: meshes, ellipsoids."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from hose_mj.hoses.protocol import Array

PROBE = "hose_mj_probe"
"""Name of a geom, a small sphere that touches nothing, which stands for a point of the hose."""
_RADIUS = 1e-4


class Distances(NamedTuple):
    """Signed distances (Q,), m; outward normals (Q, 3); the nearest geoms (Q,), -1 for none."""

    distances: Array
    normals: Array
    geoms: np.ndarray

    @classmethod
    def none(cls, count: int) -> Distances:
        """Nothing is near any of the points."""
        return cls(np.full(count, np.inf), np.zeros((count, 3)), np.full(count, -1))


def add_probe(spec: mujoco.MjSpec) -> None:
    """Adds the geom that stands for a point of the hose."""
    spec.worldbody.add_geom(
        name=PROBE,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[_RADIUS, 0.0, 0.0],
        contype=0,
        conaffinity=0,
        group=5,
        rgba=[0.0, 0.0, 0.0, 0.0],
    )


class GeomMeter:
    """Measures points against some geoms of a model.

    Args:
        model: with the geom of `add_probe`.
        geoms: ids, (M,).
        touched: whether each geom counts at each of the points, (M, Q).
        reach: beyond this distance nothing is measured (m).
    """

    def __init__(
        self, model: mujoco.MjModel, geoms: np.ndarray, touched: np.ndarray, reach: float
    ) -> None:
        self._model, self._geoms, self._reach = model, geoms, reach
        self._touched = touched
        self._scratch = mujoco.MjData(model)
        self._probe = model.geom(PROBE).id

    def measure(self, data: mujoco.MjData, points: Array) -> Distances:
        """Distances of points (Q, 3), m, from the nearest of the geoms; `reach` where none is near.

        Poses are those in `data`.
        """
        scratch, model = self._scratch, self._model
        scratch.geom_xpos[:], scratch.geom_xmat[:] = data.geom_xpos, data.geom_xmat
        distances = np.full(len(points), self._reach)
        normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
        nearest = np.full(len(points), -1)
        ends = np.zeros(6)
        for g, touched in zip(self._geoms, self._touched, strict=True):
            away = np.linalg.norm(points - data.geom_xpos[g], axis=1)
            for q in np.flatnonzero(touched & (away < model.geom_rbound[g] + self._reach)):
                scratch.geom_xpos[self._probe] = points[q]
                found = mujoco.mj_geomDistance(
                    model, scratch, int(g), self._probe, float(distances[q]), ends
                )
                if found + _RADIUS >= distances[q]:
                    continue
                arrow = ends[3:] - ends[:3]
                length = float(np.linalg.norm(arrow))
                if length > 0.0:
                    normals[q] = arrow / length * np.sign(found)
                distances[q], nearest[q] = found + _RADIUS, g
        return Distances(distances, normals, nearest)
