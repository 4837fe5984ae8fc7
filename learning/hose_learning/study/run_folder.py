"""Run folders: what a training was, what happened in it and what it learned.

`config.json` (settings, seed, versions), `episodes/*.parquet` (one part after the other),
`checkpoints/last.npz` with a manifest of hashes, `summary.json`. Each file is replaced as a whole
and the checkpoint last of all, so a run that is killed goes on from its last checkpoint.
"""

import dataclasses
import hashlib
import io
import json
import platform
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hose_learning.modules import Module
from hose_learning.records import Memory
from hose_learning.settings import Exploration, LearnerSettings
from hose_learning.study.training import Episodes, Training
from hose_learning.tables import is_sound
from hose_mj.errors import InputError
from hose_mj.extras import require
from hose_mj.recording.files import write_atomically
from hose_mj.tasks.registry import find_task, make_task
from hose_mj.version import __version__

MANIFEST = "manifest.json"
DESCRIPTION = ("task", "task_options", "learner", "learner_settings", "seed")
"""What `describe` returns."""
OLD_NAMES = {"waited": "steps_since_action", "charged": "caused_events"}
"""Arrays of a memory as checkpoints before version 0.2 name them."""
Arrays = dict[str, npt.NDArray[Any]]


def describe(training: Training, seed: int) -> dict[str, Any]:
    """Returns all settings of a training as plain JSON values."""
    task = training.task
    options = dataclasses.asdict(task.settings)
    try:
        presets = find_task(task.id).presets
    except InputError:  # a task that no registry has
        presets = {}
    return {
        "task": task.id,
        "task_options": {k: v for k, v in options.items() if k not in presets},
        "learner": training.learner_id,
        "learner_settings": dataclasses.asdict(training.settings),
        "seed": seed,
    }


