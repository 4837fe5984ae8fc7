"""Where the episodes of a rollout are recorded: files, a film, a table, a live viewer."""

from __future__ import annotations

import subprocess
import sys
import uuid
from pathlib import Path
from types import TracebackType
from typing import Protocol

from hose_mj.errors import InputError
from hose_mj.recording.sinks import Background, Sink
from hose_mj.recording.viewer import find_free_port
from hose_mj.rollout.capture import Capture
from hose_mj.rollout.episode import Observer
from tools.display import check_display

ENDINGS = {"save": ".rrd", "mp4": ".mp4", "csv": ".csv"}


class Wishes(Protocol):
    """The arguments about recording; see `tools.rollout.Args`."""

    save: Path | None
    mp4: Path | None
    csv: Path | None
    spawn: bool
    connect: str | None


class Recording:
    """Records the episodes of one command; a context that ends what is open.

    A single episode goes to its file and to a live viewer while it runs. Two are kept and written
    overlaid when both have ended.

    Args:
        wishes: what is to be recorded.
        n_episodes: how many there will be.

    Raises:
        InputError: a file whose name does not end as it should, or a film or table of two episodes.
    """

    def __init__(self, wishes: Wishes, n_episodes: int) -> None:
        self._wishes, self._overlays = wishes, n_episodes > 1
        self._captures: list[Capture] = []
        self._id = str(uuid.uuid4())
        for name, ending in ENDINGS.items():
            path = getattr(wishes, name)
            if path is None:
                continue
            if path.suffix != ending:
                raise InputError(name, str(path), f"a file name that ends in {ending}")
            if not path.resolve().parent.is_dir():
                raise InputError(name, str(path), "a file in a folder that is there")
            if self._overlays and name != "save":
                raise InputError(name, str(path), "one model only")
        if self._overlays and (wishes.spawn or wishes.connect):
            raise InputError("model", "two", "one model where a viewer watches; --save shows both")

    def __enter__(self) -> Recording:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for capture in self._captures:
            capture.finish()
        if kind is None and self._overlays and self._wishes.save is not None:
            from hose_mj.recording.rerun.world_files import write_world_recording

            episodes = [capture.episode() for capture in self._captures]
            write_world_recording(self._wishes.save, episodes, self._id)

    def make_observers(self) -> list[Observer]:
        """What is to watch the next episode; nothing where nothing is recorded."""
        if self._overlays:
            wanted = self._wishes.save is not None
            captures = [Capture(keep=True)] if wanted else []
        else:
            sinks = self._make_sinks()
            captures = [Capture(sinks)] if sinks else []
        self._captures += captures
        return list(captures)

    def describe(self) -> list[str]:
        """A line for each file."""
        written = {name: getattr(self._wishes, name) for name in ENDINGS}
        return [f"{name}: {path}" for name, path in written.items() if path is not None]

    def _make_sinks(self) -> list[Sink]:
        wishes, sinks = self._wishes, list[Sink]()
        if wishes.save is not None:
            from hose_mj.recording.rerun.world_files import RecordingFile

            file = RecordingFile(wishes.save, self._id)
            sinks.append(Background(file, "recording", lossy=False))
        urls = [wishes.connect] if wishes.connect else []
        if wishes.spawn:
            urls.append(spawn_viewer())
        for url in urls:
            from hose_mj.recording.rerun.world_files import LiveView

            sinks.append(Background(LiveView(url, self._id), "viewer", lossy=True))
        return sinks


def spawn_viewer() -> str:
    """Opens Rerun's viewer, which outlives this command, on this machine only; returns its URL.

    Raises:
        InputError: there is no display.
    """
    check_display("spawn")
    port = find_free_port()
    command = [sys.executable, "-m", "rerun_cli", "--bind", "127.0.0.1", "--port", str(port)]
    subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    return f"rerun+http://127.0.0.1:{port}/proxy"
