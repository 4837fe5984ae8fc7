"""`RecordEpisode`, `RecordTurns`: wrap an environment, and its episodes become recordings.

An environment that shows itself in Rerun in a way of its own has a method `recorder_source()` that
returns a `Source`; those of tasks on grids are known here.
"""

from pathlib import Path
from typing import Any, Protocol

import gymnasium
from pettingzoo.utils import BaseWrapper

from hose_mj.envs.drawing import Moment, encode_moments, look_at
from hose_mj.envs.episode import Episode
from hose_mj.errors import InputError
from hose_mj.recording.keep import Keep, Played, RecordingFolder

GOAL = "goal"  # event that counts as success


class Source(Protocol):
    """What an environment tells of its running episode."""

    def begin(self) -> None:
        """Is told of a reset."""
        ...

    def follow(self) -> None:
        """Is told of a step."""
        ...

    def summarize(self) -> tuple[float, bool, tuple[str, ...]]:
        """Returns the reward so far, whether the goal is reached, and the kinds of breaks."""
        ...

    def encode(self) -> bytes:
        """Returns the .rrd of the episode so far."""
        ...


class GridSource:
    """What the running episode of a task on a grid tells."""

    def __init__(self, episode: Episode) -> None:
        self._episode = episode
        self._moments: list[Moment] = []

    def begin(self) -> None:
        """Starts anew."""
        self._moments = [look_at(self._episode)]

    def follow(self) -> None:
        """Notes a step."""
        self._moments.append(look_at(self._episode))

    def summarize(self) -> tuple[float, bool, tuple[str, ...]]:
        """See `Source`; every event that ends an episode, but for the goal, is a break."""
        task, last = self._episode.task, self._moments[-1]
        total = float(sum(moment.reward for moment in self._moments))
        ending = task.name_events(last.events & task.kernel.terminal)
        return total, GOAL in ending, tuple(name for name in ending if name != GOAL)

    def encode(self) -> bytes:
        """See `Source`."""
        return encode_moments(self._episode.task, self._moments)


def find_source(env: Any) -> Source:
    """Returns what is to be recorded of an environment; `InputError` if it says nothing of it."""
    inner = env.unwrapped
    if hasattr(inner, "recorder_source"):
        source: Source = inner.recorder_source()
        return source
    if isinstance(getattr(inner, "episode", None), Episode):
        return GridSource(inner.episode)
    raise InputError("environment", str(inner), "one of hose_mj, or with recorder_source()")


class Recorder:
    """Follows the episodes of a source and keeps some of them in a folder."""

    def __init__(self, source: Source, folder: Path | str, keep: Keep | None) -> None:
        self._source, self._folder = source, RecordingFolder(Path(folder), keep)
        self._count, self._is_running = 0, False

    def begin(self) -> None:
        """Is told of a reset."""
        self._source.begin()
        self._is_running = True

    def follow(self, is_over: bool) -> None:
        """Is told of a step."""
        if not self._is_running:
            return
        self._source.follow()
        if is_over:
            self._is_running = False
            played = Played(self._count, *self._source.summarize())
            self._count += 1
            self._folder.add(played, self._source.encode)


class RecordEpisode(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Records the episodes of a Gymnasium environment of ours into a folder of .rrd files.

    Args:
        env: any wrapping of it.
        folder: made if absent.
        keep: which recordings stay: by default the last 3, the best, the first success and the
            first of each kind of break.

    Raises:
        InputError: an environment that does not say what to record.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], folder: Path | str, keep: Keep | None = None
    ) -> None:
        super().__init__(env)
        self._recorder = Recorder(find_source(env), folder, keep)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode."""
        answer = self.env.reset(seed=seed, options=options)
        self._recorder.begin()
        return answer

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Lets the environment step; the end of an episode writes its recording."""
        answer = self.env.step(action)
        self._recorder.follow(answer[2] or answer[3])
        return answer


class RecordTurns(BaseWrapper[str, Any, Any]):
    """The same for a PettingZoo environment whose agents move in turns."""

    def __init__(self, env: Any, folder: Path | str, keep: Keep | None = None) -> None:
        super().__init__(env)
        self._recorder = Recorder(find_source(env), folder, keep)

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Starts an episode."""
        super().reset(seed=seed, options=options)
        self._recorder.begin()

    def step(self, action: Any) -> None:
        """Lets an agent move; the end of an episode writes its recording."""
        super().step(action)
        over = (*self.env.terminations.values(), *self.env.truncations.values())
        self._recorder.follow(any(over))