def compute_identity(description: Mapping[str, Any]) -> str:
    """Returns a hash of a description: the same settings have the same identity."""
    text = json.dumps(description, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def remake(description: Mapping[str, Any]) -> Training:
    """Makes a training from its description, before its first move.

    Raises:
        InputError: something is missing or wrong in the description.
    """
    try:
        task = make_task(description["task"], **_freeze(description["task_options"]))
        settings = read_settings(description["learner_settings"])
        generator = np.random.default_rng(int(description["seed"]))
        return Training(task, description["learner"], settings, generator)
    except InputError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        valid = "the settings that a training wrote"
        raise InputError("description", f"{type(error).__name__}: {error}", valid) from None


def read_settings(plain: Mapping[str, Any]) -> LearnerSettings:
    """Makes learner settings from plain JSON values."""
    frozen = dict(_freeze(plain))
    frozen["modules"] = tuple(Module(**module) for module in frozen["modules"])
    frozen["exploration"] = Exploration(**frozen["exploration"])
    return LearnerSettings(**frozen)


def _freeze(value: Any) -> Any:
    """Turns JSON's lists into tuples."""
    if isinstance(value, Mapping):
        return {key: _freeze(item) for key, item in value.items()}
    return tuple(map(_freeze, value)) if isinstance(value, list | tuple) else value


def flatten(memory: Any, prefix: str = "") -> Arrays:
    """Returns the arrays of a memory by dotted names."""
    arrays: Arrays = {}
    if not hasattr(memory, "_asdict"):
        return arrays
    for name, value in memory._asdict().items():
        if isinstance(value, tuple):
            arrays |= flatten(value, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray):
            arrays[prefix + name] = value
    return arrays


def unflatten(memory: Any, arrays: Mapping[str, npt.NDArray[Any]], prefix: str = "") -> Any:
    """Returns a memory like the given one with those arrays in it."""
    if not hasattr(memory, "_asdict"):
        return memory
    fields = {}
    for name, value in memory._asdict().items():
        if isinstance(value, tuple):
            fields[name] = unflatten(value, arrays, f"{prefix}{name}.")
        elif isinstance(value, np.ndarray):
            fields[name] = arrays[prefix + name]
    return memory._replace(**fields)


def save_memory(path: Path, memory: Memory) -> None:
    """Writes a memory, and its SHA-256 into the folder's manifest.

    The manifest comes first and keeps the old file's, so a crash between the two harms nothing.
    """
    stream = io.BytesIO()
    np.savez_compressed(stream, allow_pickle=False, **flatten(memory))
    data = stream.getvalue()
    manifest = read_manifest(path.parent)
    versions = [data, path.read_bytes()] if path.exists() else [data]
    manifest[path.name] = [hashlib.sha256(version).hexdigest() for version in versions]
    write_atomically(path.with_name(MANIFEST), json.dumps(manifest, indent=2).encode())
    write_atomically(path, data)


def read_manifest(folder: Path) -> dict[str, list[str]]:
    """Returns the SHA-256 of each checkpoint in a folder, and that of the one before.

    Raises:
        InputError: a manifest that is no JSON object.
    """
    path = folder / MANIFEST
    if not path.exists():
        return {}
    try:
        manifest = json.loads(path.read_bytes())
    except ValueError:
        manifest = None
    if not isinstance(manifest, dict):
        raise InputError("manifest", str(path), "a JSON object that a training wrote")
    return manifest


def load_memory(path: Path, like: Memory) -> Memory:
    """Reads a memory; `like` fits the same learner, only the sizes of hashed tables may differ.

    `InputError` is raised for a file that is missing, damaged, changed since it was written, or of
    another learner.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("checkpoint", str(path), "a file that a training wrote")
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() not in read_manifest(path.parent).get(path.name, ()):
        raise InputError("checkpoint", str(path), "the file that was written (its hash differs)")
    wanted = flatten(like)
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            arrays = {OLD_NAMES.get(name, name): stored[name] for name in stored.files}
    except (ValueError, TypeError, OSError, EOFError, zipfile.BadZipFile, zlib.error):
        raise InputError("checkpoint", str(path), "an npz file of arrays, whole") from None
    for name, array in wanted.items():
        if name not in arrays:
            raise InputError("checkpoint", str(path), f"one with the array {name}")
        grows = name.startswith(("table.", "vetoes.")) and len(wanted[name.split(".")[0] + ".keys"])
        found, dims = arrays[name], slice(1 if grows else 0, None)
        fits = found.dtype == array.dtype and found.ndim == array.ndim
        if not fits or found.shape[dims] != array.shape[dims] or (grows and len(found) == 0):
            shape = f"{array.dtype}{array.shape}"
            raise InputError("checkpoint", str(path), f"one where {name} is {shape}")
    memory: Memory = unflatten(like, arrays)
    for name, table in (("table", memory.table), ("vetoes", memory.vetoes)):
        if not is_sound(table):
            raise InputError("checkpoint", str(path), f"one whose {name} has room for its keys")
    return memory


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
        """Writes the settings of a new run, once it is sure that its episodes can be written.

        Args:
            training: before its first move.
            seed: what its generator was made from.
            ends: episodes and moves after which it is to end; no part of its identity.

        Raises:
            InputError: the folder holds a run already.
            MissingExtra: the extra `report` is not installed.
        """
        require("pyarrow", "a run folder")
        if (self.path / CONFIG).exists():
            raise InputError("out", str(self.path), "a folder without a run in it (or --resume it)")
        description = describe(training, seed)
        config = {
            **description,
            "identity": compute_identity(description),
            "ends": dict(ends or {}),
        }
        versions = {"hose_mj": __version__, "numpy": np.__version__}
        config["versions"] = {**versions, "python": platform.python_version()}
        self._write(CONFIG, config)

    def open(self) -> tuple[Training, int]:
        """Returns the run's training where it stopped, and its seed.

        Raises:
            InputError: no run is in the folder, or a file of it is damaged.
        """
        config = self.read(CONFIG)
        require("pyarrow", "a run folder")
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
            from hose_mj.recording.parquet import write_columns

            # Named after its first episode: a part that is written again takes its own place.
            write_columns(columns, self.path / "episodes" / f"{first:012d}.parquet")
        save_memory(self.path / CHECKPOINT, training.memory)

    def summarize(self, summary: dict[str, Any]) -> None:
        """Writes the summary."""
        self._write(SUMMARY, summary)

    def read(self, name: str) -> dict[str, Any]:
        """Reads one of the JSON files; `InputError` where it is missing or no JSON object."""
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
