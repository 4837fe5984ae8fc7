"""Which recordings of a run stay: the last few, the best, the first success, the first breaks."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hose_mj.errors import InputError
from hose_mj.recording.files import write_atomically

INDEX = "index.json"
LAST, BEST, FIRST_SUCCESS = "last", "best", "first success"


@dataclass(frozen=True)
class Played:
    """An episode that has ended."""

    number: int  # counts up from 0
    total_reward: float  # of all agents together
    success: bool  # whether it reached its goal
    breaks: tuple[str, ...] = ()  # kinds of the constraints that broke


class Keep:
    """Chooses what stays, with no more than `last` + 2 + `most_kinds` episodes at any time.

    Args:
        last: how many of the latest stay.
        most_kinds: kinds of break of which the first stays; later kinds do not.

    Raises:
        InputError: a negative number.
    """

    def __init__(self, last: int = 3, most_kinds: int = 8) -> None:
        for name, value in (("last", last), ("most_kinds", most_kinds)):
            if value < 0:
                raise InputError(name, value, "a whole number, at least 0")
        self._last, self._most_kinds = last, most_kinds
        self._latest: list[Played] = []
        self._best: Played | None = None
        self._firsts: dict[str, Played] = {}

    def add(self, played: Played) -> None:
        """Counts an episode that has just ended."""
        self._latest = [*self._latest, played][-self._last :] if self._last else []
        if self._best is None or played.total_reward > self._best.total_reward:
            self._best = played
        if played.success:
            self._firsts.setdefault(FIRST_SUCCESS, played)
        for kind in played.breaks:
            if len(self._firsts) - (FIRST_SUCCESS in self._firsts) < self._most_kinds:
                self._firsts.setdefault(f"first {kind}", played)

    def list_kept(self) -> dict[Played, tuple[str, ...]]:
        """Returns the episodes that stay, with the reasons, in the order they were played."""
        reasons: dict[Played, list[str]] = {}
        for played in self._latest:
            reasons.setdefault(played, []).append(LAST)
        if self._best is not None:
            reasons.setdefault(self._best, []).append(BEST)
        for reason, played in self._firsts.items():
            reasons.setdefault(played, []).append(reason)
        order = sorted(reasons, key=lambda played: played.number)
        return {played: tuple(reasons[played]) for played in order}


class RecordingFolder:
    """A folder of recordings that a `Keep` holds small, with an index of what is there and why.

    Args:
        folder: made if absent; recordings of an earlier run in it are left alone.
        keep: what stays; the defaults of `Keep` if None.
    """

    def __init__(self, folder: Path, keep: Keep | None = None) -> None:
        self.folder, self._keep = Path(folder), keep or Keep()
        self._written: set[int] = set()

    def add(self, played: Played, encode: Callable[[], bytes]) -> None:
        """Counts an episode, writes it if it stays, and removes those that no longer do.

        Args:
            played: the episode.
            encode: makes its .rrd; called only if it stays.
        """
        self._keep.add(played)
        kept = self._keep.list_kept()
        if played in kept:
            write_atomically(self.folder / name_file(played.number), encode())
            self._written.add(played.number)
        self._write_index(kept)
        for number in self._written - {one.number for one in kept}:
            (self.folder / name_file(number)).unlink(missing_ok=True)
            self._written.discard(number)

    def _write_index(self, kept: dict[Played, tuple[str, ...]]) -> None:
        entries = [
            {"file": name_file(played.number), "reasons": list(reasons), **asdict(played)}
            for played, reasons in kept.items()
        ]
        text = json.dumps({"recordings": entries}, indent=2)
        write_atomically(self.folder / INDEX, text.encode())


def name_file(number: int) -> str:
    """Returns the name of an episode's recording."""
    return f"episode_{number:06d}.rrd"


def find_recording(path: Path) -> Path:
    """Returns the recording to look at first.

    Args:
        path: a recording, or the folder of a run or of its recordings: there it is the first break,
            else the best, else the last; without an index the newest file.

    Raises:
        InputError: nothing there.
    """
    path = Path(path)
    if not path.is_dir():
        return path
    for folder in (path, path / "recordings"):
        entries = read_index(folder)
        for wanted in ("first ", BEST, LAST):
            for entry in entries:
                is_break = wanted != "first " or bool(entry["breaks"])
                if is_break and any(r.startswith(wanted) for r in entry["reasons"]):
                    return folder / str(entry["file"])
        found = sorted(folder.glob("*.rrd"), key=lambda file: file.stat().st_mtime)
        if found:
            return found[-1]
    raise InputError("recording", str(path), "an .rrd file, or a folder with some")


def read_index(folder: Path) -> list[dict[str, Any]]:
    """Returns the entries of a folder's index whose files are there; none without an index."""
    try:
        entries = json.loads((folder / INDEX).read_text(encoding="utf-8"))["recordings"]
        return [entry for entry in entries if (folder / entry["file"]).is_file()]
    except (OSError, ValueError, KeyError, TypeError):
        return []
