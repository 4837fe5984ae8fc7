"""Installs hose_mj into fresh environments and runs the smoke tests there: `make test-matrix`.

For every Python of 3.11 to 3.14 on this machine, times MuJoCo 3.17 and 4: the core from the wheel,
then tools/smoke.py. A Python that is not here is resolved alone (`pip install --dry-run`), and so
is the installation beside other people's packages. The table goes into docs/install.md.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "install.md"
MARKS = ("<!-- matrix: written by make test-matrix -->\n", "<!-- end of matrix -->\n")
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
MUJOCOS = ("mujoco==3.17.*", "mujoco>=4,<5")
NEIGHBOURS = ("mjlab==1.6.*", "newton[sim]==1.8.*")
MOST_MEGABYTES = 550
"""What a core installation may add to an empty environment, in 2^20 bytes of disk."""
PIP = ("-m", "pip", "--disable-pip-version-check", "--quiet", "--no-input")


class Row(NamedTuple):
    """One line of the table: seconds on the wall, and of the processors."""

    python: str
    beside: str
    what: str
    status: str
    seconds: float
    busy: float
    megabytes: float | None = None

    def format(self) -> str:
        """Returns the row in Markdown."""
        size = "" if self.megabytes is None else f"{self.megabytes:.0f}"
        times = (f"{self.seconds:.0f}", f"{self.busy:.0f}")
        cells = (self.python, f"`{self.beside}`", self.what, self.status, *times, size)
        return f"| {' | '.join(cells)} |"


class Runs:
    """Runs programs one after the other until one fails; adds up what they take."""

    def __init__(self) -> None:
        self.begun = time.perf_counter()
        self.busy = 0.0
        self.failure = ""

    def run(self, words: list[str], cwd: Path | None = None) -> None:
        """Runs a program, unless one has failed; keeps the last line of one that fails."""
        if self.failure:
            return
        with tempfile.TemporaryFile("w+", encoding="utf-8") as said:
            child = subprocess.Popen(words, cwd=cwd, stdout=said, stderr=subprocess.STDOUT)
            _, status, used = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
            said.seek(0)
            lines = [line.strip() for line in said if line.strip()] or [f"status {status}"]
        self.busy += used.ru_utime + used.ru_stime
        if child.returncode:
            self.failure = "failed: " + lines[-1].replace("|", "/")[:120]

    @property
    def seconds(self) -> float:
        """What has passed since the beginning."""
        return time.perf_counter() - self.begun


def find_python(version: str) -> Path | None:
    """Returns an interpreter of that version that runs: on the PATH, or pyenv's."""
    kept = sorted((Path.home() / ".pyenv" / "versions").glob(f"{version}.*/bin/python"))
    for candidate in (f"python{version}", *map(str, kept)):
        code = f"import sys; sys.exit('%d.%d' % sys.version_info[:2] != '{version}')"
        try:
            done = subprocess.run([candidate, "-c", code], capture_output=True, timeout=60)
        except OSError:
            continue
        if done.returncode == 0:
            return Path(candidate)
    return None


def build_wheel(folder: Path) -> Path:
    """Builds the wheel of this checkout."""
    words = [sys.executable, *PIP, "wheel", "--no-deps", "--wheel-dir", str(folder), str(ROOT)]
    subprocess.run(words, check=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


def install(version: str, mujoco: str, wheel: Path, python: Path, folder: Path) -> Row:
    """Installs the core into a fresh environment and runs the smoke tests."""
    runs, own = Runs(), str(folder / "bin" / "python")
    runs.run([str(python), "-m", "venv", str(folder)])
    empty = measure(folder)
    runs.run([own, *PIP, "install", "--only-binary=:all:", str(wheel), mujoco])
    megabytes = measure(folder) - empty
    runs.run([own, str(ROOT / "tools" / "smoke.py")], cwd=folder)
    fits = megabytes <= MOST_MEGABYTES
    status = runs.failure or ("ok" if fits else f"over {MOST_MEGABYTES} MB")
    what = "installed, smoke tests"
    return Row(version, mujoco, what, status, runs.seconds, runs.busy, megabytes)


def measure(folder: Path) -> float:
    """Returns the disk that a folder takes, in 2^20 bytes, as `du -sm` does."""
    return sum(file.lstat().st_blocks for file in folder.rglob("*")) * 512 / 2**20


def resolve(version: str | None, beside: str, wheel: Path) -> Row:
    """Lets pip find versions that go together, and installs nothing."""
    words = [sys.executable, *PIP, "install", "--dry-run", "--only-binary=:all:"]
    runs = Runs()
    with tempfile.TemporaryDirectory() as folder:
        words += ["--target", folder]
        words += ["--python-version", version] if version else []
        runs.run([*words, str(wheel), beside])
    shown = version or ".".join(map(str, sys.version_info[:2]))
    status = runs.failure or "resolves"
    return Row(shown, beside, "resolution alone", status, runs.seconds, runs.busy)


def list_jobs(only_resolve: bool, folder: Path) -> Iterator[Callable[[], Row]]:
    """Yields what makes each row."""
    wheel = build_wheel(folder / "wheel")
    for version in PYTHONS:
        python = None if only_resolve else find_python(version)
        for number, mujoco in enumerate(MUJOCOS):
            if python is None:
                yield partial(resolve, version, mujoco, wheel)
            else:
                own = folder / f"{version}-{number}"
                yield partial(install, version, mujoco, wheel, python, own)
    for other in NEIGHBOURS:
        yield partial(resolve, None, other, wheel)


def write_table(rows: list[Row]) -> None:
    """Puts the table between the marks of the page."""
    head = ["| Python | beside | what was done | status | s | CPU s | MB |", f"|{'---|' * 7}"]
    table = "\n".join([*head, *(row.format() for row in rows)])
    pattern = re.compile(f"{re.escape(MARKS[0])}.*?{re.escape(MARKS[1])}", re.S)
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(pattern.sub(lambda _: f"{MARKS[0]}{table}\n{MARKS[1]}", text), encoding="utf-8")


def main() -> int:
    """Fills the table; 1 if something failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--resolve", action="store_true", help="install nothing")
    parser.add_argument("--jobs", type=int, default=1, help="so many rows at a time")
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(arguments.jobs) as pool:
        jobs = list(list_jobs(arguments.resolve, Path(folder)))
        for row in pool.map(lambda job: job(), jobs):
            print(row.format(), flush=True)
            rows.append(row)
            write_table(rows)
    return int(not all(row.status in ("ok", "resolves") for row in rows))


if __name__ == "__main__":
    sys.exit(main())
