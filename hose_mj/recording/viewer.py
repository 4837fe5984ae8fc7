"""Starts Rerun's viewer without a window, on this machine only, and always ends it."""

from __future__ import annotations

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

from hose_mj.errors import HoseError

DEBIAN_PACKAGES = ("mesa-vulkan-drivers", "libvulkan1")
_HOST = "127.0.0.1"


@dataclass(frozen=True)
class Viewer:
    """A running viewer: its process, the port it listens on, the file its messages go to."""

    process: subprocess.Popen[bytes]
    port: int
    messages: Path

    @property
    def url(self) -> str:
        """Where a client connects to."""
        return f"rerun+http://{_HOST}:{self.port}/proxy"

    def check_alive(self, grace_s: float = 0.0) -> None:
        """Raises `HoseError` with the reason if the viewer has ended, or ends within `grace_s`."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(grace_s)
            raise HoseError(explain_failure(self.messages.read_text(errors="replace")))

    def wait_until_listening(self, deadline: float) -> None:
        """Returns once the port answers; raises `HoseError` at the deadline (`time.monotonic`)."""
        while True:
            self.check_alive()
            try:
                socket.create_connection((_HOST, self.port), timeout=0.5).close()
                return
            except OSError:
                if time.monotonic() > deadline:
                    raise HoseError("the viewer did not answer in time") from None
                time.sleep(0.05)


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
                env=make_environment(Path(home)),
            )
        try:
            yield Viewer(process, port, messages)
        finally:
            stop(process)


def open_window(*files: Path) -> str:
    """Opens a viewer's window that outlives this process; returns the URL that it listens at.

    Args:
        files: recordings to show.

    Raises:
        HoseError: there is no display.
    """
    if not has_display():
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


def has_display() -> bool:
    """Whether a window can be opened; taken for granted where X11 and Wayland are not usual."""
    named = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    return bool(named) or not sys.platform.startswith("linux")


def make_command(port: int, size: tuple[int, int]) -> list[str]:
    """Returns the command line of a viewer without window, welcome screen or saved state."""
    return [
        *(sys.executable, "-m", "rerun_cli", "--headless"),
        *("--bind", _HOST, "--port", str(port)),
        *("--window-size", f"{size[0]}x{size[1]}"),
        *("--hide-welcome-screen", "--threads", "2"),
    ]


def make_environment(home: Path) -> dict[str, str]:
    """Returns this process's environment, folders moved to `home` and pop-up messages off."""
    folders = ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME")
    return {**os.environ, **dict.fromkeys(folders, str(home)), "RUST_LOG": "error"}


def stop(process: subprocess.Popen[bytes]) -> None:
    """Ends a process that leads its own group, and the group with it."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


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
