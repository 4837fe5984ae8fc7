"""A comparison of hose models as a Rerun recording: one tab per scene, the models overlaid."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hose_mj.errors import InputError
from hose_mj.recording.captions import format_legend, format_settings, name_quantity
from hose_mj.recording.episode import HoseTrack, Scene, Series, check_unique
from hose_mj.recording.files import make_temp_beside, replace_atomically
from hose_mj.recording.framing import Framing, compute_framing
from hose_mj.recording.palette import LIMIT, find_color, lighten, name_model
from hose_mj.recording.rerun.parts import (
    APPLICATION_ID,
    DARK,
    TIMELINE,
    log_document,
    log_scalars,
    make_time,
)

_UNITLESS = "number"


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
    temp = make_temp_beside(Path(path))
    try:
        stream = rr.RecordingStream(APPLICATION_ID, recording_id=recording_id)
        framings = [compute_framing(scene) for scene in scenes]
        stream.save(temp, default_blueprint=make_blueprint(scenes, framings))
        log_document(stream, "settings", format_settings(settings))
        for scene, framing in zip(scenes, framings, strict=True):
            _log_scene(stream, scene, framing)
        stream.flush()
        stream.disconnect()
        replace_atomically(temp, Path(path))
    finally:
        temp.unlink(missing_ok=True)


def _log_scene(stream: rr.RecordingStream, scene: Scene, framing: Framing) -> None:
    note = f"# {scene.title}\n\n{scene.note}\n\n{format_legend(scene)}"
    log_document(stream, f"{scene.name}/note", note)
    for track in scene.tracks:
        _log_track(stream, scene, track, framing)
    _log_legend(stream, scene, framing)
    for position, series in enumerate(scene.series):
        width = 2.0 + 1.5 * (len(scene.series) - 1 - position)
        _log_series(stream, entity_of(scene, series), series, position, width)


def _log_track(
    stream: rr.RecordingStream, scene: Scene, track: HoseTrack, framing: Framing
) -> None:
    path = f"{scene.name}/hoses/{rr.escape_entity_path_part(track.name)}"
    radius = framing.clip_radii(scene)[track.name]
    shift = framing.compute_shifts(scene)[track.name]
    stream.log(path, rr.Transform3D(translation=shift), static=True)
    points = track.points.astype(np.float32)
    stream.log(path, rr.LineStrips3D.from_fields(radii=[radius], colors=[track.color]), static=True)
    stream.send_columns(path, [make_time(track.times)], rr.LineStrips3D.columns(strips=points))
    ends = points[:, [0, -1]]
    style = rr.Points3D.from_fields(radii=[1.6 * radius], colors=[track.color])
    stream.log(f"{path}/ends", style, static=True)
    columns = rr.Points3D.columns(positions=ends.reshape(-1, 3))
    stream.send_columns(
        f"{path}/ends", [make_time(track.times)], columns.partition([2] * len(track.times))
    )


def _log_legend(stream: rr.RecordingStream, scene: Scene, framing: Framing) -> None:
    legend = rr.Points3D(
        framing.place_legend(len(scene.tracks)),
        colors=[lighten(track.color, 0.3) for track in scene.tracks],
        labels=[name_model(track.name) for track in scene.tracks],
        radii=0.0,
        show_labels=True,
    )
    stream.log(f"{scene.name}/legend", legend, static=True)


def _log_series(
    stream: rr.RecordingStream, path: str, series: Series, position: int, width: float
) -> None:
    color = series.color or find_color(series.name, position)
    unit = f" ({series.unit})" if series.unit else ""
    log_scalars(
        stream, path, series.times, series.values, name_model(series.name) + unit, color, width
    )
    if series.limit is not None:
        times = series.times[[0, -1]] if len(series.times) > 1 else series.times
        values = np.full(len(times), series.limit)
        name = f"limit of {series.name}"
        log_scalars(stream, f"{path}/limit", times, values, name, LIMIT, 1.0)


def entity_of(scene: Scene, series: Series) -> str:
    """Returns the entity path of a series."""
    unit = rr.escape_entity_path_part(series.unit or _UNITLESS)
    return f"{scene.name}/series/{unit}/{rr.escape_entity_path_part(series.name)}"


def make_blueprint(scenes: Sequence[Scene], framings: Sequence[Framing]) -> rrb.Blueprint:
    """Lays out one tab per scene: hoses above, numbers below, note and settings at the side."""
    tabs = [_make_tab(scene, framing) for scene, framing in zip(scenes, framings, strict=True)]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
    )


def _make_tab(scene: Scene, framing: Framing) -> rrb.Horizontal:
    above = rrb.Spatial3DView(
        origin=f"/{scene.name}",
        name=scene.title,
        contents=[f"/{scene.name}/hoses/**", f"/{scene.name}/legend"],
        background=rrb.Background(color=DARK),
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=framing.grid_spacing,
            plane=rr.components.Plane3D(framing.grid_normal, framing.grid_distance),
            color=(255, 255, 255, 12),
        ),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=framing.eye,
            look_target=framing.target,
            eye_up=framing.eye_up,
        ),
    )
    units = list(dict.fromkeys(series.unit for series in scene.series))
    below = [_make_plot(scene, unit) for unit in units]
    left = rrb.Vertical(above, *below, row_shares=[2.2] + [1.0] * len(below))
    side = rrb.Vertical(
        rrb.TextDocumentView(origin=f"/{scene.name}/note", name="What is shown"),
        rrb.TextDocumentView(origin="/settings", name="Settings"),
    )
    return rrb.Horizontal(left, side, column_shares=[3.2, 1.0], name=scene.name)


def _make_plot(scene: Scene, unit: str) -> rrb.TimeSeriesView:
    origin = f"/{scene.name}/series/{rr.escape_entity_path_part(unit or _UNITLESS)}"
    return rrb.TimeSeriesView(
        origin=origin,
        name=name_quantity(unit),
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=True),
    )
