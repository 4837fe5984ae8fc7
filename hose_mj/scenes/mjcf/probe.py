"""What MuJoCo makes of a scene, found in a process of its own (this module as a program).

A scene is a stranger's file, and MuJoCo is native code: a file may crash it, hang it or eat all
memory. `probe` has a child with limits compile the scene, check the compiled numbers and take one
step; what comes back is a record of plain values, or one `InputError`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

from hose_mj.errors import InputError
from hose_mj.scenes.mjcf.files import shorten

LONGEST = 20
"""Seconds that the child may take."""
LARGEST_MEMORY = 4 << 30
"""Bytes of address space that the child may take."""
_LARGEST_ANSWER = 4_000_000


def probe(path: Path) -> dict[str, Any]:
    """Returns what `mjcf_model.inspect_scene` finds in a scene, asked in a child process.

    Raises:
        InputError: what it raised there; or a scene that crashed the child or exceeded its limits.
    """
    thing, name = "file", shorten(path.name)
    valid = f"a scene that MuJoCo compiles within {LONGEST} s and {LARGEST_MEMORY >> 30} GiB"
    package = str(Path(__file__).resolve().parents[2])
    known = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(known), "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo writes its log where it runs
        try:
            done = subprocess.run(
                [sys.executable, "-m", __spec__.name, str(path)],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                timeout=2 * LONGEST,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise InputError(thing, name, f"{valid} (it took longer)") from error
    lines = done.stdout[-_LARGEST_ANSWER:].splitlines()
    try:
        answer = json.loads(lines[-1])
    except (IndexError, ValueError) as error:
        why = f"its process ended with status {done.returncode}"
        raise InputError(thing, name, f"{valid} ({why})") from error
    if "error" in answer:
        raise InputError(*answer["error"])
    return dict(answer)


def limit_resources() -> None:
    """Bounds the time, memory and files of this process, where the system can."""
    try:
        import resource
    except ImportError:
        return
    for which, most in (
        (resource.RLIMIT_CPU, LONGEST),
        (resource.RLIMIT_AS, LARGEST_MEMORY),
        (resource.RLIMIT_FSIZE, 1 << 20),
        (resource.RLIMIT_CORE, 0),
    ):
        with suppress(ValueError, OSError):
            resource.setrlimit(which, (most, most))


def main(path: Path) -> None:
    """Prints what is found in a scene, or its error, as the last line: one JSON document."""
    limit_resources()
    from hose_mj.scenes.mjcf.model import inspect_scene

    try:
        answer = inspect_scene(path)
    except InputError as error:
        value = error.value
        plain = value if isinstance(value, (str, int, float, type(None))) else repr(value)
        answer = {"error": [error.thing, plain, error.valid]}
    except MemoryError:
        valid = f"a scene that takes at most {LARGEST_MEMORY >> 30} GiB"
        answer = {"error": ["file", shorten(path.name), valid]}
    sys.stdout.write("\n" + json.dumps(answer) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
