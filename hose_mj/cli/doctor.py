"""Checks that this installation has what hose_mj needs, and says what to do where it has not.

It fails only for what every installation needs; a missing extra, and what the viewer needs, is a
warning.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
import os
import platform
import shutil
import sys
import sysconfig
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import hose_mj
from hose_mj.recording.document import make_document, print_document

VIEWER_PACKAGES = "mesa-vulkan-drivers libvulkan1"
MUJOCO_REMEDY = (
    "MuJoCo 4 has no composite cable and dm-control cannot load it, the rest runs; for the cable: "
    "pip install 'hose-mj[cable]'"
)
QUIET_EXTRAS = ("dev", "deep", "cluster", "all")
"""Extras that nobody misses who does not ask for them."""
CABLE_SCENE = """
<mujoco>
  <extension><plugin plugin="mujoco.elasticity.cable"/></extension>
  <worldbody>
    <composite type="cable" prefix="hose" curve="s" count="4 1 1" size="1">
      <plugin plugin="mujoco.elasticity.cable"/>
      <geom type="capsule" size="0.01"/>
    </composite>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True)
class Args:
    """Check that this installation has what hose_mj needs."""

    json: bool = False  # Print one JSON document instead of the table.


@dataclass(frozen=True)
class Finding:
    """One thing that was looked for."""

    name: str  # what was looked for
    value: str  # what was found
    limit: str  # what is wanted
    satisfied: bool  # whether the one satisfies the other
    remedy: str  # what to do if not
    # True if nothing works without it, False if only an optional part suffers.
    required: bool = True

    @property
    def ok(self) -> bool:
        """False only for what makes the command fail; a warning is ok."""
        return self.satisfied or not self.required

    @property
    def state(self) -> str:
        """``ok``, ``warning`` or ``failed``."""
        if self.satisfied:
            return "ok"
        return "failed" if self.required else "warning"

    def as_record(self) -> dict[str, Any]:
        """Returns the finding as it stands in a document; `remedy` is null where all is well."""
        facts = {"name": self.name, "value": self.value, "limit": self.limit, "ok": self.ok}
        return {**facts, "state": self.state, "remedy": None if self.satisfied else self.remedy}


def run(args: Args) -> int:
    """Looks at everything, prints what was found, returns 1 if something required is missing."""
    findings = list(examine())
    if args.json:
        print_document(make_document("doctor", args, checks=findings))
    else:
        print_table(findings)
    return int(not all(finding.ok for finding in findings))


def examine() -> Iterator[Finding]:
    """Yields the findings one after the other; each takes well under a second."""
    wanted_python, requirements = read_requirements()
    yield examine_python(wanted_python)
    for requirement, extra in requirements.items():
        yield examine_dependency(requirement, extra)
    yield examine_cable_plugin()
    yield examine_kernel_cache()
    yield examine_viewer()
    yield examine_vulkan()
    yield examine_display()


def read_requirements() -> tuple[SpecifierSet, dict[Requirement, str]]:
    """Returns the wanted Python, and the extra ("" for none) that wants each package here.

    From pyproject.toml in a checkout, else as installed.
    """
    project = Path(hose_mj.__file__).resolve().parent.parent / "pyproject.toml"
    if project.is_file():
        table = tomllib.loads(project.read_text(encoding="utf-8"))["project"]
        python = table["requires-python"]
        extras = {"": table["dependencies"], **table["optional-dependencies"]}
        lines = [(line, extra) for extra, group in extras.items() for line in group]
    else:
        metadata = importlib.metadata.metadata("hose-mj")
        python, names = metadata["Requires-Python"], metadata.get_all("Provides-Extra") or []
        every = metadata.get_all("Requires-Dist") or []
        lines = [(line, extra) for extra in ("", *names) for line in every]
    wanted: dict[Requirement, str] = {}
    for line, extra in lines:
        requirement = Requirement(line)
        is_wanted = requirement.marker is None or requirement.marker.evaluate({"extra": extra})
        if is_wanted and extra not in QUIET_EXTRAS:
            wanted.setdefault(requirement, extra)
    return SpecifierSet(python), wanted


def examine_python(wanted: SpecifierSet) -> Finding:
    """Holds the running Python against the wanted one."""
    version = platform.python_version()
    remedy = "make the virtual environment again, with a later Python (make demo PYTHON=python3.12)"
    return Finding("python", version, str(wanted), wanted.contains(version, True), remedy)


def examine_dependency(requirement: Requirement, extra: str = "") -> Finding:
    """Holds the installed version of a package against the wanted range; only warns of an extra."""
    name, wanted = requirement.name, requirement.specifier
    remedy = f"pip install 'hose-mj[{extra}]'" if extra else f'pip install "{requirement}"'
    shown = f"{name} (extra {extra})" if extra and name == "mujoco" else name
    if extra and name == "mujoco":
        remedy = MUJOCO_REMEDY
    try:
        version = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return Finding(shown, "not installed", str(wanted), False, remedy, not extra)
    fits = wanted.contains(version, prereleases=True)
    return Finding(shown, version, str(wanted), fits, remedy, not extra)


