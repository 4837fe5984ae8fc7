"""Robots as sets of geoms: `Footprint`, what one may hit, and `HoseProbe`, how near the hose is.

`HoseProbe` measures the distances of geoms whose shapes only MuJoCo knows, meshes and ellipsoids.
Where the hose is near, MuJoCo measures the distance to capsules of its radius, laid along chords of
the centre line. The chords miss it by their sagitta, a quarter of a piece's length squared times
its curvature over 8.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from hose_mj.errors import InputError
from hose_mj.hoses.geds.shapes import CAPSULE, CYLINDER, SPHERE
from hose_mj.hoses.protocol import Array
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.world import World

TOUCH, TOUCH_RADII = 2e-3, 0.05
"""A robot stands on what is nearer than this (m), or than this part of its radius."""
STEEPEST = 0.7  # cosine of the steepest ground that a robot stands on: 45 degrees
_ROUNDING = 1e-9
_ELLIPSOID = int(mujoco.mjtGeom.mjGEOM_ELLIPSOID)
_CORNERS: Array = np.array(list(product((-1.0, 1.0), repeat=3)))
CHORDS = 4  # capsules in a piece of the centre line


@dataclass(frozen=True)
class Footprint:
    """What of a robot must not meet hose, robots and obstacles."""

    geoms: NDArray[np.int64]  # numbers of its colliding geoms; all of its geoms where none collides
    radius: float  # of an upright cylinder around them, about the middle of their bounding box (m)
    upright: bool  # whether it is a single cylinder whose axis is and stays vertical: a puck


def make_footprint(world: World, robot: int) -> Footprint:
    """Returns the footprint of a robot as the world stands; `InputError` if it has no geoms."""
    model, data = world.model, world.data
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, world.robot_bodies[robot]))
    if len(geoms) == 0:
        name = world.scene.robots[robot].name
        raise InputError(f"geoms of {name}", 0, "at least one, to know where the robot ends")
    collides = (model.geom_contype[geoms] | model.geom_conaffinity[geoms]) != 0
    collides |= np.isin(geoms, [*model.pair_geom1, *model.pair_geom2])
    geoms = geoms[collides] if collides.any() else geoms
    centers = data.geom_xpos[geoms, :2]
    reaches = np.array([_compute_reach(model, data, int(geom)) for geom in geoms])
    low, high = (centers - reaches[:, None]).min(axis=0), (centers + reaches[:, None]).max(axis=0)
    middle = 0.5 * (low + high)
    radius = float(np.max(np.linalg.norm(centers - middle, axis=1) + reaches))
    return Footprint(geoms, radius, _is_upright(world, robot, geoms))


def find_hose_bodies(world: World) -> NDArray[np.int64]:
    """Numbers of the bodies that a model of the hose added to the scene: their names are new."""
    model, scene = world.model, world.scene.make_spec().compile()
    names = {scene.body(b).name for b in range(scene.nbody)}
    return np.array(
        [b for b in range(1, model.nbody) if model.body(b).name not in names], dtype=int
    )


def find_obstacles(
    world: World, footprints: Sequence[Footprint], ground: Sequence[str]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Returns the geoms that robots may hit, and which geom of a robot may hit which of them.

    A robot's geom may hit what MuJoCo lets it collide with: by their bits, or by an explicit pair,
    unless their bodies are excluded. What is no obstacle: other robots, the hose, what the robot
    stands on (`_stands_on`) in the world as it stands, and the geoms named in `ground`, where a
    name that no geom has raises `InputError`. They are geoms (H,), and a matrix (R, H) for the
    footprints' geoms, one robot after the other.
    """
    model = world.model
    names = [model.geom(g).name for g in range(model.ngeom)]
    for name in ground:
        if name not in names:
            raise InputError("ground", name, "names of the scene's geoms")
    bodies = np.concatenate([*world.robot_bodies, find_hose_bodies(world)])
    others = np.flatnonzero(~np.isin(model.geom_bodyid, bodies) & ~np.isin(names, list(ground)))
    rows = []
    for footprint in footprints:
        allowed = np.array(
            [[_may_collide(model, int(a), int(b)) for b in others] for a in footprint.geoms]
        )
        allowed = allowed.reshape(len(footprint.geoms), len(others))
        for column in np.flatnonzero(allowed.any(axis=0)):
            if _stands_on(world, footprint, int(others[column])):
                allowed[:, column] = False
        rows.append(allowed)
    matrix = np.concatenate(rows)
    met = matrix.any(axis=0)
    return others[met], matrix[:, met]


