"""Installs hose_mj into fresh environments and runs the smoke tests there: `make test-matrix`.

For every Python of 3.11 to 3.14 on this machine, times MuJoCo 3.17 and 4: the core from the wheel,
then tools/smoke.py. A Python that is not here is resolved alone (`pip install --dry-run`), and so
is the installation beside other people's packages. The table goes into docs/install.md.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "install.md"
MARKS = ("<!-- matrix: written by make test-matrix -->\n", "<!-- end of matrix -->\n")
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
MUJOCOS = ("mujoco==3.17.*", "mujoco>=4,<5")
NEIGHBOURS = ("mjlab==1.6.*", "newton[sim]==1.8.*")
MOST_MEGABYTES = 550
"""What a core installation may take."""
PIP = ("-m", "pip", "--disable-pip-version-check", "--quiet", "--no-input")


class Row(NamedTuple):
    """One line of the table."""

    python: str
    beside: str
    what: str
    status: str
    seconds: float
    megabytes: float | None = None

    def format(self) -> str:
        """Returns the row in Markdown."""
        size = "" if self.megabytes is None else f"{self.megabytes:.0f}"
        cells = (self.python, self.beside, self.what, self.status, f"{self.seconds:.0f}", size)
        return f"| {' | '.join(cells)} |"


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


def install(python: Path, version: str, mujoco: str, wheel: Path, folder: Path) -> Row:
    """Installs the core into a fresh environment and runs the smoke tests."""
    begun = time.perf_counter()
    subprocess.run([str(python), "-m", "venv", str(folder)], check=True)
    own = folder / "bin" / "python"
    done = _run([str(own), *PIP, "install", "--only-binary=:all:", f"{wheel}", mujoco])
    megabytes = sum(f.stat().st_size for f in folder.rglob("*") if f.is_file()) / 1e6
    if done is None:
        done = _run([str(own), str(ROOT / "tools" / "smoke.py")], cwd=folder)
    status = done or ("ok" if megabytes <= MOST_MEGABYTES else f"over {MOST_MEGABYTES} MB")
    seconds = time.perf_counter() - begun
    return Row(version, mujoco, "installed, smoke tests", status, seconds, megabytes)


def resolve(version: str | None, beside: str, wheel: Path) -> Row:
    """Lets pip find versions that go together, and installs nothing."""
    begun = time.perf_counter()
    words = [sys.executable, *PIP, "install", "--dry-run", "--only-binary=:all:"]
    with tempfile.TemporaryDirectory() as folder:
        words += ["--target", folder]
        words += ["--python-version", version] if version else []
        status = _run([*words, str(wheel), beside]) or "resolves"
    shown = version or ".".join(map(str, sys.version_info[:2]))
    return Row(shown, beside, "resolution alone", status, time.perf_counter() - begun)


def _run(words: list[str], cwd: Path | None = None) -> str | None:
    """Runs a program; None if all went well, else the last line that it said."""
    done = subprocess.run(words, capture_output=True, text=True, cwd=cwd)
    if done.returncode == 0:
        return None
    said = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
    return "failed: " + (said[-1] if said else f"status {done.returncode}").replace("|", "/")[:120]


def list_rows(only_resolve: bool) -> Iterator[Row]:
    """Yields the rows as they come."""
    with tempfile.TemporaryDirectory() as name:
        wheel = build_wheel(Path(name) / "wheel")
        for version in PYTHONS:
            python = None if only_resolve else find_python(version)
            for number, mujoco in enumerate(MUJOCOS):
                if python is None:
                    yield resolve(version, mujoco, wheel)
                else:
                    folder = Path(name) / f"{version}-{number}"
                    yield install(python, version, mujoco, wheel, folder)
        for other in NEIGHBOURS:
            yield resolve(None, other, wheel)


def write_table(rows: list[Row]) -> None:
    """Puts the table between the marks of the page."""
    head = ["| Python | beside | what was done | status | s | MB |", "|---|---|---|---|---|---|"]
    table = "\n".join([*head, *(row.format() for row in rows)])
    pattern = re.compile(f"{re.escape(MARKS[0])}.*?{re.escape(MARKS[1])}", re.S)
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(pattern.sub(lambda _: f"{MARKS[0]}{table}\n{MARKS[1]}", text), encoding="utf-8")


def main() -> int:
    """Fills the table; 1 if something failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--resolve", action="store_true", help="install nothing")
    arguments = parser.parse_args()
    rows = []
    for row in list_rows(arguments.resolve):
        print(row.format(), flush=True)
        rows.append(row)
        write_table(rows)
    return int(not all(row.status in ("ok", "resolves") for row in rows))


if __name__ == "__main__":
    sys.exit(main())
