"""Run folders: what a training was, what happened in it and what it learned.

`config.json` (settings, seed, versions), `episodes/*.parquet` (one part after the other),
`checkpoints/last.npz` with a manifest of hashes, `summary.json`. Each file is replaced as a whole
and the checkpoint last of all, so a run that is killed goes on from its last checkpoint.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hose_learning.study.saving import (
    DESCRIPTION,
    compute_identity,
    describe,
    load_memory,
    remake,
    save_memory,
)
from hose_learning.study.training import Episodes, Training
from hose_mj.errors import InputError
from hose_mj.recording.files import write_atomically
from hose_mj.recording.parquet import write_columns
from hose_mj.version import __version__

CONFIG, SUMMARY, CHECKPOINT = "config.json", "summary.json", "checkpoints/last.npz"


class RunFolder:
    """The folder of one run.

    Args:
        path: the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)

    def create(
        self, training: Training, seed: int, ends: Mapping[str, int | None] | None = None
    ) -> None:
        """Writes the settings of a new run.

        Args:
            training: before its first move.
            seed: what its generator was made from.
            ends: episodes and moves after which it is to end; no part of its identity.

        Raises:
            InputError: the folder holds a run already.
        """
        if (self.path / CONFIG).exists():
            raise InputError("out", str(self.path), "a folder without a run in it (or --resume it)")
        description = describe(training, seed)
        config = {
            **description,
            "identity": compute_identity(description),
            "ends": dict(ends or {}),
            "versions": {
                "hose_mj": __version__,
                "numpy": np.__version__,
                "python": platform.python_version(),
            },
        }
        self._write(CONFIG, config)

    def open(self) -> tuple[Training, int]:
        """Returns the run's training where it stopped, and its seed.

        Raises:
            InputError: no run is in the folder, or a file of it is damaged.
        """
        config = self.read(CONFIG)
        description = {name: config.get(name) for name in DESCRIPTION}
        if compute_identity(description) != config.get("identity"):
            valid = "the settings that the run began with (its identity differs)"
            raise InputError("file", str(self.path / CONFIG), valid)
        training = remake(description)
        if (self.path / CHECKPOINT).exists():
            training.restore(load_memory(self.path / CHECKPOINT, training.memory))
        return training, int(config["seed"])

    def read_ends(self) -> dict[str, int | None]:
        """Returns the episodes and moves after which the run was to end, None where not said.

        Raises:
            InputError: they are no whole numbers.
        """
        ends = self.read(CONFIG).get("ends")
        values = ends.values() if isinstance(ends, dict) else [ends or "missing"]
        if not all(value is None or isinstance(value, int) for value in values):
            raise InputError("ends", ends, f"whole numbers or null, in {self.path / CONFIG}")
        return dict(ends or {})

    def save(self, training: Training, ended: Episodes) -> None:
        """Writes the episodes that ended since the last time, then the checkpoint."""
        if len(ended):
            first = training.episodes - len(ended)
            columns = {
                "episode": np.arange(first, training.episodes),
                "moves": ended.moves,
                "events": ended.events,
                "success": ended.find_successes(training.task),
                "return": ended.returns,
            }
            # Named after its first episode: a part that is written again takes its own place.
            write_columns(columns, self.path / "episodes" / f"{first:012d}.parquet")
        save_memory(self.path / CHECKPOINT, training.memory)

    def summarize(self, summary: dict[str, Any]) -> None:
        """Writes the summary."""
        self._write(SUMMARY, summary)

    def read(self, name: str) -> dict[str, Any]:
        """Reads one of the JSON files.

        Raises:
            InputError: it is missing or no JSON object.
        """
        path = self.path / name
        try:
            content = json.loads(path.read_bytes())
        except FileNotFoundError:
            raise InputError("run", str(self.path), f"a folder with a {name} in it") from None
        except (ValueError, OSError):
            content = None
        if not isinstance(content, dict):
            raise InputError("file", str(path), "a JSON object that a training wrote")
        return content

    def _write(self, name: str, content: dict[str, Any]) -> None:
        write_atomically(self.path / name, (json.dumps(content, indent=2) + "\n").encode())
