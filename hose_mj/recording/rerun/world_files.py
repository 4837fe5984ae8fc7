"""Episodes in worlds as recordings: whole ones, and sinks for those that still go on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import rerun as rr

from hose_mj.errors import InputError
from hose_mj.recording.episode import check_unique
from hose_mj.recording.files import make_temp_beside, replace_atomically
from hose_mj.recording.rerun.parts import APPLICATION_ID
from hose_mj.recording.rerun.world_blueprint import make_world_blueprint
from hose_mj.recording.rerun.world_log import WorldLog
from hose_mj.recording.rerun.world_stage import choose_look, log_scene, log_settings
from hose_mj.recording.scene_description import SceneDescription
from hose_mj.recording.world_episode import EpisodeEnding, Samples, WorldEpisode


def write_world_recording(
    path: Path, episodes: Sequence[WorldEpisode], recording_id: str | None = None
) -> None:
    """Writes one .rrd of an episode, or of several overlaid in one scene; whole or not at all.

    Args:
        path: replaced if it exists.
        episodes: the first in its own colours, the others tinted and see-through; names of their
            scenes all different.
        recording_id: tells recordings apart in the viewer; a new one by default.

    Raises:
        InputError: no episode, or two of one name.
    """
    if not episodes:
        raise InputError("episodes", episodes, "at least one")
    scenes = [episode.scene for episode in episodes]
    check_unique("episodes", [scene.name for scene in scenes])
    temp = make_temp_beside(Path(path))
    try:
        stream = rr.RecordingStream(APPLICATION_ID, recording_id=recording_id)
        stream.save(temp, default_blueprint=make_world_blueprint(scenes))
        log_settings(stream, scenes, [describe_ending(e.scene, e.ending) for e in episodes])
        log_scene(stream, scenes[0])
        for rank, episode in enumerate(episodes):
            log = WorldLog(stream, episode.scene, choose_look(rank))
            log.add(episode.samples)
            log.end(episode.ending)
        stream.flush()
        stream.disconnect()
        replace_atomically(temp, Path(path))
    finally:
        temp.unlink(missing_ok=True)


class RecordingFile:
    """A sink that writes an .rrd while the run goes on; it appears under its name at the end.

    Args:
        path: replaced if it exists.
        recording_id: the same as that of a live view of the same run.
    """

    def __init__(self, path: Path, recording_id: str | None = None) -> None:
        self._path, self._id = Path(path), recording_id

    def begin(self, scene: SceneDescription) -> None:
        """Opens the file, under another name as yet."""
        self._temp = make_temp_beside(self._path)
        self._scene = scene
        self._stream = rr.RecordingStream(APPLICATION_ID, recording_id=self._id)
        self._stream.save(self._temp, default_blueprint=make_world_blueprint([scene]))
        self._log = open_log(self._stream, scene)

    def add(self, samples: Samples) -> None:
        """Writes a stretch."""
        self._log.add(samples)

    def end(self, ending: EpisodeEnding) -> None:
        """Writes how it ended, and puts the file in its place."""
        self._log.end(ending)
        log_settings(self._stream, [self._scene], [describe_ending(self._scene, ending)])
        self._stream.flush()
        self._stream.disconnect()
        replace_atomically(self._temp, self._path)


def describe_ending(scene: SceneDescription, ending: EpisodeEnding) -> str:
    """Returns one Markdown line on how an episode ended."""
    line = f"**{scene.name}: {ending.ended_by}**"
    return line if ending.mark is None else f"{line}. {ending.mark.text}"


def open_log(stream: rr.RecordingStream, scene: SceneDescription) -> WorldLog:
    """Logs what stands still and returns the log of what moves."""
    log_settings(stream, [scene])
    log_scene(stream, scene)
    return WorldLog(stream, scene, choose_look(0))
