"""What a user gets who installs the wheel instead of working in a checkout."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

for module in ("hatchling", "hatch_fancy_pypi_readme"):
    pytest.importorskip(module, reason=f"builds with {module} (extra dev)")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of this tree, built without the network."""
    folder = tmp_path_factory.mktemp("dist")
    words = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    (file,) = folder.glob("*.whl")
    return file


def test_contents(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (entry_points,) = (archive.read(n) for n in names if n.endswith("/entry_points.txt"))
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {
        *("hose_mj", "hose_learning"),
    }
    assert {"hose_mj/py.typed", "hose_mj/errors.py", "hose_learning/__init__.py"} <= names
    assert b"hose-mj = hose_mj.cli.main:main" in entry_points
    assert not [name for name in names if "__pycache__" in name or name.endswith(".rrd")]


def test_every_asset_is_inside(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    listed = subprocess.run(
        ["git", "ls-files", "assets"], cwd=ROOT, capture_output=True, text=True
    ).stdout.split()
    assert {f"hose_mj/{name}" for name in listed} <= names


def test_the_description_works_outside_the_repository(wheel):
    with zipfile.ZipFile(wheel) as archive:
        (metadata,) = (archive.read(n) for n in archive.namelist() if n.endswith("/METADATA"))
    description = metadata.decode().partition("\n\n")[2]
    prose = re.sub(r"```.*?```|`[^`\n]*`", "", description, flags=re.S)
    targets = re.findall(r"\]\(([^)\s]*)|\b(?:src|href)=[\"']([^\"']*)", prose)
    assert len(targets) > 20
    assert not [t for pair in targets for t in pair if t and not re.match("https?://|mailto:|#", t)]
    pictures = re.findall(r"!\[[^\]]*\]\(([^)\s]*)", prose)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(pictures) == readme.count("![")
    assert all("/raw/" in picture for picture in pictures)


def test_the_materials_are_found_in_the_wheel(wheel, tmp_path):
    zipfile.ZipFile(wheel).extractall(tmp_path)
    code = (
        "from hose_mj.assets import find_assets;"
        "from hose_mj.scenes.hose_file.hose_file import read_hose_file;"
        "print(find_assets(), read_hose_file(find_assets() / 'hoses' / 'usb_cable.toml').title)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "hose_mj" / "assets"
    assert done.stdout.strip() == f"{folder} USB cable between two plugs"


def test_the_doctor_runs_from_the_wheel(wheel, tmp_path):
    zipfile.ZipFile(wheel).extractall(tmp_path)
    code = (
        "import sys, hose_mj; from hose_mj.cli.main import main;"
        "print(hose_mj.__file__, file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", f"{code}; sys.exit(main(['doctor', '--json']))"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert Path(done.stderr).is_relative_to(tmp_path)
    shown = json.loads(done.stdout)
    assert shown["revision"] is None
    assert {"mujoco", "numba"} <= {check["name"] for check in shown["checks"]}
