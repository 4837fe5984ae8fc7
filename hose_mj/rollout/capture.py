"""`Capture`: watches an episode in a world and hands what it sees to sinks.

`describe_scene` says what there is to see: the scene's geoms with their colours, what moves, what
is watched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import mujoco
import numpy as np
from scipy.interpolate import BSpline

from hose_mj.constraints.kinds import KINDS
from hose_mj.hoses.geds.basis import DEGREE, make_knots
from hose_mj.hoses.protocol import Array
from hose_mj.recording import scene_description, world_episode
from hose_mj.recording.scene_description import WORLD, Geom, SceneDescription
from hose_mj.recording.sinks import Sink
from hose_mj.recording.world_episode import EpisodeEnding, SampleBuffer
from hose_mj.world.scene_geoms import KIND_NAMES
from hose_mj.world.world import World

KIND_STYLES = tuple(scene_description.KindStyle(kind.name, kind.unit, kind.color) for kind in KINDS)
N_POINTS = 81  # points along the hose that are recorded
_SHOWN_GROUPS = 3  # MuJoCo's viewer shows geoms and sites of groups 0, 1 and 2
_ELLIPSOID, _MESH = int(mujoco.mjtGeom.mjGEOM_ELLIPSOID), int(mujoco.mjtGeom.mjGEOM_MESH)
_KINDS = {**KIND_NAMES, _ELLIPSOID: "ellipsoid", _MESH: "mesh"}


class SceneBodies:
    """The scene's bodies among those of a world, where `cable` and `flex` hoses have theirs too.

    `model` is the scene's own mjModel, without a hose, `data` has the poses of the world's bodies
    at its start, and `bodies` (B,) are the ids in the world's model of those that move and are
    seen.
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
        is_mesh = model.geom_type[i] == _MESH
        vertices, faces = read_mesh(model, int(model.geom_dataid[i])) if is_mesh else (None, None)
        return Geom(
            name=model.geom(i).name or f"{model.body(body).name} geom {i}",
            kind=_KINDS[int(model.geom_type[i])],
            size=model.geom_size[i],
            color=find_color(model, i),
            body=number,
            position=position,
            quaternion=quaternion,
            vertices=vertices,
            faces=faces,
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


def describe_scene(
    world: World, monitor: Any | None, settings: Mapping[str, Any], n_points: int = N_POINTS
) -> tuple[SceneDescription, SceneBodies]:
    """Describes the scene of a world as it stands now, after its reset.

    The monitor is a `hose_mj.constraints.monitor.Monitor`, None where nothing is watched; settings
    are shown beside the pictures, and `n_points` along the hose are to be recorded.
    """
    bodies, scene = SceneBodies(world), world.scene
    geoms = tuple(bodies.make_geom(i) for i in bodies.list_geoms())
    low, high = find_space(world, geoms)
    description = SceneDescription(
        name=world.hose_model,
        title=f"{scene.path.stem}, {world.hose_model}",
        geoms=geoms,
        bodies=bodies.names,
        robots=tuple(robot.name for robot in scene.robots),
        goal=bodies.make_goal(scene.goal.site),
        arc_lengths=np.linspace(0.0, scene.spec.length, n_points),
        hose_radius=scene.spec.outer_radius,
        tension_limit=compute_tension_limit(world, monitor),
        margins=list_margins(monitor),
        kinds=KIND_STYLES,
        n_control_points=len(read_control_points(world)),
        low=low,
        high=high,
        bounds=np.array(scene.bounds),
        source=world.site_positions()[-1],
        settings={name: str(value) for name, value in settings.items()},
        cell=float(getattr(scene, "cell_size", scene.spec.length / 16.0)),
    )
    return description, bodies


def read_control_points(world: World) -> Array:
    """Returns the control points of a spline hose, or the nodes of a chain, (C, 3), m."""
    if world.hose_model == "geds":
        return np.asarray(cast(Any, world).hose.control_points)
    return world.hose_position(world.centre_line().arc_lengths)


class HoseReader:
    """Reads where the hose is, at the same rising arc lengths (P,), m, again and again.

    A spline hose is linear in its control points: a product replaces the search of its basis.
    """

    def __init__(self, world: World, arc_lengths: Array) -> None:
        self._arc_lengths = arc_lengths
        self._basis: Array | None = None
        if world.hose_model == "geds":
            knots = make_knots(len(read_control_points(world)), world.scene.spec.length)
            self._basis = BSpline.design_matrix(arc_lengths, knots, DEGREE).toarray()

    def read(self, world: World) -> tuple[Array, Array]:
        """Returns control points (C, 3) and places at the arc lengths (P, 3), m."""
        points = read_control_points(world)
        if self._basis is not None:
            return points, self._basis @ points
        return points, world.hose_position(self._arc_lengths)


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


def compute_tension_limit(world: World, monitor: Any | None) -> float:
    """Returns the tension (N) at which a segment counts as stretched too far."""
    if monitor is None:
        return 0.002 * world.scene.spec.axial_stiffness
    gravity = float(np.linalg.norm(world.model.opt.gravity))
    return float(monitor.limits.compute_tension_limit(world.scene.spec, gravity))


def list_margins(monitor: Any | None) -> tuple[scene_description.Margin, ...]:
    """Returns what a monitor measures."""
    if monitor is None:
        return ()
    parts = zip(monitor.names, monitor.kinds, monitor.units, monitor.limit_texts, strict=True)
    return tuple(scene_description.Margin(*part) for part in parts)


def place(position: Array, quaternion: Array, origin: Array, turn: Array) -> None:
    """Moves a pose into the frame that its frame is given in, in place."""
    moved, turned = np.zeros(3), np.zeros(4)
    mujoco.mju_rotVecQuat(moved, position, turn)
    mujoco.mju_mulQuat(turned, turn, quaternion)
    position[:], quaternion[:] = origin + moved, turned


def find_color(model: mujoco.MjModel, geom: int) -> scene_description.Rgba:
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


def to_bytes(rgba: Array) -> scene_description.Rgba:
    """Returns a colour of numbers from 0 to 1 as integers from 0 to 255."""
    red, green, blue, opacity = (int(x) for x in np.rint(255.0 * np.clip(rgba, 0.0, 1.0)))
    return red, green, blue, opacity


def read_mesh(model: mujoco.MjModel, mesh: int) -> tuple[Array, Array]:
    """Returns vertices (v, 3) and triangles (f, 3) of a mesh."""
    vertex, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = model.mesh_vert[vertex : vertex + int(model.mesh_vertnum[mesh])]
    faces = model.mesh_face[face : face + int(model.mesh_facenum[mesh])]
    return np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.float64)


