"""A hose in MuJoCo's own pictures, coloured by tension: in a viewer, or an episode as a film."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from hose_mj.errors import HoseError, InputError
from hose_mj.extras import require
from hose_mj.hoses.protocol import Array
from hose_mj.recording.files import make_temp_beside, replace_atomically
from hose_mj.recording.palette import color_tension
from hose_mj.recording.world_episode import WorldEpisode
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.world.world import World

CAMERA = "overview"
_MOST_SAMPLES = 4  # per pixel: more takes long where there is no graphics card
_CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
_BREAK_COLOR = (1.0, 0.15, 0.2, 1.0)


def write_mp4(
    path: Path,
    episode: WorldEpisode,
    scene: Scene,
    *,
    size: tuple[int, int] = (960, 720),
    fps: int = 30,
    camera: str | None = None,
) -> None:
    """Films an episode in real time, seen by a camera of the scene.

    Args:
        path: replaced when the film is complete.
        episode: what happened.
        scene: where; the one that the episode was recorded in.
        size: width and height in pixels, multiples of 16.
        fps: frames a second.
        camera: name; by default "overview" if the scene has it, else one that sees all.

    Raises:
        InputError: a size or rate out of range, or no such camera.
        MissingExtra: the extra `video` is not installed.
        HoseError: no OpenGL context can be had.
    """
    if any(part % 16 or part <= 0 for part in size):
        raise InputError("size", size, "width and height, multiples of 16")
    if not 1 <= fps <= 120:
        raise InputError("fps", fps, "1 to 120")
    require("imageio_ffmpeg", "rendering films")
    import imageio_ffmpeg

    temp = make_temp_beside(Path(path))
    try:
        frames = render_frames(episode, scene, size, fps, camera)
        film = imageio_ffmpeg.write_frames(
            str(temp), size, fps=fps, codec="libx264", quality=7, output_params=["-f", "mp4"]
        )
        film.send(None)
        for frame in frames:
            film.send(np.ascontiguousarray(frame))
        film.close()
        replace_atomically(temp, Path(path))
    finally:
        temp.unlink(missing_ok=True)


def render_frames(
    episode: WorldEpisode, scene: Scene, size: tuple[int, int], fps: int, camera: str | None = None
) -> Iterator[NDArray[np.uint8]]:
    """Yields pictures (height, width, 3) of an episode, evenly spaced in time."""
    times = episode.samples.times
    model = scene.make_spec().compile()
    model.vis.global_.offwidth = max(model.vis.global_.offwidth, size[0])
    model.vis.global_.offheight = max(model.vis.global_.offheight, size[1])
    model.vis.quality.offsamples = min(model.vis.quality.offsamples, _MOST_SAMPLES)
    view = choose_camera(model, camera)
    n_frames = max(2, 1 + round((times[-1] - times[0]) * fps))
    chosen = np.searchsorted(times, np.linspace(times[0], times[-1], n_frames) - 1e-9)
    bodies = PosedBodies(model, episode)
    try:
        renderer = mujoco.Renderer(model, size[1], size[0], max_geom=20_000)
    except Exception as error:  # each OpenGL backend has its own kinds
        remedy = "without a display set MUJOCO_GL=egl or MUJOCO_GL=osmesa"
        raise HoseError(f"MuJoCo cannot draw here ({error}); {remedy}") from error
    with renderer:
        for k in np.minimum(chosen, len(times) - 1):
            bodies.pose(int(k))
            renderer.update_scene(bodies.data, camera=view)
            bodies.draw_hose(renderer.scene, int(k))
            yield np.asarray(renderer.render(), dtype=np.uint8)


def choose_camera(model: mujoco.MjModel, camera: str | None) -> Any:
    """Returns a camera's name or number; `InputError` if the scene has no camera of that name."""
    names = [model.camera(i).name for i in range(model.ncam)]
    if camera is None:
        return CAMERA if CAMERA in names else -1
    if camera not in names:
        raise InputError("camera", camera, f"one of {', '.join(names)}" if names else "none")
    return camera


