"""Where the episodes of a rollout are recorded: files, a film, a table, a live viewer."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Protocol

from hose_mj.errors import InputError
from hose_mj.recording.sinks import Sink
from hose_mj.rollout.capture import Capture
from hose_mj.rollout.episode import Observer
from hose_mj.scenes.mjcf.scene import Scene

ENDINGS = {"save": ".rrd", "mp4": ".mp4", "csv": ".csv"}


class Wishes(Protocol):
    """The arguments about recording; see `hose_mj.cli.rollout.Args`."""

    @property
    def save(self) -> Path | None:
        """A Rerun recording."""

    @property
    def mp4(self) -> Path | None:
        """A film."""

    @property
    def csv(self) -> Path | None:
        """A table."""

    @property
    def spawn(self) -> bool:
        """Whether to open a viewer."""

    @property
    def connect(self) -> str | None:
        """URL of a viewer."""


class Recording:
    """Records the episodes of one command; a context that ends what is open.

    A single episode goes to its .rrd and to a live viewer while it runs; films, tables and two
    episodes overlaid are written when all have ended.

    Args:
        wishes: what is to be recorded.
        scene: in which the episodes are.
        n_episodes: how many there will be.

    Raises:
        InputError: a file whose name does not end as it should or whose folder is not there, or a
            film, a table or a live view of two episodes.
    """

    def __init__(self, wishes: Wishes, scene: Scene, n_episodes: int) -> None:
        self._wishes, self._scene, self._overlays = wishes, scene, n_episodes > 1
        self._captures: list[Capture] = []
        for name, ending in ENDINGS.items():
            path = getattr(wishes, name)
            if path is None:
                continue
            if path.suffix != ending:
                raise InputError(name, str(path), f"a file name that ends in {ending}")
            if not path.resolve().parent.is_dir():
                raise InputError(name, str(path), "a file in a folder that is there")
        if self._overlays and (wishes.spawn or wishes.connect or wishes.mp4 or wishes.csv):
            raise InputError("number of models", n_episodes, "1, or --save alone")

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
        if kind is None and self._captures:
            self._write()

    def make_observers(self) -> list[Observer]:
        """What is to watch the next episode; nothing where nothing is recorded."""
        wishes = self._wishes
        sinks = [] if self._overlays else self._open_sinks()
        keeps = bool(wishes.mp4 or wishes.csv or (self._overlays and wishes.save))
        captures = [Capture(sinks, keep=keeps)] if sinks or keeps else []
        self._captures += captures
        return list(captures)

    def describe(self) -> list[str]:
        """A line for each file."""
        paths = {name: getattr(self._wishes, name) for name in ENDINGS}
        return [f"{name}: {path}" for name, path in paths.items() if path is not None]

    def _open_sinks(self) -> list[Sink]:
        wishes = self._wishes
        if not (wishes.save or wishes.connect or wishes.spawn):
            return []
        from hose_mj.recording.rerun.episodes import open_sinks

        return open_sinks(wishes.save, wishes.connect, wishes.spawn)

    def _write(self) -> None:
        """Writes what needs whole episodes."""
        wishes = self._wishes
        if self._overlays and wishes.save is not None:
            from hose_mj.recording.rerun.episodes import write_world_recording

            write_world_recording(wishes.save, [one.episode() for one in self._captures])
        if wishes.csv is not None:
            from hose_mj.recording.world_table import write_csv

            write_csv(wishes.csv, self._captures[0].episode())
        if wishes.mp4 is not None:
            from hose_mj.rollout.video import write_mp4

            write_mp4(wishes.mp4, self._captures[0].episode(), self._scene)