CHUNK, LIVE_CHUNK = 512, 12
"""Samples that are handed over at once: to files, and where somebody watches."""


class Capture:
    """An observer of episodes, and a context that ends a recording whatever happens.

    Args:
        sinks: where samples go: files, live viewers; see `hose_mj.recording`.
        keep: whether to keep the whole episode as well, see `episode`.

    Attributes:
        scene: of the running episode.
    """

    def __init__(self, sinks: Sequence[Sink] = (), keep: bool = False) -> None:
        self._sinks, self._keep = tuple(sinks), keep
        self._is_live = any(getattr(sink, "lossy", False) for sink in sinks)
        self.scene: SceneDescription | None = None
        self._bodies: SceneBodies | None = None
        self._reader: HoseReader | None = None
        self._chunk: SampleBuffer | None = None
        self._kept: SampleBuffer | None = None
        self._outcome: EpisodeEnding | None = None

    def start(
        self, world: World, monitor: Any | None, settings: Mapping[str, Any] | None = None
    ) -> None:
        """Begins an episode; nothing is recorded yet but the scene.

        The world is read once for nothing, so that what numba compiles when it is first called is
        compiled before the episode runs.
        """
        self.scene, self._bodies = describe_scene(world, monitor, settings or {})
        self._reader = HoseReader(world, self.scene.arc_lengths)
        self._chunk = SampleBuffer(self.scene, LIVE_CHUNK if self._is_live else CHUNK)
        self._kept = SampleBuffer(self.scene) if self._keep else None
        self._outcome = None
        self._read(world)
        for sink in self._sinks:
            sink.begin(self.scene)

    def sample(
        self, world: World, monitor: Any | None, info: Mapping[str, Any] | None = None
    ) -> None:
        """Records the world as it stands.

        Args:
            world: the one that the episode started with.
            monitor: likewise.
            info: what else is known, all optional: `reward`, `turn` (a number), `owner` (whose turn
                it is), `vetoed` and `events` (names), `margins` (M,), if they have been measured
                at this state already.
        """
        chunk, info = self._chunk, info or {}
        assert chunk is not None, "start() comes first"
        if chunk.is_full:
            self._hand_over()
        margins = info.get("margins")
        if margins is None:
            margins = monitor.measure() if monitor is not None else np.zeros(0)
        numbers = {
            "time": world.time,
            "turn": info.get("turn", world_episode.NO_TURN),
            "reward": info.get("reward", 0.0),
            "margins": margins,
            **self._read(world),
        }
        vetoed, events = ", ".join(info.get("vetoed", ())), ", ".join(info.get("events", ()))
        chunk.append(info.get("owner", "") or "", vetoed, events, **numbers)

    def finish(self, outcome: Any = None) -> None:
        """Ends the episode.

        `outcome` has `ended_by`, a text, and `broken`, a `Break` or None; it is None if the episode
        was stopped.
        """
        if self.scene is None or self._outcome is not None:
            return
        mark = None if outcome is None else make_mark(outcome.broken)
        self._outcome = EpisodeEnding("stopped" if outcome is None else outcome.ended_by, mark)
        self._hand_over()
        for sink in self._sinks:
            sink.end(self._outcome)

    def episode(self) -> world_episode.WorldEpisode:
        """Returns the episode that has ended, where `keep` was asked for and there are samples."""
        assert self._kept is not None, "made with keep=True, and started"
        assert self.scene is not None
        return world_episode.WorldEpisode(
            self.scene, self._kept.copy(), self._outcome or EpisodeEnding("running")
        )

    def __enter__(self) -> Capture:
        return self

    def __exit__(self, *_: object) -> None:
        self.finish()

    def _read(self, world: World) -> dict[str, Array]:
        """Returns what a sample holds of the world as it stands."""
        assert self.scene is not None
        assert self._bodies is not None
        assert self._reader is not None
        control_points, hose = self._reader.read(world)
        return {
            "positions": world.data.xpos[self._bodies.bodies],
            "quaternions": world.data.xquat[self._bodies.bodies],
            "hose": hose,
            "control_points": control_points,
            "tension": world.tension(self.scene.arc_lengths),
            "attachments": world.site_positions(),
            "forces": world.attachment_forces(),
        }

    def _hand_over(self) -> None:
        if self._chunk is None or not len(self._chunk):
            return
        samples = self._chunk.take()
        if self._kept is not None:
            self._kept.extend(samples)
        for sink in self._sinks:
            sink.add(samples)


def make_mark(broken: Any | None) -> world_episode.BreakMark | None:
    """Turns a `Break` into what a recording shows of it."""
    if broken is None:
        return None
    place, text = np.array(broken.place), f"{broken.kind}: {broken.describe()}"
    return world_episode.BreakMark(broken.kind, broken.time, place, text, broken.to_record())
