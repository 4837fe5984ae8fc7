"""Rerun's viewer, on this machine only: in a window, or without one for pictures, always ended."""

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rerun as rr

from hose_mj.errors import HoseError
from hose_mj.recording.files import write_atomically
from hose_mj.recording.rerun.parts import TIMELINE, is_listening, wait_until
from hose_mj.recording.rerun.reading import read_recording

DEBIAN_PACKAGES = ("mesa-vulkan-drivers", "libvulkan1")
_HOST = "127.0.0.1"
_STILL = 3  # pictures in a row that must agree before the viewer counts as done drawing
_FOLDERS = ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME")
_START_S = 30.0  # how long a viewer may take to start (s)


@dataclass(frozen=True)
class Viewer:
    """A running viewer: its process, the port it listens on, the file its messages go to."""

    process: subprocess.Popen[bytes]
    port: int
    messages: Path

    @property
    def url(self) -> str:
        """Returns where a client connects to."""
        return f"rerun+http://{_HOST}:{self.port}/proxy"

    def check_alive(self, grace_s: float = 0.0) -> None:
        """Raises `HoseError` with the reason if the viewer has ended, or ends within `grace_s`."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(grace_s)
            raise HoseError(explain_failure(self.messages.read_text(errors="replace")))

    def wait_until_listening(self, deadline: float) -> None:
        """Returns once the port answers; raises `HoseError` at the deadline (`time.monotonic`)."""

        def answers() -> bool:
            self.check_alive()
            return is_listening(_HOST, self.port)

        wait_until(answers, deadline, "the viewer did not answer in time")


@contextmanager
def start_viewer(size: tuple[int, int]) -> Iterator[Viewer]:
    """Runs a viewer of width x height pixels; kills it and its children on the way out.

    It has a home folder of its own, so it neither reads nor leaves any state of the user's.
    """
    with tempfile.TemporaryDirectory(prefix="hose-mj-viewer-") as home:
        port, messages = find_free_port(), Path(home) / "messages.txt"
        with messages.open("wb") as stream:
            process = subprocess.Popen(
                make_command(port, size),
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env={**os.environ, **dict.fromkeys(_FOLDERS, home), "RUST_LOG": "error"},
            )
        try:
            yield Viewer(process, port, messages)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def open_window(*files: Path) -> str:
    """Opens a viewer's window that outlives this process; returns the URL that it listens at.

    Args:
        files: recordings to show.

    Raises:
        HoseError: there is no display.
    """
    named = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    if sys.platform.startswith("linux") and not named:
        raise HoseError(
            "there is no display to open the viewer's window on; take a picture instead "
            "(--screenshot F.png), or save a recording (--save F.rrd) and open it elsewhere"
        )
    port = find_free_port()
    subprocess.Popen(
        [sys.executable, "-m", "rerun_cli", "--bind", _HOST, "--port", str(port), *map(str, files)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    return f"rerun+http://{_HOST}:{port}/proxy"


def make_command(port: int, size: tuple[int, int]) -> list[str]:
    """Returns the command line of a viewer without window, welcome screen or saved state."""
    return [
        *(sys.executable, "-m", "rerun_cli", "--headless"),
        *("--bind", _HOST, "--port", str(port)),
        *("--window-size", f"{size[0]}x{size[1]}"),
        *("--hide-welcome-screen", "--threads", "2"),
    ]


def find_free_port() -> int:
    """Returns a port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((_HOST, 0))
        return int(probe.getsockname()[1])


def explain_failure(messages: str) -> str:
    """Says in one sentence why the viewer ended, from what it printed."""
    lowered = messages.lower()
    if any(word in lowered for word in ("graphics adapter", "render context", "vulkan", "wgpu")):
        return (
            "the viewer found no graphics driver; a picture without a screen needs Mesa's software "
            f"Vulkan driver, on Debian: apt-get install {' '.join(DEBIAN_PACKAGES)}"
        )
    lines = [line.strip() for line in messages.splitlines() if line.strip()]
    last = [line for line in lines if "panicked" in line] or lines[-3:]
    return f"the viewer ended by itself: {' | '.join(last) or 'it printed nothing'}"


def connect(url: str) -> Any:
    """Returns a client that asks and steers the viewer at a URL.

    Raises:
        HoseError: this version of rerun has no such client where we know it.
    """
    try:
        from rerun.experimental import ViewerClient  # may move or change with any minor version
    except ImportError:
        raise HoseError(
            f"rerun {rr.__version__} has no rerun.experimental.ViewerClient, which steers the "
            "viewer and takes its picture; rerun-sdk 0.41 has it"
        ) from None
    return ViewerClient.connect(url)


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
    client = connect(viewer.url)
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
            client = connect(url)
            if client.get_state().recordings:
                client.set_time(TIMELINE, duration=at_s, play_state="paused")
                return
        except Exception as error:  # the viewer's client raises plain kinds
            if time.monotonic() > deadline:
                raise HoseError(f"the viewer did not start: {error}") from error
        if time.monotonic() > deadline:
            raise HoseError(f"the viewer did not open {path_rrd} in time")
        time.sleep(0.3)
