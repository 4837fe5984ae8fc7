"""Describes the scene of a world: its geoms with their colours, what moves, what is watched."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from scipy.interpolate import BSpline

from hose_mj.hoses.geds.basis import DEGREE, make_knots
from hose_mj.hoses.protocol import Array
from hose_mj.recording.scene_description import WORLD, Geom, Margin, Rgba, SceneDescription
from hose_mj.world.geds_world import GedsWorld
from hose_mj.world.world import World

N_POINTS = 81
"""Points along the hose that are recorded."""
_SHOWN_GROUPS = 3  # MuJoCo's viewer shows geoms and sites of groups 0, 1 and 2
_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_PLANE): "plane",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}


class Cast:
    """The scene's bodies among those of a world, where `cable` and `flex` hoses have theirs too.

    Args:
        world: at its start.

    Attributes:
        model: the scene's own mjModel, without a hose.
        data: its poses, those of the world's bodies.
        bodies: ids in the world's model of the scene's bodies that move and are seen (B,).
    """

    def __init__(self, world: World) -> None:
        self.model = world.scene.make_spec().compile()
        self.data = mujoco.MjData(self.model)
        names = {self.model.body(i).name for i in range(self.model.nbody)}
        every = [i for i in range(world.model.nbody) if world.model.body(i).name in names]
        self.data.xpos[:], self.data.xquat[:] = world.data.xpos[every], world.data.xquat[every]
        shown = {int(self.model.geom_bodyid[geom]) for geom in self.list_geoms()}
        moves = self.model.body_weldid != 0
        self._numbers = [i for i in range(self.model.nbody) if moves[i] and i in shown]
        self.bodies = np.array([every[i] for i in self._numbers], dtype=np.int64)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of `bodies`."""
        return tuple(self.model.body(i).name or f"body {i}" for i in self._numbers)

    def list_geoms(self) -> list[int]:
        """Ids in `model` of the geoms that are seen and have a shape we know."""
        model = self.model
        return [
            i
            for i in range(model.ngeom)
            if model.geom_group[i] < _SHOWN_GROUPS
            and int(model.geom_type[i]) in _KINDS
            and find_color(model, i)[3] > 0
        ]

    def make_geom(self, i: int) -> Geom:
        """Returns a geom in the frame of its body, or in the world's if that does not move."""
        model, body = self.model, int(self.model.geom_bodyid[i])
        position, quaternion = model.geom_pos[i].copy(), model.geom_quat[i].copy()
        number = self._numbers.index(body) if body in self._numbers else WORLD
        if number == WORLD:
            place(position, quaternion, self.data.xpos[body], self.data.xquat[body])
        vertices, faces = read_mesh(model, int(model.geom_dataid[i]))
        is_mesh = model.geom_type[i] == mujoco.mjtGeom.mjGEOM_MESH
        return Geom(
            name=model.geom(i).name or f"{model.body(body).name} geom {i}",
            kind=_KINDS[int(model.geom_type[i])],
            size=model.geom_size[i],
            color=find_color(model, i),
            body=number,
            position=position,
            quaternion=quaternion,
            vertices=vertices if is_mesh else None,
            faces=faces if is_mesh else None,
        )

    def make_goal(self, name: str) -> Geom:
        """Returns the shape of the goal's site, in the world's frame."""
        site = self.model.site(name)
        position, quaternion = site.pos.copy(), site.quat.copy()
        body = int(site.bodyid[0])
        place(position, quaternion, self.data.xpos[body], self.data.xquat[body])
        color = to_bytes(site.rgba)
        if site.matid[0] >= 0:
            color = to_bytes(self.model.mat_rgba[site.matid[0]])
        kind = _KINDS.get(int(site.type[0]), "sphere")
        return Geom("goal", kind, site.size, color, WORLD, position, quaternion)


def make_stage(
    world: World, monitor: Any | None, settings: Mapping[str, Any], n_points: int = N_POINTS
) -> tuple[SceneDescription, Cast]:
    """Describes the scene of a world as it stands now.

    Args:
        world: after its reset.
        monitor: a `hose_mj.constraints.monitor.Monitor`; None where nothing is watched.
        settings: shown beside the pictures.
        n_points: points along the hose that are to be recorded.
    """
    cast, scene = Cast(world), world.scene
    geoms = tuple(cast.make_geom(i) for i in cast.list_geoms())
    low, high = find_space(world, geoms)
    stage = SceneDescription(
        name=world.hose_model,
        title=f"{scene.path.stem}, {world.hose_model}",
        geoms=geoms,
        bodies=cast.names,
        robots=tuple(robot.name for robot in scene.robots),
        goal=cast.make_goal(scene.goal.site),
        arc_lengths=np.linspace(0.0, scene.spec.length, n_points),
        hose_radius=scene.spec.outer_radius,
        tension_limit=find_tension_limit(world, monitor),
        margins=list_margins(monitor),
        n_control_points=len(read_control_points(world)),
        low=low,
        high=high,
        bounds=np.array(scene.bounds),
        source=world.site_positions()[-1],
        settings={name: str(value) for name, value in settings.items()},
        cell=float(getattr(scene, "cell_size", scene.spec.length / 16.0)),
    )
    return stage, cast


