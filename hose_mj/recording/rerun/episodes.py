"""Recordings of episodes, whole ones in worlds and on grids, and sinks for those that go on."""

import time
import uuid
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hose_mj.errors import InputError
from hose_mj.recording.episode import check_unique
from hose_mj.recording.files import make_temp_beside, replace_atomically, write_atomically
from hose_mj.recording.grid import GridEpisode
from hose_mj.recording.rerun.parts import APPLICATION_ID, is_listening, open_stream, wait_until
from hose_mj.recording.rerun.viewer import open_window
from hose_mj.recording.rerun.world_log import WorldLog
from hose_mj.recording.rerun.world_scene import Look, log_scene, log_settings, make_world_blueprint
from hose_mj.recording.scene_description import SceneDescription
from hose_mj.recording.sinks import Background, Sink
from hose_mj.recording.world_episode import EpisodeEnding, Samples, WorldEpisode

_STRETCH_S = 30.0  # how long a viewer may take for one stretch before the rest is kept from it (s)
_START_S = 20.0  # how long a viewer may take to start (s)


def write_world_recording(path: Path, episodes: Sequence[WorldEpisode]) -> None:
    """Writes one .rrd of an episode, or of several overlaid in one scene; whole or not at all.

    Args:
        path: replaced if it exists.
        episodes: the first in its own colours, the others tinted and see-through; names of their
            scenes all different.

    Raises:
        InputError: no episode, or two of one name.
    """
    if not episodes:
        raise InputError("episodes", episodes, "at least one")
    scenes = [episode.scene for episode in episodes]
    check_unique("episodes", [scene.name for scene in scenes])
    stream, encode = open_stream(make_world_blueprint(scenes))
    log_settings(stream, scenes, [describe_ending(e.scene, e.ending) for e in episodes])
    log_scene(stream, scenes[0])
    for rank, episode in enumerate(episodes):
        log = WorldLog(stream, episode.scene, Look(rank))
        log.add(episode.samples)
        log.end(episode.ending)
    write_atomically(Path(path), encode())


class RecordingFile:
    """A sink that writes an .rrd at the end of a run; until then the recording is in memory.

    Args:
        path: replaced if it exists.
        recording_id: the same as that of a live view of the same run.
    """

    def __init__(self, path: Path, recording_id: str | None = None) -> None:
        self._path, self._id = Path(path), recording_id

    def begin(self, scene: SceneDescription) -> None:
        """Opens the file, under another name as yet; `OSError` where there can be none."""
        self._temp = make_temp_beside(self._path)
        stream, self._encode = open_stream(make_world_blueprint([scene]), self._id)
        self._log = open_log(stream, scene)

    def add(self, samples: Samples) -> None:
        """Writes a stretch."""
        self._log.add(samples)

    def end(self, ending: EpisodeEnding) -> None:
        """Writes how it ended, and puts the file in its place."""
        end_log(self._log, ending)
        try:
            self._temp.write_bytes(self._encode())
            replace_atomically(self._temp, self._path)
        finally:
            self._temp.unlink(missing_ok=True)


def describe_ending(scene: SceneDescription, ending: EpisodeEnding) -> str:
    """Returns one Markdown line on how an episode ended."""
    line = f"**{scene.name}: {ending.ended_by}**"
    return line if ending.mark is None else f"{line}. {ending.mark.text}"


def open_log(stream: rr.RecordingStream, scene: SceneDescription) -> WorldLog:
    """Logs what stands still and returns the log of what moves."""
    log_settings(stream, [scene])
    log_scene(stream, scene)
    return WorldLog(stream, scene, Look(0))


def end_log(log: WorldLog, ending: EpisodeEnding) -> None:
    """Logs how an episode ended, in the settings too."""
    log.end(ending)
    log_settings(log.stream, [log.scene], [describe_ending(log.scene, ending)])


def open_sinks(
    save: Path | None = None, connect: str | None = None, spawn: bool = False
) -> list[Sink]:
    """Returns the sinks for a run: a file, a viewer that listens, a new viewer, or several.

    They work in threads of their own, each with its own copy of the stream: a viewer that is slow,
    absent or closed costs the run nothing, and the file is complete in any case.

    Args:
        save: the .rrd to write.
        connect: URL of a viewer, "rerun+http://127.0.0.1:9876/proxy".
        spawn: opens a viewer's window on this machine.

    Raises:
        InputError: a URL of another form.
        HoseError: `spawn` where there is no display.
    """
    recording_id = uuid.uuid4().hex
    sinks: list[Sink] = []
    if save is not None:
        sinks.append(Background(RecordingFile(save, recording_id), "file", lossy=False))
    if connect is not None:
        check_url(connect)
        sinks.append(_show_live(connect, recording_id, f"viewer at {connect}", 0.5, 1.0))
    if spawn:
        sinks.append(_show_live(open_window(), recording_id, "viewer", _START_S, _START_S))
    return sinks


def _show_live(url: str, id: str, name: str, wait_s: float, patience_s: float) -> Background:
    """Returns a live view that never holds up the run, nor the end of the process.

    At its end a process would wait for a viewer that does not answer, however long that takes.
    """
    live, stop_waiting = LiveView(url, id, wait_s), rr.unregister_shutdown
    return Background(live, name, lossy=True, patience_s=patience_s, give_up=stop_waiting)


class LiveView:
    """A sink that sends a run to a viewer that listens.

    Args:
        url: of the viewer.
        recording_id: the same as that of the file of the same run.
        wait_s: how long it is waited for at the start (s).
    """

    def __init__(self, url: str, recording_id: str | None = None, wait_s: float = 0.5) -> None:
        self._url, self._id, self._wait = url, recording_id, wait_s

    def begin(self, scene: SceneDescription) -> None:
        """Connects and shows the scene; `HoseError` where nobody listens."""
        place, deadline = check_url(self._url), time.monotonic() + self._wait
        wait_until(lambda: is_listening(*place), deadline, f"no viewer listens at {self._url}")
        self._stream = rr.RecordingStream(APPLICATION_ID, recording_id=self._id)
        self._stream.connect_grpc(self._url)
        self._stream.send_blueprint(make_world_blueprint([scene], follow=True))
        self._log = open_log(self._stream, scene)

    def add(self, samples: Samples) -> None:
        """Sends a stretch."""
        self._log.add(samples)
        self._stream.flush(timeout_sec=_STRETCH_S)

    def end(self, ending: EpisodeEnding) -> None:
        """Sends how it ended."""
        end_log(self._log, ending)
        self._stream.flush(timeout_sec=_STRETCH_S)
        self._stream.disconnect()


def check_url(url: str) -> tuple[str, int]:
    """Returns host and port of a viewer's URL; `InputError` for one of another form."""
    parts = urlsplit(url)
    try:
        port = parts.port
    except ValueError:
        port = None
    schemes = ("rerun", "rerun+http", "rerun+https")
    if parts.scheme not in schemes or not parts.hostname or not port or parts.path != "/proxy":
        raise InputError("URL of the viewer", url, "such as rerun+http://127.0.0.1:9876/proxy")
    return parts.hostname, port


def encode_grid_episode(episode: GridEpisode) -> bytes:
    """Returns the .rrd of an episode on a grid; y is negated, as the viewer counts rows down."""
    down = np.array([1.0, -1.0])
    turns = [rr.TimeColumn("turn", sequence=episode.turns)]
    stream, encode = open_stream(
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
    return encode()
