"""Logs what of an episode in a world stands still, and lays out what the viewer shows of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hose_mj.recording.episode import Array
from hose_mj.recording.palette import Rgb, make_tension_scale, mix
from hose_mj.recording.rerun import parts
from hose_mj.recording.scene_description import WORLD, Geom, Rgba, SceneDescription

SCENE = "world/scene"
SCALE = "tension"
GOAL_COLOR = (60, 200, 110)
TINTS: tuple[Rgb, ...] = ((255, 255, 255), (0, 190, 170), (225, 110, 200), (110, 150, 255))
"""Colours of the overlaid episodes from the second on: none is near one of the tension."""
BOUNDS_COLOR = (150, 165, 185)
CELL_COLOR = (120, 132, 148)
_LONGEST_ARROW = 0.3  # largest length of an arrow over the scene's size: longer ones are cut
_PLANE_THICKNESS = 0.004
"""Thickness, over the scene's size, of the thin box whose top stands for a plane."""
_LOOKS = {True: (0.25, -0.8, 0.95), False: (0.45, -1.0, 0.5)}
"""Where the eye is, seen from the middle of a flat scene or of a high one."""


@dataclass(frozen=True)
class Look:
    """The look that tells one of several overlaid episodes apart."""

    rank: int  # 0 for the first, in the scene's own colours; the others are tinted and see-through

    @property
    def color(self) -> Rgb:
        """Returns the colour of the tint."""
        return TINTS[self.rank % len(TINTS)]

    def tint(self, color: Rgba) -> Rgba:
        """Returns the colour to draw a robot's geom in."""
        if not self.rank:
            return color
        return (*mix(color[:3], self.color, 0.65), round(0.45 * color[3]))


def path_of(scene: SceneDescription, *names: str) -> str:
    """Returns the entity path of what belongs to one episode's part of the world."""
    return "/".join(["world", *map(rr.escape_entity_path_part, (scene.name, *names))])


def log_scene(stream: rr.RecordingStream, scene: SceneDescription) -> None:
    """Logs what stands still, once for all overlaid episodes."""
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for geom in scene.geoms:
        if geom.body == WORLD:
            path = f"{SCENE}/{rr.escape_entity_path_part(geom.name)}"
            stream.log(path, make_shape(geom, scene, geom.color), static=True)
    stream.log(f"{SCENE}/goal", make_shape(scene.goal, scene, scene.goal.color), static=True)
    style: Any = {"radii": 0.0, "colors": [GOAL_COLOR], "show_labels": True}
    label = rr.Points3D([scene.goal.position], labels=["goal"], **style)
    stream.log(f"{SCENE}/goal/label", label, static=True)
    _log_bounds(stream, scene)
    _log_cells(stream, scene)
    _log_scale(stream, scene)


def log_robots(stream: rr.RecordingStream, scene: SceneDescription, look: Look) -> None:
    """Logs the shapes of the bodies that move, under the entities that their poses go to."""
    for geom in scene.geoms:
        if geom.body != WORLD:
            path = path_of(scene, "robots", scene.bodies[geom.body], geom.name)
            stream.log(path, make_shape(geom, scene, look.tint(geom.color)), static=True)


def log_settings(
    stream: rr.RecordingStream, scenes: Sequence[SceneDescription], endings: Sequence[str] = ()
) -> None:
    """Logs how the episodes ended, their settings and what the picture's colours mean."""
    lines = [f"# {scenes[0].title}", *endings]
    for scene in scenes:
        scale = 10.0 ** np.floor(np.log10(scene.tension_limit))
        shown = {
            "red hose": f"{scene.tension_limit:.4g} N",
            "violet arrow": f"force, {scale * force_scale(scene):.3g} m for {scale:g} N",
            "longest arrow": f"from {_LONGEST_ARROW * scene.size / force_scale(scene):.3g} N on",
        }
        lines.append(parts.format_table({"model": scene.name, **scene.settings, **shown}))
    parts.log_document(stream, "settings", "\n\n".join(lines))


def force_scale(scene: SceneDescription) -> float:
    """Returns the length of a force's arrow over the force (m/N)."""
    return 0.15 * scene.size / scene.tension_limit


def scale_forces(scene: SceneDescription, forces: Array) -> Array:
    """Returns the arrows (..., 3), m, of forces (..., 3), N; no longer than the longest shown."""
    arrows = force_scale(scene) * forces
    longest = _LONGEST_ARROW * scene.size
    lengths = np.linalg.norm(arrows, axis=-1, keepdims=True)
    return np.asarray(arrows * np.minimum(1.0, longest / np.maximum(lengths, 1e-12)))


def drawn_radius(scene: SceneDescription) -> float:
    """Returns the radius that the hose is drawn with (m): its own, if that can be seen."""
    return max(scene.hose_radius, 0.003 * scene.size)