def read_control_points(world: World) -> Array:
    """Returns the control points of a spline hose, or the nodes of a chain, (C, 3), m."""
    if isinstance(world, GedsWorld):
        return world.hose.control_points
    return world.position(world.centre_line().arc_lengths)


class HoseReader:
    """Reads where the hose is, at the same arc lengths again and again.

    A spline hose is linear in its control points: a product replaces the search of its basis.

    Args:
        world: whose hose it is.
        arc_lengths: rising (P,), m.
    """

    def __init__(self, world: World, arc_lengths: Array) -> None:
        self._arc_lengths = arc_lengths
        self._basis: Array | None = None
        if isinstance(world, GedsWorld):
            n = len(world.hose.control_points)
            knots = make_knots(n, world.scene.spec.length)
            self._basis = BSpline.design_matrix(arc_lengths, knots, DEGREE).toarray()

    def read(self, world: World) -> tuple[Array, Array]:
        """Returns control points (C, 3) and places at the arc lengths (P, 3), m."""
        points = read_control_points(world)
        if self._basis is not None:
            return points, self._basis @ points
        return points, world.position(self._arc_lengths)


def find_space(world: World, geoms: tuple[Geom, ...]) -> tuple[Array, Array]:
    """Returns the corners of what is worth looking at: geoms but endless planes, hose, bounds."""
    corners = [world.site_positions(), world.goal_position()[None]]
    for geom in geoms:
        if geom.body == WORLD and geom.kind != "mesh" and (geom.kind != "plane" or geom.size[0]):
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, geom.quaternion)
            reach = np.abs(turn.reshape(3, 3)) @ _half_sizes(geom)
            corners.append(np.stack([geom.position - reach, geom.position + reach]))
    bounds = np.array(world.scene.bounds)
    points = np.concatenate(corners)
    low = np.where(np.isfinite(bounds[0]), np.minimum(points.min(0), bounds[0]), points.min(0))
    high = np.where(np.isfinite(bounds[1]), np.maximum(points.max(0), bounds[1]), points.max(0))
    least = 0.02 * float(np.max(high - low)) + 1e-6
    return low, np.maximum(high, low + least)


def _half_sizes(geom: Geom) -> Array:
    if geom.kind == "plane":
        return np.array([geom.size[0], geom.size[1], 0.0])
    if geom.kind == "sphere":
        return np.full(3, geom.size[0])
    if geom.kind in ("capsule", "cylinder"):
        end = geom.size[0] if geom.kind == "capsule" else 0.0
        return np.array([geom.size[0], geom.size[0], geom.size[1] + end])
    return np.asarray(geom.size)


def find_tension_limit(world: World, monitor: Any | None) -> float:
    """Returns the tension (N) at which a segment counts as stretched too far."""
    if monitor is None:
        return 0.002 * world.scene.spec.axial_stiffness
    gravity = float(np.linalg.norm(world.model.opt.gravity))
    return float(monitor.limits.find_tension(world.scene.spec, gravity))


def list_margins(monitor: Any | None) -> tuple[Margin, ...]:
    """Returns what a monitor measures."""
    if monitor is None:
        return ()
    parts = zip(monitor.names, monitor.kinds, monitor.units, monitor.limit_texts, strict=True)
    return tuple(Margin(*part) for part in parts)


def place(position: Array, quaternion: Array, origin: Array, turn: Array) -> None:
    """Moves a pose into the frame that its frame is given in, in place."""
    moved, turned = np.zeros(3), np.zeros(4)
    mujoco.mju_rotVecQuat(moved, position, turn)
    mujoco.mju_mulQuat(turned, turn, quaternion)
    position[:], quaternion[:] = origin + moved, turned


def find_color(model: mujoco.MjModel, geom: int) -> Rgba:
    """Returns a geom's colour; where a material has a texture, times the texture's mean."""
    material = int(model.geom_matid[geom])
    if material < 0:
        return to_bytes(model.geom_rgba[geom])
    rgba = np.array(model.mat_rgba[material], dtype=np.float64)
    textures = [int(t) for t in model.mat_texid[material] if t >= 0]
    if textures:
        first, n = int(model.tex_adr[textures[0]]), int(model.tex_nchannel[textures[0]])
        size = int(model.tex_height[textures[0]] * model.tex_width[textures[0]] * n)
        texels = model.tex_data[first : first + size].reshape(-1, n)
        rgba[:3] *= texels[:, :3].mean(axis=0) / 255.0
    return to_bytes(rgba)


def to_bytes(rgba: Array) -> Rgba:
    """Returns a colour of numbers from 0 to 1 as integers from 0 to 255."""
    red, green, blue, opacity = (int(x) for x in np.rint(255.0 * np.clip(rgba, 0.0, 1.0)))
    return red, green, blue, opacity


def read_mesh(model: mujoco.MjModel, mesh: int) -> tuple[Array | None, Array | None]:
    """Returns vertices (v, 3) and triangles (f, 3) of a mesh; None, None without one."""
    if mesh < 0:
        return None, None
    vertex, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[mesh])]
    faces = model.mesh_face[face : face + int(model.mesh_facenum[mesh])]
    return np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.float64)
