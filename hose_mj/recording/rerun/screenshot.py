"""Pictures of recordings, drawn by Rerun's viewer without a screen."""

from __future__ import annotations

import time
from pathlib import Path

from rerun.experimental import ViewerClient

from hose_mj.errors import HoseError
from hose_mj.recording.files import write_atomically
from hose_mj.recording.rerun.parts import TIMELINE
from hose_mj.recording.rerun.reading import read_recording
from hose_mj.recording.viewer import Viewer, open_window, start_viewer

_STILL = 3  # pictures in a row that must agree before the viewer counts as done drawing
_START_S = 30.0
"""How long a viewer may take to start (s)."""


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
    lines = client.get_state().recordings[0].timelines
    if at_s is None:
        at_s = max((1e-9 * (line.end or 0) for line in lines if line.name == TIMELINE), default=0.0)
    if any(line.name == TIMELINE for line in lines):  # an episode on a grid has turns instead
        client.set_time(TIMELINE, duration=at_s, play_state="paused")
    pictures: list[bytes] = []
    while len(pictures) < _STILL or len(set(pictures[-_STILL:])) > 1:
        if time.monotonic() > deadline:
            raise HoseError(f"the viewer was still drawing {recording} when the time was up")
        time.sleep(0.4)
        pictures.append(client.take_screenshot())
    return pictures[-1]


def open_recording(path_rrd: Path, at_s: float | None) -> None:
    """Opens a recording in a window of the viewer, which stays when this process ends.

    Args:
        path_rrd: the recording.
        at_s: simulated time to stop at; None to leave the time alone.

    Raises:
        HoseError: there is no display, or the viewer did not start in time.
    """
    url = open_window(Path(path_rrd).resolve())
    if at_s is None:
        return
    deadline = time.monotonic() + _START_S
    while True:
        try:
            client = ViewerClient.connect(url)
            if client.get_state().recordings:
                client.set_time(TIMELINE, duration=at_s, play_state="paused")
                return
        except Exception as error:  # the viewer's client raises plain kinds
            if time.monotonic() > deadline:
                raise HoseError(f"the viewer did not start: {error}") from error
        if time.monotonic() > deadline:
            raise HoseError(f"the viewer did not open {path_rrd} in time")
        time.sleep(0.3)
