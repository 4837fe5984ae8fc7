"""`GedsContact`: contact between a spline hose and the geoms of a scene, both ways.

The hose takes contact implicitly, with geoms where they are at the beginning of the step. What it
does to bodies that can move acts on them in the next step, so that momentum is kept but for that
delay. Meshes and ellipsoids are geoms that only MuJoCo can measure (`GeomMeter`).
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.protocol import Array
from hose_mj.world.scene_geoms import SceneGeoms

_REACH = 2.0  # meshes nearer than so many radii of the hose are measured
PROBE = "hose_mj_probe"
"""Name of a geom, a small sphere that touches nothing, which stands for a point of the hose."""
_PROBE_RADIUS = 1e-4  # small beside a hose (m); taken off the distances that MuJoCo finds


class GedsContact:
    """Hands a scene's geoms to a spline hose as obstacles, and what it does to them to MuJoCo.

    Poses are as at the start. `geoms` are what may be touched; `pushes` is what the hose has done
    in the last step to each of `geoms.moving`, force and moment about the geom's position, (k, 6),
    N, N m.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        hose: GedsHose,
        sites: np.ndarray,
        arc_lengths: Array,
    ) -> None:
        self._model, self._data, self._hose = model, data, hose
        self.geoms = SceneGeoms.find(model, data, sites, arc_lengths)
        self.pushes = np.zeros((len(self.geoms.moving), 6))
        self._moving = self.geoms.ids[self.geoms.moving]
        self._meter = None
        self._measured = Distances.none(len(hose.contacts.arc_lengths))
        self._measured_forces = np.zeros((len(hose.contacts.arc_lengths), 3))
        if len(self.geoms.measured):
            reach = _REACH * hose.spec.outer_radius
            low, high = self.geoms.measured_skips.T[:, :, None]
            s = hose.contacts.arc_lengths
            touched = (s < low) | (s > high)
            self._meter = GeomMeter(model, self.geoms.measured, touched, reach)

    def set_obstacles(self, friction: float) -> None:
        """Hands the geoms to the hose as obstacles, where they are now."""
        self._friction = friction
        stiffness = self._hose.contacts.compute_stiffness()
        made = self.geoms.make_obstacles(self._model, self._data, friction, stiffness)
        self._hose.set_obstacles(made)

    def reset(self) -> None:
        """Forgets the last step; the geoms are where they are now."""
        self.pushes[:], self._measured_forces[:] = 0.0, 0.0
        self.place()

    def snapshot(self) -> dict[str, Array]:
        """Returns what the next step depends on beyond the hose and MuJoCo's state."""
        return {
            "pushes": self.pushes.copy(),
            "measured_forces": self._measured_forces.copy(),
            "nearest": self._measured.geoms.copy(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Returns to a snapshot; MuJoCo's poses are back already."""
        self.pushes[:] = state["pushes"]
        self._measured_forces[:] = state["measured_forces"]
        self._measured = self._measured._replace(geoms=state["nearest"].copy())
        self.place()

    def place(self) -> None:
        """Moves the obstacles to where their geoms are."""
        if not len(self._moving):
            return
        data, k = self._data, len(self._moving)
        mujoco.mj_comVel(self._model, data)
        twists = self._find_twists(self._moving)
        rotations = data.geom_xmat[self._moving].reshape(k, 3, 3)
        moving = self.geoms.moving
        self._hose.contacts.place_obstacles(moving, data.geom_xpos[self._moving], rotations, twists)

    def measure(self) -> None:
        """Measures meshes; to be called before each step."""
        if self._meter is None:
            return
        hose = self._hose
        points = hose.position(hose.contacts.arc_lengths)
        found = self._measured = self._meter.measure(self._data, points)
        speeds = np.zeros_like(points)
        near = np.unique(found.geoms[found.geoms >= 0])
        for g, twist in zip(near, self._find_twists(near), strict=True):
            mine = found.geoms == g
            speeds[mine] = twist[:3] + np.cross(twist[3:], points[mine] - self._data.geom_xpos[g])
        hose.contacts.set_distances(found.distances, found.normals, self._friction, speeds)

    def _find_twists(self, geoms: np.ndarray) -> Array:
        """Velocities and angular velocities of geoms (k,), (k, 6); `mj_comVel` goes before."""
        model, data = self._model, self._data
        bodies = model.geom_bodyid[geoms]
        spins = data.cvel[bodies, :3]
        # MuJoCo's velocities are those of the material at the tree's centre of mass.
        arms = data.geom_xpos[geoms] - data.subtree_com[model.body_rootid[bodies]]
        return np.concatenate([data.cvel[bodies, 3:] + np.cross(spins, arms), spins], axis=1)

    def update(self) -> None:
        """After a step: what the hose did to geoms, where it felt them, is known; they move on."""
        if self._meter is not None:
            self._measured_forces[:] = self._hose.contacts.compute_given_forces()
        if not len(self._moving):
            return
        self.pushes[:] = self._hose.contacts.compute_reactions()[self.geoms.moving]
        self.place()

    def push(self, generalized: Array) -> None:
        """Adds what the hose did to moving geoms in the last step to generalised forces (nv,)."""
        for k in np.flatnonzero(self.pushes.any(axis=1)):
            row, g = self.pushes[k], self._moving[k]
            mujoco.mj_applyFT(
                *(self._model, self._data, row[:3], row[3:], self._data.geom_xpos[g]),
                *(self._model.geom_bodyid[g], generalized),
            )
        points = None
        for q in np.flatnonzero(self._measured_forces.any(axis=1)):
            body = self._model.geom_bodyid[self._measured.geoms[q]]
            if self._measured.geoms[q] < 0 or self._model.body_weldid[body] == 0:
                continue
            if points is None:
                points = self._hose.position(self._hose.contacts.arc_lengths)
            force = -self._measured_forces[q]
            mujoco.mj_applyFT(
                *(self._model, self._data, force, np.zeros(3), points[q], body, generalized)
            )


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
        size=[_PROBE_RADIUS, 0.0, 0.0],
        contype=0,
        conaffinity=0,
        group=5,
        rgba=[0.0, 0.0, 0.0, 0.0],
    )


class GeomMeter:
    """Measures points against some geoms (M,) of a model that has the geom of `add_probe`.

    `touched` (M, Q) says whether each geom counts at each of the points; beyond `reach` (m) nothing
    is measured.
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
                if found + _PROBE_RADIUS >= distances[q]:
                    continue
                arrow = ends[3:] - ends[:3]
                length = float(np.linalg.norm(arrow))
                if length > 0.0:
                    normals[q] = arrow / length * np.sign(found)
                distances[q], nearest[q] = found + _PROBE_RADIUS, g
        return Distances(distances, normals, nearest)
