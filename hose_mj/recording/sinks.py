"""`Sink`: where an episode goes while it runs; `Background`: a sink that never holds up the run."""

import queue
import sys
import threading
from collections.abc import Callable
from typing import Protocol

from hose_mj.recording.scene_description import SceneDescription
from hose_mj.recording.world_episode import EpisodeEnding, Samples

_RESERVED = 3  # begin, end, and the mark that nothing follows


class Sink(Protocol):
    """Takes an episode: `begin`, any number of `add`, `end`; then perhaps another."""

    def begin(self, scene: SceneDescription) -> None:
        """Is told what is to be seen."""
        ...

    def add(self, samples: Samples) -> None:
        """Takes the next stretch; never changed afterwards."""
        ...

    def end(self, ending: EpisodeEnding) -> None:
        """Is told how it ended."""
        ...


class Background:
    """Hands an episode to a sink from a thread of its own.

    What a lossless sink (a file) raises is raised in the run, at the latest by `end`, which waits
    for it. A lossy one (a live viewer) may be as slow as it likes, hang or fail: what it cannot
    take in time is dropped, `end` waits `patience_s` for it at most, and stderr says so once.

    Args:
        sink: where it goes.
        name: of the sink, for messages.
        lossy: whether stretches may be dropped.
        most: stretches that wait at most.
        patience_s: how long `end` waits for a lossy sink (s).
        give_up: called when a lossy sink has not finished in that time.

    Attributes:
        lossy: as given.
    """

    def __init__(
        self,
        sink: Sink,
        name: str,
        lossy: bool,
        most: int = 32,
        patience_s: float = 1.0,
        give_up: Callable[[], None] | None = None,
    ) -> None:
        self._sink, self._name, self.lossy = sink, name, lossy
        self._most, self._patience, self._give_up = most, patience_s, give_up
        self._jobs: queue.Queue[Callable[[], None] | None] = queue.Queue()
        self._error: BaseException | None = None
        self._thread: threading.Thread | None = None
        self._complained = False
        self._dropping = False

    def begin(self, scene: SceneDescription) -> None:
        """Begins an episode."""
        if self._thread is not None:
            self._thread.join(self._patience if self.lossy else None)
        self._dropping = self._thread is not None and self._thread.is_alive()
        if self._dropping:
            self._complain()
            return
        self._jobs = queue.Queue(self._most + _RESERVED)
        self._thread = threading.Thread(
            target=self._work, args=[self._jobs], name=self._name, daemon=True
        )
        self._thread.start()
        self._put(lambda: self._sink.begin(scene), must=True)

    def add(self, samples: Samples) -> None:
        """Adds a stretch."""
        if not self.lossy:
            self._raise()
        self._put(lambda: self._sink.add(samples))

    def end(self, ending: EpisodeEnding) -> None:
        """Ends the episode; a lossless sink has taken all of it when this returns."""
        assert self._thread is not None, "begin() comes first"
        self._put(lambda: self._sink.end(ending), must=True)
        self._put(None, must=True)
        self._thread.join(self._patience if self.lossy else None)
        if not self.lossy:
            self._raise()
        elif self._thread.is_alive() or self._error is not None:
            self._complain()
            if self._give_up is not None:
                self._give_up()

    def _put(self, job: Callable[[], None] | None, must: bool = False) -> None:
        """Queues a job; what a lossy sink must hear always finds room, the rest may be lost."""
        if not self.lossy:
            self._jobs.put(job)
        elif self._dropping or not (must or self._jobs.qsize() < self._most):
            self._complain()
        else:
            self._jobs.put_nowait(job)

    def _work(self, jobs: queue.Queue[Callable[[], None] | None]) -> None:
        while (job := jobs.get()) is not None:
            if self._error is None:
                try:
                    job()
                except BaseException as error:  # handed to the run, whatever it is
                    self._error = error

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error

    def _complain(self) -> None:
        if not self._complained:
            why = f": {self._error}" if self._error is not None else ", which is slow or closed"
            sys.stderr.write(f"hose_mj: not all of this reaches the {self._name}{why}\n")
        self._complained = True
