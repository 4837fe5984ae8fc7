"""Live viewers: a sink that sends a run to one, and the sinks that a run's options ask for."""

from __future__ import annotations

import socket
import time
import uuid
from pathlib import Path
from urllib.parse import urlsplit

import rerun as rr

from hose_mj.errors import HoseError, InputError
from hose_mj.recording.rerun.parts import APPLICATION_ID
from hose_mj.recording.rerun.world_blueprint import make_world_blueprint
from hose_mj.recording.rerun.world_files import RecordingFile, describe_ending, open_log
from hose_mj.recording.rerun.world_stage import log_settings
from hose_mj.recording.scene_description import SceneDescription
from hose_mj.recording.sinks import Background, Sink
from hose_mj.recording.viewer import open_window
from hose_mj.recording.world_episode import EpisodeEnding, Samples

_STRETCH_S = 30.0
"""How long a viewer may take for one stretch before the rest is kept from it (s)."""
_START_S = 20.0
"""How long a viewer may take to start (s)."""


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
        live = LiveView(connect, recording_id)
        sinks.append(make_lossy(live, f"viewer at {connect}", patience_s=1.0))
    if spawn:
        live = LiveView(open_window(), recording_id, wait_s=_START_S)
        sinks.append(make_lossy(live, "viewer", patience_s=_START_S))
    return sinks


def make_lossy(live: LiveView, name: str, patience_s: float) -> Background:
    """Returns a live view that never holds up the run, nor the end of the process.

    At its end a process would wait for a viewer that does not answer, however long that takes.
    """
    stop_waiting = rr.unregister_shutdown
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
        """Connects and shows the scene.

        Raises:
            HoseError: nobody listens.
        """
        wait_for(self._url, self._wait)
        self._scene = scene
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
        self._log.end(ending)
        log_settings(self._stream, [self._scene], [describe_ending(self._scene, ending)])
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


def wait_for(url: str, wait_s: float) -> None:
    """Returns once somebody listens at a URL; raises `HoseError` if nobody does in time."""
    deadline = time.monotonic() + wait_s
    while True:
        try:
            socket.create_connection(check_url(url), timeout=1.0).close()
            return
        except OSError:
            if time.monotonic() > deadline:
                raise HoseError(f"no viewer listens at {url}") from None
            time.sleep(0.1)