def make_shape(geom: Geom, scene: SceneDescription, color: Rgba) -> Any:
    """Returns the archetype of a shape."""
    x, y, z, w = np.roll(geom.quaternion, -1)
    turn: Any = [rr.Quaternion(xyzw=[x, y, z, w])]
    filled: dict[str, Any] = {"colors": [color], "fill_mode": "solid"}
    radius, half = geom.size[0], geom.size[1]
    place: dict[str, Any] = {"centers": [geom.position], "quaternions": turn}
    if geom.kind == "plane":
        # A thin box; it ends where the scene does, if it has no end of its own.
        thin = np.array([0.0, 0.0, 0.5 * _PLANE_THICKNESS * scene.size])
        ends = np.where(geom.size[:2] > 0.0, geom.size[:2], 0.75 * scene.size)
        place["centers"] = [geom.position - rotate(geom.quaternion, thin)]
        return rr.Boxes3D(half_sizes=[[*ends, thin[2]]], **place, **filled)
    if geom.kind == "box":
        return rr.Boxes3D(half_sizes=[geom.size], **place, **filled)
    if geom.kind in ("sphere", "ellipsoid"):
        sizes = [geom.size] if geom.kind == "ellipsoid" else [[radius] * 3]
        return rr.Ellipsoids3D(half_sizes=sizes, **place, **filled)
    if geom.kind == "cylinder":
        return rr.Cylinders3D(lengths=[2.0 * half], radii=[radius], **place, **filled)
    if geom.kind == "capsule":
        start = geom.position - rotate(geom.quaternion, np.array([0.0, 0.0, half]))
        place = {"translations": [start], "quaternions": turn}
        return rr.Capsules3D(lengths=[2.0 * half], radii=[radius], **place, **filled)
    return _make_mesh(geom, color)


def _make_mesh(geom: Geom, color: Rgba) -> rr.Mesh3D:
    assert geom.vertices is not None
    assert geom.faces is not None
    vertices = geom.position + rotate(geom.quaternion, geom.vertices)
    corners = vertices[geom.faces.astype(int)]  # flat faces: each triangle has its own vertices
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    return rr.Mesh3D(
        vertex_positions=corners.reshape(-1, 3),
        vertex_normals=np.repeat(normals, 3, axis=0),
        albedo_factor=color,
    )


def rotate(quaternion: Array, vectors: Array) -> Array:
    """Turns vectors (..., 3) by a unit quaternion w, x, y, z."""
    w, axis = quaternion[0], quaternion[1:]
    crossed = np.cross(axis, vectors)
    return np.asarray(vectors + 2.0 * (w * crossed + np.cross(axis, crossed)))


def _log_bounds(stream: rr.RecordingStream, scene: SceneDescription) -> None:
    """Logs a rectangle where there is no bound upwards, a box where there is one."""
    finite = np.isfinite(scene.bounds)
    if not finite[:, :2].all():
        return
    low, high = scene.bounds
    lift = 0.002 * scene.size
    levels = scene.bounds[:, 2] if finite[:, 2].all() else np.array([scene.ground + lift])
    ring = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    rings = [np.column_stack([np.vstack([ring, ring[:1]]), np.full(5, z)]) for z in levels]
    posts = [[[*corner, levels[0]], [*corner, levels[-1]]] for corner in ring]
    strips: list[Any] = [*rings, *(posts if len(levels) > 1 else ())]
    lines = rr.LineStrips3D(strips, colors=[BOUNDS_COLOR], radii=[0.0015 * scene.size])
    stream.log(f"{SCENE}/bounds", lines, static=True)


def _log_cells(stream: rr.RecordingStream, scene: SceneDescription) -> None:
    """Logs the cells of the ground, centred on the source, as far as the bounds reach."""
    low, high = scene.bounds[:, :2]
    if not (scene.cell and np.all(np.isfinite(scene.bounds[:, :2]))):
        return
    z = scene.ground + 0.001 * scene.size
    strips = []
    for axis in (0, 1):
        first = scene.source[axis] + scene.cell * (
            0.5 + np.ceil((low[axis] - scene.source[axis]) / scene.cell - 0.5 - 1e-9)
        )
        for place in np.arange(first, high[axis] + 1e-9, scene.cell):
            ends = np.array([[*low, z], [*high, z]])
            ends[:, axis] = place
            strips.append(ends)
    lines = rr.LineStrips3D(strips, colors=[CELL_COLOR], radii=[0.0006 * scene.size])
    stream.log(f"{SCENE}/cells", lines, static=True)


