"""Rerun recordings (.rrd): written, summarised, photographed. The only file that imports rerun.

Parquet is the durable record, the .rrd is the view of it. Entity paths of a recording:

    /settings                            what it was made with (static)
    /<scene>/note                        title and note (static)
    /<scene>/hoses/<track>               the centre line; its ends are /<scene>/hoses/<track>/ends
    /<scene>/legend                      names in the tracks' colours (static)
    /<scene>/series/<unit>/<series>      numbers over time; .../limit is the series' bound

The one timeline is `sim_time`, simulated seconds. An episode on a grid has `turn` instead, and

    /grid/lines                          grid and walls (static)
    /grid/hose                           the hose
    /grid/<track>                        what stands on a cell
    /reward, /events                     of the step that led to a turn
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from hose_mj.errors import HoseError, InputError
from hose_mj.recording.captions import format_legend, format_settings, name_quantity
from hose_mj.recording.episode import Array, HoseTrack, Scene, Series, check_unique
from hose_mj.recording.files import make_temp_beside, replace_atomically, write_atomically
from hose_mj.recording.framing import Framing, compute_framing
from hose_mj.recording.grid import GridEpisode
from hose_mj.recording.palette import LIMIT, Rgb, find_color, lighten, name_model
from hose_mj.recording.viewer import Viewer, start_viewer

APPLICATION_ID = "hose_mj"
TIMELINE = "sim_time"
_DARK = (17, 20, 24)
_UNITLESS = "number"
_STILL = 3  # pictures in a row that must agree before the viewer counts as done drawing


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
        _log_document(stream, "settings", format_settings(settings))
        for scene, framing in zip(scenes, framings, strict=True):
            _log_scene(stream, scene, framing)
        stream.flush()
        stream.disconnect()
        replace_atomically(temp, Path(path))
    finally:
        temp.unlink(missing_ok=True)


def encode_grid_episode(episode: GridEpisode) -> bytes:
    """Returns the .rrd of an episode on a grid; y is negated, as the viewer counts rows down."""
    stream = rr.RecordingStream(APPLICATION_ID)
    sink = rr.binary_stream(stream)
    down = np.array([1.0, -1.0])
    turns = [rr.TimeColumn("turn", sequence=episode.turns)]
    stream.send_blueprint(
        rrb.Horizontal(
            rrb.Spatial2DView(origin="/grid", name=episode.title),
            rrb.Vertical(
                rrb.TimeSeriesView(origin="/reward", name="reward"),
                rrb.TextLogView(origin="/events", name="events"),
            ),
            column_shares=[2.0, 1.0],
        )
    )
    lines = rr.LineStrips2D(episode.lines * down, colors=[(70, 74, 82)], radii=[0.02])
    stream.log("grid/lines", lines, static=True)
    if episode.hose is not None:
        style = rr.LineStrips2D.from_fields(colors=[(196, 165, 92)], radii=[0.12])
        stream.log("grid/hose", style, static=True)
        strips = rr.LineStrips2D.columns(strips=list(episode.hose * down))
        stream.send_columns("grid/hose", turns, strips)
    for track in episode.tracks:
        path = f"grid/{rr.escape_entity_path_part(track.name)}"
        look = rr.Points2D.from_fields(colors=[track.color], radii=[0.4], labels=[track.label])
        stream.log(path, look, static=True)
        stream.send_columns(path, turns, rr.Points2D.columns(positions=track.points * down))
    stream.send_columns("reward", turns, rr.Scalars.columns(scalars=episode.rewards))
    stream.send_columns("events", turns, rr.TextLog.columns(text=list(episode.events)))
    return bytes(sink.read(flush=True) or b"")


def read_recording(path: Path) -> dict[str, Any]:
    """Summarises a recording.

    Returns:
        `application_id`, `recording_id`, `timelines` (sorted), `n_blueprints`, and `entities`: path
        to `{rows, static, components}`, where `rows` counts the rows on a timeline, `static` the
        others.

    Raises:
        InputError: no such file, or nothing recorded in it.
    """
    try:
        reader = RrdReader(path)
        store = reader.recordings()[0]
        chunks = list(reader.stream(store=store))
        n_blueprints = len(reader.blueprints())
    except Exception as error:  # rerun raises its own, undocumented kinds
        raise InputError("recording", str(path), "a readable .rrd file with a recording") from error
    entities: dict[str, dict[str, Any]] = {}
    timelines: set[str] = set()
    for chunk in chunks:
        entity = entities.setdefault(
            str(chunk.entity_path), {"rows": 0, "static": 0, "components": set()}
        )
        entity["static" if chunk.is_static else "rows"] += chunk.num_rows
        timelines.update(chunk.timeline_names)
        entity["components"].update(
            name for name in chunk.to_record_batch().schema.names if ":" in name
        )
    for entity in entities.values():
        entity["components"] = sorted(entity["components"])
    return {
        "application_id": store.application_id,
        "recording_id": store.recording_id,
        "timelines": sorted(timelines),
        "n_blueprints": n_blueprints,
        "entities": entities,
    }


def take_screenshot(
    path_rrd: Path,
    path_png: Path,
    timeout_s: float = 60.0,
    size: tuple[int, int] = (1600, 1000),
    at_s: float | None = None,
) -> None:
    """Writes what the viewer shows of a recording, drawn without a screen.

    Args:
        path_rrd: the recording.
        path_png: the picture, replaced atomically.
        timeout_s: longest wait, viewer's start included; one answer of its may add 15 s.
        size: width and height in pixels.
        at_s: simulated time to show, the last sample by default.

    Raises:
        InputError: not a recording.
        HoseError: the viewer cannot run here (the message says what to install) or took too long.
    """
    read_recording(path_rrd)
    deadline = time.monotonic() + timeout_s
    with start_viewer(size) as viewer:
        viewer.wait_until_listening(deadline)
        try:
            picture = _photograph(viewer, Path(path_rrd).resolve(), at_s, deadline)
        except HoseError:
            raise
        except Exception as error:  # the viewer's client raises plain kinds
            viewer.check_alive(grace_s=3.0)
            raise HoseError(f"the viewer gave no picture of {path_rrd}: {error}") from error
    write_atomically(Path(path_png), picture)


def _photograph(viewer: Viewer, recording: Path, at_s: float | None, deadline: float) -> bytes:
    """Opens a recording, moves the time cursor and waits until the picture no longer changes."""
    client = ViewerClient.connect(viewer.url)
    client.open(str(recording))
    if at_s is None:
        lines = client.get_state().recordings[0].timelines
        at_s = max((1e-9 * (line.end or 0) for line in lines if line.name == TIMELINE), default=0.0)
    client.set_time(TIMELINE, duration=at_s, play_state="paused")
    pictures: list[bytes] = []
    while len(pictures) < _STILL or len(set(pictures[-_STILL:])) > 1:
        if time.monotonic() > deadline:
            raise HoseError(f"the viewer was still drawing {recording} when the time was up")
        time.sleep(0.4)
        pictures.append(client.take_screenshot())
    return pictures[-1]


def _log_scene(stream: rr.RecordingStream, scene: Scene, framing: Framing) -> None:
    note = f"# {scene.title}\n\n{scene.note}\n\n{format_legend(scene)}"
    _log_document(stream, f"{scene.name}/note", note)
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
    stream.send_columns(path, [_time(track.times)], rr.LineStrips3D.columns(strips=points))
    ends = points[:, [0, -1]]
    style = rr.Points3D.from_fields(radii=[1.6 * radius], colors=[track.color])
    stream.log(f"{path}/ends", style, static=True)
    columns = rr.Points3D.columns(positions=ends.reshape(-1, 3))
    stream.send_columns(
        f"{path}/ends", [_time(track.times)], columns.partition([2] * len(track.times))
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
    _log_scalars(
        stream, path, series.times, series.values, name_model(series.name) + unit, color, width
    )
    if series.limit is not None:
        times = series.times[[0, -1]] if len(series.times) > 1 else series.times
        values = np.full(len(times), series.limit)
        name = f"limit of {series.name}"
        _log_scalars(stream, f"{path}/limit", times, values, name, LIMIT, 1.0)


def _log_scalars(
    stream: rr.RecordingStream,
    path: str,
    times: Array,
    values: Array,
    name: str,
    color: Rgb,
    width: float,
) -> None:
    style = rr.SeriesLines(colors=[color], widths=[width], names=[name])
    stream.log(path, style, static=True)
    stream.send_columns(path, [_time(times)], rr.Scalars.columns(scalars=values))


def _log_document(stream: rr.RecordingStream, path: str, text: str) -> None:
    stream.log(path, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


def _time(times: Array) -> rr.TimeColumn:
    return rr.TimeColumn(TIMELINE, duration=times)


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
        background=rrb.Background(color=_DARK),
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