class PosedBodies:
    """Puts a scene's bodies where a sample of an episode has them, without simulating anything.

    The model is the scene's, without a hose; `data` holds the poses.
    """

    def __init__(self, model: mujoco.MjModel, episode: WorldEpisode) -> None:
        self.data = mujoco.MjData(model)
        mujoco.mj_forward(model, self.data)
        self._model, self._episode = model, episode
        self._numbers = [model.body(name).id for name in episode.scene.bodies]

    def pose(self, k: int) -> None:
        """Moves the bodies to where they were in sample k, with all that is fixed to them."""
        model, data, rows = self._model, self.data, self._episode.samples.rows
        data.xpos[self._numbers] = rows["positions"][k]
        data.xquat[self._numbers] = rows["quaternions"][k]
        turn, moved = np.zeros(9), np.zeros(3)
        for geom in range(model.ngeom):
            body = model.geom_bodyid[geom]
            if body in self._numbers:
                quaternion = np.zeros(4)
                mujoco.mju_mulQuat(quaternion, data.xquat[body], model.geom_quat[geom])
                mujoco.mju_quat2Mat(turn, quaternion)
                mujoco.mju_rotVecQuat(moved, model.geom_pos[geom], data.xquat[body])
                data.geom_xpos[geom] = data.xpos[body] + moved
                data.geom_xmat[geom] = turn

    def draw_hose(self, scene: mujoco.MjvScene, k: int) -> None:
        """Adds the hose of sample k to a picture, and the break once it has happened."""
        episode, rows = self._episode, self._episode.samples.rows
        shown, points = episode.scene, rows["hose"][k].astype(np.float64)
        middle = 0.5 * (rows["tension"][k][:-1] + rows["tension"][k][1:])
        colors = color_tension(middle, shown.tension_limit) / 255.0
        for start, end, color in zip(points[:-1], points[1:], colors, strict=True):
            add_capsule(scene, (*color, 1.0), shown.hose_radius, start, end)
        mark = episode.ending.mark
        if mark is not None and rows["time"][k] >= mark.time:
            top = mark.place + np.array([0.0, 0.0, 0.16 * shown.size])
            add_capsule(scene, _BREAK_COLOR, 0.005 * shown.size, mark.place, top)
            ball = add_geom(scene, _BREAK_COLOR)
            kind, sizes = mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, 0.014 * shown.size)
            mujoco.mjv_initGeom(ball, kind, sizes, top, np.eye(3).ravel(), ball.rgba.copy())


def add_geom(scene: mujoco.MjvScene, color: tuple[float, ...] | Array) -> mujoco.MjvGeom:
    """Adds a geom of a colour to a picture and returns it; `HoseError` if there are too many."""
    if scene.ngeom >= scene.maxgeom:
        raise HoseError(f"the scene has more than {scene.maxgeom} geoms, too many for a film")
    geom = scene.geoms[scene.ngeom]
    rgba = np.asarray(color, dtype=np.float32)
    mujoco.mjv_initGeom(geom, _CAPSULE, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
    scene.ngeom += 1
    return geom


def add_capsule(
    scene: mujoco.MjvScene,
    color: tuple[float, ...] | Array,
    radius: float,
    start: Array,
    end: Array,
) -> None:
    """Adds a capsule between two points (3,), m; `HoseError` if there are too many geoms."""
    mujoco.mjv_connector(add_geom(scene, color), _CAPSULE, radius, start, end)


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
    points = world.hose_position(arcs)
    colors = color_pieces(world, arcs, limit)
    n = int(min(n_pieces, scn.maxgeom - scn.ngeom))
    for k in range(n):
        add_capsule(scn, colors[k], world.scene.spec.outer_radius, points[k], points[k + 1])
    return n


def color_pieces(world: World, arcs: Array, limit: float) -> npt.NDArray[np.float32]:
    """Red, green, blue, opacity from 0 to 1, float32 (k, 4), of the pieces between arc lengths."""
    middles = 0.5 * (arcs[1:] + arcs[:-1])
    colors = np.ones((len(middles), 4), np.float32)
    colors[:, :3] = color_tension(world.tension(middles), limit) / 255.0
    return colors