def _log_scale(stream: rr.RecordingStream, scene: SceneDescription) -> None:
    """Logs a bar of the colours with tensions below it; the view counts rows down."""
    colors, tensions = make_tension_scale(scene.tension_limit)
    height, width = 10, len(colors)
    stream.log(SCALE, rr.Image(np.repeat(colors[None], height, axis=0)), static=True)
    low, high = tensions[0], tensions[-1]
    places = width * (tensions - low) / (high - low)
    labels = [f"{tension:.3g} N" for tension in tensions]
    below = np.column_stack([places, np.full(len(places), height + 7.0)])
    style: Any = {"radii": 0.0, "colors": [(200, 206, 214)], "show_labels": True}
    ticks = rr.Points2D(below, labels=labels, **style)
    stream.log(f"{SCALE}/ticks", ticks, static=True)


def make_world_blueprint(scenes: Sequence[SceneDescription], follow: bool = False) -> rrb.Blueprint:
    """Lays out one or more overlaid episodes.

    Args:
        scenes: the first one's scene is shown.
        follow: keep up with a run that goes on, instead of playing from the start.
    """
    scene = scenes[0]
    contents = ["/world/**"]
    unnamed = [*contents, *(f"- /{path_of(one, 'names')}" for one in scenes)]
    hidden = {
        f"/{path_of(one, 'control_points')}": rrb.EntityBehavior(visible=False)
        for one in scenes
        if one.n_control_points
    }
    shared: Any = {"origin": "/world", "overrides": hidden}
    ground = scene.low[2] - 0.01 * scene.size
    grid = (parts.round_spacing(0.1 * scene.size), np.array([0.0, 0.0, 1.0]), ground)
    views = rrb.Horizontal(
        parts.make_space_view("In space", _place_eye(scene), grid, contents=contents, **shared),
        parts.make_space_view("From above", _place_top(scene), grid, contents=unnamed, **shared),
        column_shares=[1.35, 1.0],
    )
    left = rrb.Vertical(views, _make_scale(scene), _make_plots(scenes), row_shares=[3.4, 0.5, 1.5])
    # Time, level and text: whose entity it is says little.
    columns = rrb.TextLogColumns(
        timeline_columns=[parts.TIMELINE], text_log_columns=["LogLevel", "Body"]
    )
    side = rrb.Vertical(
        rrb.TextDocumentView(origin="/settings", name="Settings"),
        rrb.StateTimelineView(origin="/states", name="Turns, vetoes, breaks"),
        rrb.TextLogView(origin="/log", name="Events", columns=columns),
        row_shares=[1.6, 1.0, 1.0],
    )
    both = rrb.Horizontal(left, side, column_shares=[3.4, 1.0])
    return parts.make_blueprint(both, follow)


def _place_eye(scene: SceneDescription) -> tuple[Array, Array, Array]:
    """Looks from above at an angle, the whole scene in view: eye, target, up, (3,) each."""
    middle = 0.5 * (scene.low + scene.high)
    outward = np.array(_LOOKS[scene.is_planar])
    outward /= np.linalg.norm(outward)
    radius = 0.5 * float(np.linalg.norm(scene.high - scene.low))
    return middle + radius / parts.HALF_VIEW * outward, middle, np.array([0.0, 0.0, 1.0])


def _place_top(scene: SceneDescription) -> tuple[Array, Array, Array]:
    """Looks straight down, x to the right and y upwards."""
    middle = 0.5 * (scene.low + scene.high)
    room = np.max((scene.high - scene.low)[:2]) / 2.0
    height = np.array([0.0, 0.0, scene.high[2] - middle[2] + 1.12 * room / parts.HALF_VIEW])
    return middle + height, middle, np.array([0.0, 1.0, 0.0])


def _make_scale(scene: SceneDescription) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=f"/{SCALE}",
        name=f"Tension of the hose: red at its limit, {scene.tension_limit:.3g} N",
        background=rrb.Background(color=parts.DARK),
        visual_bounds=rrb.VisualBounds2D(x_range=[-30, 430], y_range=[-5, 31]),
    )


def _make_plots(scenes: Sequence[SceneDescription]) -> rrb.Horizontal:
    """Returns one plot for each unit of the margins, and the reward."""
    names = [rr.escape_entity_path_part(scene.name) for scene in scenes]
    units = dict.fromkeys(margin.unit for scene in scenes for margin in scene.margins)
    plots = [
        rrb.TimeSeriesView(
            origin="/plots",
            name=f"Margins: {parts.name_quantity(unit)}, broken below 0",
            contents=[f"/plots/{name}/{unit}/**" for name in names],
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=True),
        )
        for unit in units
    ]
    reward = rrb.TimeSeriesView(
        origin="/plots",
        name="Reward",
        contents=[f"/plots/{name}/reward" for name in names],
        plot_legend=rrb.PlotLegend(visible=len(scenes) > 1),
    )
    return rrb.Horizontal(*plots, reward, column_shares=[1.4] * len(plots) + [1.0])
