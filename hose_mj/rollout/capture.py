"""`Capture`: watches an episode in a world and hands what it sees to sinks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.recording.scene_description import SceneDescription
from hose_mj.recording.sinks import Sink
from hose_mj.recording.world_episode import (
    NO_TURN,
    BreakMark,
    EpisodeEnding,
    SampleBuffer,
    WorldEpisode,
)
from hose_mj.rollout.staging import N_POINTS, Cast, HoseReader, make_stage
from hose_mj.world.world import World

CHUNK, LIVE_CHUNK = 512, 12
"""Samples that are handed over at once: to files, and where somebody watches."""


class Capture:
    """An observer of episodes, and a context that ends a recording whatever happens.

    Args:
        sinks: where samples go: files, live viewers; see `hose_mj.recording`.
        keep: whether to keep the whole episode as well, see `episode`.
        most: samples kept at most, see `SampleBuffer`.
        n_points: points along the hose.

    Attributes:
        scene: of the running episode.
    """

    def __init__(
        self,
        sinks: Sequence[Sink] = (),
        keep: bool = False,
        most: int = 20_000,
        n_points: int = N_POINTS,
    ) -> None:
        self._sinks, self._keep, self._most, self._n_points = tuple(sinks), keep, most, n_points
        self._is_live = any(getattr(sink, "lossy", False) for sink in sinks)
        self.scene: SceneDescription | None = None
        self._cast: Cast | None = None
        self._reader: HoseReader | None = None
        self._chunk: SampleBuffer | None = None
        self._kept: SampleBuffer | None = None
        self._outcome: EpisodeEnding | None = None

    def start(
        self, world: World, monitor: Any | None, settings: Mapping[str, Any] | None = None
    ) -> None:
        """Begins an episode; nothing is recorded yet but the scene.

        The world is read once for nothing, so that what numba compiles when it is first called is
        compiled before the episode runs.
        """
        self.scene, self._cast = make_stage(world, monitor, settings or {}, self._n_points)
        self._reader = HoseReader(world, self.scene.arc_lengths)
        self._chunk = SampleBuffer(self.scene, LIVE_CHUNK if self._is_live else CHUNK)
        self._kept = SampleBuffer(self.scene, self._most) if self._keep else None
        self._outcome = None
        self._read(world)
        for sink in self._sinks:
            sink.begin(self.scene)

    def sample(
        self, world: World, monitor: Any | None, info: Mapping[str, Any] | None = None
    ) -> None:
        """Records the world as it stands.

        Args:
            world: the one that the episode started with.
            monitor: likewise.
            info: what else is known, all optional: `reward`, `turn` (a number), `owner` (whose turn
                it is), `vetoed` and `events` (names), `margins` (M,), if they have been measured
                at this state already.
        """
        chunk, info = self._chunk, info or {}
        assert chunk is not None, "start() comes first"
        if chunk.is_full:
            self._hand_over()
        margins = info.get("margins")
        if margins is None:
            margins = monitor.measure() if monitor is not None else np.zeros(0)
        numbers = {
            "time": world.time,
            "turn": info.get("turn", NO_TURN),
            "reward": info.get("reward", 0.0),
            "margins": margins,
            **self._read(world),
        }
        vetoed, events = ", ".join(info.get("vetoed", ())), ", ".join(info.get("events", ()))
        chunk.append(info.get("owner", "") or "", vetoed, events, **numbers)

    def finish(self, outcome: Any = None) -> None:
        """Ends the episode.

        Args:
            outcome: has `ended_by`, a text, and `broken`, a `Break` or None; None if the episode
                was stopped.
        """
        if self.scene is None or self._outcome is not None:
            return
        mark = None if outcome is None else make_mark(outcome.broken)
        self._outcome = EpisodeEnding("stopped" if outcome is None else outcome.ended_by, mark)
        self._hand_over()
        for sink in self._sinks:
            sink.end(self._outcome)

    def episode(self) -> WorldEpisode:
        """Returns the episode that has ended, where `keep` was asked for and there are samples."""
        assert self._kept is not None, "made with keep=True, and started"
        assert self.scene is not None
        return WorldEpisode(
            self.scene, self._kept.copy(), self._outcome or EpisodeEnding("running")
        )

    def __enter__(self) -> Capture:
        return self

    def __exit__(self, *_: object) -> None:
        self.finish()

    def _read(self, world: World) -> dict[str, Array]:
        """Returns what a sample holds of the world as it stands."""
        assert self.scene is not None
        assert self._cast is not None
        assert self._reader is not None
        control_points, hose = self._reader.read(world)
        return {
            "positions": world.data.xpos[self._cast.bodies],
            "quaternions": world.data.xquat[self._cast.bodies],
            "hose": hose,
            "control_points": control_points,
            "tension": world.tension(self.scene.arc_lengths),
            "attachments": world.site_positions(),
            "forces": world.attachment_forces(),
        }

    def _hand_over(self) -> None:
        if self._chunk is None or not len(self._chunk):
            return
        samples = self._chunk.take()
        if self._kept is not None:
            self._kept.extend(samples)
        for sink in self._sinks:
            sink.add(samples)


def make_mark(broken: Any | None) -> BreakMark | None:
    """Turns a `Break` into what a recording shows of it."""
    if broken is None:
        return None
    return BreakMark(
        broken.kind,
        broken.time,
        np.array(broken.place),
        f"{broken.kind}: {broken.describe()}",
        broken.to_record(),
    )
