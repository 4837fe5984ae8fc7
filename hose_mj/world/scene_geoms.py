"""What of a scene a hose may touch; robots are left out near their own sites.

MuJoCo's rule decides which geoms collide, with contype = conaffinity = 1 for the hose. Planes,
spheres, capsules, cylinders and boxes become `Obstacle`s. Meshes, ellipsoids and what else MuJoCo
can measure the distance of go through `mj_geomDistance` (geds_contact.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.hoses.obstacles import KINDS, Obstacle
from hose_mj.hoses.protocol import Array

KIND_NAMES = {int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")): kind for kind in KINDS}
"""MuJoCo's numbers of the shapes that are obstacles, and their names."""
_LARGEST_KICK = 0.5
"""What the stiffness of a delayed contact times the square of the time step is over a mass."""
OWN_ARC = 3.0
"""Arc on either side of a robot's site where the hose does not touch that robot, in its radii."""


@dataclass(frozen=True)
class SceneGeoms:
    """The geoms of a scene that a hose may touch."""

    ids: np.ndarray  # of those that are obstacles, (G,)
    measured: np.ndarray  # ids of those that MuJoCo measures, (M,)
    moving: np.ndarray  # places in `ids` of those whose bodies can move
    skips: Array  # arc lengths between which each of `ids` is not touched, (G, 2), m
    measured_skips: Array  # the same for `measured`, (M, 2), m

    @classmethod
    def find(
        cls, model: mujoco.MjModel, data: mujoco.MjData, sites: np.ndarray, arc_lengths: Array
    ) -> SceneGeoms:
        """Finds them, with poses at the start in `data`; `sites` as in `World`."""
        touched = find_colliding(model)
        kinds = model.geom_type[touched]
        simple = np.isin(kinds, list(KIND_NAMES))
        skips = np.tile([np.inf, -np.inf], (model.ngeom, 1))
        for site, s in zip(sites[:-1], arc_lengths[:-1], strict=True):
            root = model.body_rootid[model.site_bodyid[site]]
            own = np.flatnonzero(model.body_rootid[model.geom_bodyid] == root)
            arc = OWN_ARC * compute_radius(model, data, site, own)
            skips[own] = [s - arc, s + arc]
        ids = touched[simple]
        bodies = model.geom_bodyid[ids]
        moving = np.flatnonzero(model.body_weldid[bodies] != 0)
        measured = touched[~simple]
        return cls(ids, measured, moving, skips[ids], skips[measured])

    def make_obstacles(
        self, model: mujoco.MjModel, data: mujoco.MjData, friction: float, stiffness: float = 0.0
    ) -> list[Obstacle]:
        """Returns the obstacles at the poses in `data`, at rest, with Coulomb's friction.

        `stiffness` is the force per length and depth that a body is to feel with a delay of one
        step, N/m^2; where it is too light for that, its contact is softer. 0 for no such thing.
        """
        masses = np.zeros(model.nbody)
        np.add.at(masses, model.body_weldid, model.body_mass)
        factors = np.ones(len(self.ids))
        for place in self.moving:
            g = self.ids[place]
            felt = stiffness * 2.0 * model.geom_rbound[g] * model.opt.timestep**2
            mass = masses[model.body_weldid[model.geom_bodyid[g]]]
            if felt > 0.0:
                factors[place] = min(1.0, max(_LARGEST_KICK * mass / felt, 1e-6))
        return [
            Obstacle(
                kind=KIND_NAMES[int(model.geom_type[g])],
                position=data.geom_xpos[g],
                rotation=data.geom_xmat[g],
                size=model.geom_size[g],
                friction=friction,
                skips=(float(skip[0]), float(skip[1])),
                stiffness_factor=float(factor),
            )
            for g, skip, factor in zip(self.ids, self.skips, factors, strict=True)
        ]


def find_colliding(model: mujoco.MjModel) -> np.ndarray:
    """Ids of the geoms that collide with a hose of contype = conaffinity = 1."""
    return np.flatnonzero((model.geom_contype & 1) | (model.geom_conaffinity & 1))


def compute_radius(
    model: mujoco.MjModel, data: mujoco.MjData, site: int, geoms: np.ndarray
) -> float:
    """Largest horizontal distance of colliding geoms of a robot from its site (m).

    Exact for upright cylinders and for spheres, by bounding boxes for others; all of its geoms
    where none collides.
    """
    solid = geoms[(model.geom_contype[geoms] | model.geom_conaffinity[geoms]) != 0]
    if not len(solid):
        solid = geoms
    centre = data.site_xpos[site]
    radius = 0.0
    for g in solid:
        axes = data.geom_xmat[g].reshape(3, 3)
        box = model.geom_aabb[g]
        middle = data.geom_xpos[g] + axes @ box[:3] - centre
        kind, size = model.geom_type[g], model.geom_size[g]
        upright = abs(axes[2, 2]) > 1.0 - 1e-9
        if kind == mujoco.mjtGeom.mjGEOM_SPHERE or (
            kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE) and upright
        ):
            radius = max(radius, float(np.hypot(middle[0], middle[1]) + size[0]))
            continue
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8)
        corners = middle[:, None] + axes @ (box[3:, None] * signs)
        radius = max(radius, float(np.hypot(corners[0], corners[1]).max()))
    return radius