def _compute_reach(model: Any, data: Any, geom: int) -> float:
    """Bounds how far a geom reaches from its centre across the vertical (m) from above."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind in (SPHERE, _ELLIPSOID):
        return float(size[0] if kind == SPHERE else size.max())
    rotation = data.geom_xmat[geom].reshape(3, 3)
    if kind in (CYLINDER, CAPSULE):
        return float(size[0] + size[1] * np.hypot(rotation[0, 2], rotation[1, 2]))
    corners = model.geom_aabb[geom, :3] + model.geom_aabb[geom, 3:] * _CORNERS
    return float(np.max(np.linalg.norm((corners @ rotation.T)[:, :2], axis=1)))


def _is_upright(world: World, robot: int, geoms: NDArray[np.int64]) -> bool:
    """Says whether a robot is one vertical cylinder that slides, and turns about no other axis."""
    model, data = world.model, world.data
    if len(geoms) > 1 or model.geom_type[geoms[0]] != CYLINDER:
        return False
    joints = np.flatnonzero(np.isin(model.jnt_bodyid, world.robot_bodies[robot]))
    slides = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE
    hinges = model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE
    vertical = np.abs(data.xaxis[joints, 2]) > 1.0 - _ROUNDING
    stands = abs(data.geom_xmat[geoms[0], 8]) > 1.0 - _ROUNDING
    return bool(stands and np.all(slides | (hinges & vertical)))


def _may_collide(model: Any, a: int, b: int) -> bool:
    """MuJoCo's rule for two geoms of bodies that are not joined."""
    pairs = {(int(g), int(h)) for g, h in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    if (a, b) in pairs or (b, a) in pairs:
        return True
    low, high = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
    if (low << 16) + high in model.exclude_signature:
        return False
    bits, own = model.geom_contype, model.geom_conaffinity
    return bool((bits[a] & own[b]) | (bits[b] & own[a]))


def _stands_on(world: World, footprint: Footprint, geom: int) -> bool:
    """Says whether a robot touches a geom, or nearly, and would leave it if it were lifted."""
    model, data = world.model, mujoco.MjData(world.model)
    data.geom_xpos[:], data.geom_xmat[:] = world.data.geom_xpos, world.data.geom_xmat
    touch = max(TOUCH, TOUCH_RADII * footprint.radius)

    def measure() -> float:
        most = 3.0 * touch
        apart = [mujoco.mj_geomDistance(model, data, g, geom, most, None) for g in footprint.geoms]
        return float(min(apart))

    before = measure()
    data.geom_xpos[footprint.geoms, 2] += touch
    return before <= touch and measure() - before > STEEPEST * touch


class Nearest(NamedTuple):
    """Distance of the hose's surface, m; arc length of the chord's middle, m; its place (3,), m."""

    distance: float
    arc_length: float
    place: Array


class HoseProbe:
    """Measures the hose against geoms, in a small mjModel of these and one capsule.

    `geoms` are those of each robot that are to be measured, `own` the arc lengths between which its
    own hose lies (N, 2), m; `radius` is the hose's (m), and `arcs` are the ends of the centre
    line's pieces (K + 1,), m.
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
        """Finds for each robot the place where the hose's surface is nearest to its geoms.

        Farther than `most` (m) is not looked for; None for a robot where nothing is nearer.
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