def examine_cable_plugin() -> Finding:
    """Compiles a cable of three segments, which MuJoCo can only with its elasticity plugin."""
    name, wanted = "composite cable", "compiles with the elasticity plugin"
    try:
        import mujoco

        if int(mujoco.__version__.partition(".")[0]) >= 4:
            found = f"none in MuJoCo {mujoco.__version__}"
            return Finding(name, found, wanted, False, MUJOCO_REMEDY, False)
        model = mujoco.MjModel.from_xml_string(CABLE_SCENE)
    except Exception as error:  # whatever stops it (an import, a parser) is the finding
        return Finding(name, describe(error), wanted, False, MUJOCO_REMEDY, False)
    fits = model.nplugin == 1
    return Finding(name, f"{model.nplugin} plugin", wanted, fits, "reinstall mujoco", False)


def examine_kernel_cache() -> Finding:
    """Asks numba where it would cache a kernel of this package; it tries to write there."""
    name, wanted = "kernel cache", "a folder that numba can write"
    remedy = "set NUMBA_CACHE_DIR to a folder of yours; else every start compiles for a minute"
    try:
        from numba.core.caching import FunctionCache

        folder = FunctionCache(hose_mj.__getattr__).cache_path  # type: ignore[no-untyped-call]
    except Exception as error:  # numba raises RuntimeError, its import anything
        return Finding(name, describe(error), wanted, False, remedy)
    return Finding(name, folder, wanted, True, remedy)


def examine_viewer() -> Finding:
    """Looks for the Rerun viewer's program, which comes with rerun-sdk."""
    places = os.pathsep.join([sysconfig.get_path("scripts"), os.environ.get("PATH", "")])
    found = shutil.which("rerun", path=places) or ""
    facts = ("the program rerun", bool(found), "pip install 'hose-mj[viewer]'")
    return Finding("viewer", found or "not found", *facts, False)


def examine_vulkan() -> Finding:
    """Looks for what draws a screenshot without a display: a Vulkan loader and a driver."""
    name, wanted = "Vulkan driver", "a loader and a driver, for screenshots of recordings"
    remedy = f"on Debian and Ubuntu: apt-get install {VIEWER_PACKAGES}"
    if sys.platform != "linux":
        return Finding(name, f"that of {platform.system()}", wanted, True, remedy, False)
    drivers = sorted({file.stem for file in find_vulkan_drivers()})
    if not has_library("libvulkan.so.1"):
        return Finding(name, "no libvulkan.so.1", wanted, False, remedy, False)
    found = ", ".join(drivers) or "loader without a driver"
    return Finding(name, found, wanted, bool(drivers), remedy, False)


def find_vulkan_drivers() -> list[Path]:
    """Returns the driver manifests (ICD files) that the Vulkan loader would read on Linux."""
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if named:
        return [Path(file) for file in named.split(os.pathsep) if Path(file).is_file()]
    shared = os.environ.get("XDG_DATA_DIRS") or "/usr/local/share:/usr/share"
    roots = ["/etc", "/usr/local/etc", str(Path.home() / ".local/share"), *shared.split(os.pathsep)]
    return [file for root in roots for file in Path(root, "vulkan", "icd.d").glob("*.json")]


def has_library(name: str) -> bool:
    """Says whether the system's loader finds a shared library."""
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def examine_display() -> Finding:
    """Looks for a display that `hose-mj view` could open a window on."""
    name, wanted = "display", "a display, to open the viewer's window"
    remedy = "save a recording (--save) and open it elsewhere, or take a screenshot of it"
    if sys.platform != "linux":
        return Finding(name, f"that of {platform.system()}", wanted, True, remedy, False)
    found = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY")
    return Finding(name, found or "none", wanted, bool(found), remedy, False)


def describe(error: Exception) -> str:
    """Returns the first line of an error with its kind."""
    lines = str(error).splitlines() or [""]
    return f"{type(error).__name__}: {lines[0]}"


def print_table(findings: list[Finding]) -> None:
    """Prints the findings as a table, then what to do about those that are not as wanted."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    colors = {"ok": "green", "warning": "yellow", "failed": "bold red"}
    table = Table("check", "", box=None, pad_edge=False)
    table.add_column("found", overflow="fold")
    table.add_column("wanted")
    for finding in findings:
        state = Text(finding.state, colors[finding.state])
        table.add_row(finding.name, state, Text(finding.value), Text(finding.limit))
    console = Console()
    console.print(table)
    missed: dict[tuple[str, str], list[str]] = {}
    for finding in findings:
        if not finding.satisfied:
            missed.setdefault((finding.state, finding.remedy), []).append(finding.name)
    for (kind, remedy), names in missed.items():
        console.print(Text(kind, colors[kind]), Text(f"{', '.join(names)}: {remedy}"))
    if all(finding.ok for finding in findings):
        console.print("All that simulation and learning need is here.")
