"""A comparison of hose models as a Rerun recording: one tab per scene, the models overlaid."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hose_mj.errors import InputError
from hose_mj.recording.episode import Array, HoseTrack, Scene, Series, check_unique
from hose_mj.recording.files import write_atomically
from hose_mj.recording.palette import LIMIT, find_color, lighten, name_model
from hose_mj.recording.rerun import parts

_UNITLESS = "number"
_ASPECT = 1.4  # width over height that a view is assumed to have
_THINNER = 0.55
_FLAT = 1e-2  # a scene is planar if it is this much thinner than it is large


@dataclass(frozen=True, eq=False)
class Framing:
    """A view of a scene, in world coordinates (m)."""

    # eye, target, up: the camera, (3,) each.
    eye: Array
    target: Array
    up: Array
    size: float  # largest extent of the scene
    half_height: float  # of what the eye sees at the target's distance
    grid_normal: Array  # of the grid's plane, a unit axis (3,)
    grid_distance: float  # of the grid's plane from the origin, along the normal
    grid_spacing: float  # 1, 2 or 5 times a power of ten, about a tenth of the size
    corner: Array  # upper left of the scene as seen from the eye, where the legend begins
    is_planar: bool  # whether the scene is flat, and seen straight on

    @property
    def eye_up(self) -> Array:
        """Returns the world axis that stays upright when the reader turns the view, (3,)."""
        return np.asarray(np.eye(3)[int(np.argmax(np.abs(self.up)))])

    def clip_radii(self, scene: Scene) -> dict[str, float]:
        """Returns the radius that each track is drawn with (m), by name.

        Thick enough to be seen, and each thinner than the one before it, so that all of a few that
        coincide still show; see `compute_shifts`.
        """
        low, high = 0.006 * self.size, 0.011 * self.size
        return {
            track.name: _THINNER**rank * float(np.clip(track.radius, low, high))
            for rank, track in enumerate(scene.tracks)
        }

    def compute_shifts(self, scene: Scene) -> dict[str, Array]:
        """Returns how far each track is drawn off its place, towards the eye, (3,), by name.

        In planar scenes, seen straight on, each hose lies in front of the one before it; the
        recorded points stay as they are. Elsewhere nothing is shifted.
        """
        ahead = self.eye - self.target
        step = 0.003 * self.size * ahead / np.linalg.norm(ahead) if self.is_planar else np.zeros(3)
        return {track.name: rank * step for rank, track in enumerate(scene.tracks)}


def compute_framing(scene: Scene) -> Framing:
    """Looks straight on at a planar scene and from above at an angle at any other."""
    points = np.concatenate([track.points.reshape(-1, 3) for track in scene.tracks])
    low, high = points.min(axis=0), points.max(axis=0)
    extent = high - low
    size = max(float(extent.max()), 1e-6)
    flat = [axis for axis in (1, 2, 0) if extent[axis] < _FLAT * size]
    outward, up = _choose_directions(flat)
    axes = np.stack([np.cross(up, outward), up, outward])  # right, up, towards the eye
    seen = points @ axes.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    # From there the eye sees all points.
    about = seen - middle
    room = np.maximum(np.abs(about[:, 0]) / _ASPECT, np.abs(about[:, 1]))
    needed = float(np.max(1.25 * room / parts.HALF_VIEW + about[:, 2]))
    distance = max(needed, 0.25 * size / parts.HALF_VIEW)
    half_height = distance * parts.HALF_VIEW
    left = seen[:, 0].min() - middle[0] - 0.3 * half_height
    left = float(np.clip(left, -1.1 * half_height, -0.9 * half_height))
    normal = np.eye(3)[flat[0]] if flat else np.array([0.0, 0.0, 1.0])
    return Framing(
        eye=(middle + np.array([0.0, 0.0, distance])) @ axes,
        target=middle @ axes,
        up=up,
        size=size,
        half_height=half_height,
        grid_normal=normal,
        grid_distance=float(normal @ low),
        grid_spacing=parts.round_spacing(0.1 * size),
        corner=(middle + np.array([left, 0.8 * half_height, 0.0])) @ axes,
        is_planar=bool(flat),
    )


def _choose_directions(flat: list[int]) -> tuple[Array, Array]:
    """Returns the direction towards the eye and the upward one, perpendicular unit vectors."""
    if not flat:
        outward = np.array([0.5, -1.0, 0.4]) / np.linalg.norm([0.5, -1.0, 0.4])
        up = np.array([0.0, 0.0, 1.0]) - outward[2] * outward
        return outward, up / np.linalg.norm(up)
    outward = {0: (1.0, 0.0, 0.0), 1: (0.0, -1.0, 0.0), 2: (0.0, 0.0, 1.0)}[flat[0]]
    up = (0.0, 1.0, 0.0) if flat[0] == 2 else (0.0, 0.0, 1.0)
    return np.array(outward), np.array(up)


def write_recording(
    path: Path, scenes: Sequence[Scene], settings: dict[str, str], recording_id: str
) -> None:
    """Writes one .rrd with a tab per scene; the file appears whole or not at all.

    Args:
        path: replaced if it exists.
        scenes: at least one, names all different.
        settings: shown beside every scene, in this order.
        recording_id: tells recordings apart in the viewer.

    Raises:
        InputError: no scene, or two of one name.
    """
    if not scenes:
        raise InputError("scenes", scenes, "at least one scene")
    check_unique("scenes", [scene.name for scene in scenes])
    if not recording_id.strip():
        raise InputError("recording_id", recording_id, "a text that is not blank")
    framings = [compute_framing(scene) for scene in scenes]
    tabs = [_make_tab(scene, framing) for scene, framing in zip(scenes, framings, strict=True)]
    stream, encode = parts.open_stream(
        parts.make_blueprint(rrb.Tabs(*tabs, active_tab=0)), recording_id
    )
    parts.log_document(stream, "settings", f"# Settings\n\n{parts.format_table(settings)}")
    for scene, framing in zip(scenes, framings, strict=True):
        _log_scene(stream, scene, framing)
    write_atomically(Path(path), encode())


def _log_scene(stream: rr.RecordingStream, scene: Scene, framing: Framing) -> None:
    note = f"# {scene.title}\n\n{scene.note}\n\n{format_legend(scene)}"
    parts.log_document(stream, f"{scene.name}/note", note)
    for track in scene.tracks:
        _log_track(stream, scene, track, framing)
    steps = 0.14 * framing.half_height * np.arange(len(scene.tracks))
    legend = rr.Points3D(
        framing.corner - steps[:, None] * framing.up,
        colors=[lighten(track.color, 0.3) for track in scene.tracks],
        labels=[name_model(track.name) for track in scene.tracks],
        radii=0.0,
        show_labels=True,
    )
    stream.log(f"{scene.name}/legend", legend, static=True)
    for position, series in enumerate(scene.series):
        width = 2.0 + 1.5 * (len(scene.series) - 1 - position)
        path = f"{_name_folder(scene, series.unit)}/{rr.escape_entity_path_part(series.name)}"
        _log_series(stream, path, series, position, width)


def _log_track(
    stream: rr.RecordingStream, scene: Scene, track: HoseTrack, framing: Framing
) -> None:
    path = f"{scene.name}/hoses/{rr.escape_entity_path_part(track.name)}"
    radius = framing.clip_radii(scene)[track.name]
    shift = framing.compute_shifts(scene)[track.name]
    stream.log(path, rr.Transform3D(translation=shift), static=True)
    points = track.points.astype(np.float32)
    stream.log(path, rr.LineStrips3D.from_fields(radii=[radius], colors=[track.color]), static=True)
    stream.send_columns(
        path, [parts.make_time(track.times)], rr.LineStrips3D.columns(strips=points)
    )
    ends = points[:, [0, -1]]
    style = rr.Points3D.from_fields(radii=[1.6 * radius], colors=[track.color])
    stream.log(f"{path}/ends", style, static=True)
    columns = rr.Points3D.columns(positions=ends.reshape(-1, 3))
    stream.send_columns(
        f"{path}/ends", [parts.make_time(track.times)], columns.partition([2] * len(track.times))
    )


def _log_series(
    stream: rr.RecordingStream, path: str, series: Series, position: int, width: float
) -> None:
    color = series.color or find_color(series.name, position)
    unit = f" ({series.unit})" if series.unit else ""
    parts.log_scalars(
        stream, path, series.times, series.values, name_model(series.name) + unit, color, width
    )
    if series.limit is not None:
        times = series.times[[0, -1]] if len(series.times) > 1 else series.times
        values = np.full(len(times), series.limit)
        name = f"limit of {series.name}"
        parts.log_scalars(stream, f"{path}/limit", times, values, name, LIMIT, 1.0)


def _name_folder(scene: Scene, unit: str) -> str:
    """Returns the entity path of the series of one unit."""
    return f"{scene.name}/series/{rr.escape_entity_path_part(unit or _UNITLESS)}"


def _make_tab(scene: Scene, framing: Framing) -> rrb.Horizontal:
    above = parts.make_space_view(
        scene.title,
        (framing.eye, framing.target, framing.eye_up),
        (framing.grid_spacing, framing.grid_normal, framing.grid_distance),
        origin=f"/{scene.name}",
        contents=[f"/{scene.name}/hoses/**", f"/{scene.name}/legend"],
    )
    units = list(dict.fromkeys(series.unit for series in scene.series))
    below = [
        rrb.TimeSeriesView(
            origin=f"/{_name_folder(scene, unit)}",
            name=parts.name_quantity(unit),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=True),
        )
        for unit in units
    ]
    left = rrb.Vertical(above, *below, row_shares=[2.2] + [1.0] * len(below))
    side = rrb.Vertical(
        rrb.TextDocumentView(origin=f"/{scene.name}/note", name="What is shown"),
        rrb.TextDocumentView(origin="/settings", name="Settings"),
    )
    return rrb.Horizontal(left, side, column_shares=[3.2, 1.0], name=scene.name)


def format_legend(scene: Scene) -> str:
    """Returns one Markdown line per track: name, number of points and samples, radius."""
    cell = parts.escape_cell
    lines = [
        f"| {cell(t.name)} | {len(t.arc_lengths)} | {len(t.times)} | {1e3 * t.radius:.3g} |"
        for t in scene.tracks
    ]
    head = ["| hose | points | samples | radius (mm) |", "|---|---|---|---|"]
    return "\n".join([*head, *lines])
