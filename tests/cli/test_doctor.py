"""The doctor: its document, and that it finds what is broken."""

from __future__ import annotations

import importlib.metadata
import json
import subprocess
import sys
import tomllib
from functools import partial
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import hose_mj
from hose_mj.cli import doctor
from hose_mj.cli import main as cli
from hose_mj.extras import EXTRAS

ROOT = Path(__file__).resolve().parents[2]


def find(name):
    return next(finding for finding in doctor.examine() if finding.name == name)


def pretend_versions(monkeypatch, **versions):
    installed = importlib.metadata.version

    def version(name):
        found = versions.get(name.replace("-", "_"), installed)
        return found(name) if callable(found) else found

    monkeypatch.setattr(importlib.metadata, "version", version)


def test_json_document(capsys):
    status = cli.main(["doctor", "--json"])
    shown = json.loads(capsys.readouterr().out)
    assert shown["command"] == "doctor"
    assert shown["seed"] is None
    for key in ("version", "revision", "machine", "settings"):
        assert key in shown
    assert {"python", "mujoco", "rerun-sdk", "composite cable", "kernel cache"} <= {
        check["name"] for check in shown["checks"]
    }
    for check in shown["checks"]:
        assert set(check) == {"name", "value", "limit", "ok", "state", "remedy"}
    assert status == int(not all(check["ok"] for check in shown["checks"]))


def test_this_installation_is_well(capsys):
    assert cli.main(["doctor"]) == 0
    assert "All that simulation and learning need is here." in capsys.readouterr().out


def test_mujoco_4_costs_the_cable_alone(monkeypatch, capsys):
    pretend_versions(monkeypatch, mujoco="4.0.0")
    assert cli.main(["doctor"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "warning mujoco (extra cable): MuJoCo 4 has no composite cable" in out
    assert "pip install 'hose-mj[cable]'" in out


def test_a_missing_extra_is_a_warning_with_its_name():
    finding = doctor.examine_dependency(Requirement("no-such-package>=1"), "viewer")
    assert (finding.state, finding.ok) == ("warning", True)
    assert finding.remedy == "pip install 'hose-mj[viewer]'"


def test_what_one_extra_brings_is_one_line(capsys):
    finding = partial(doctor.Finding, value="", limit="", satisfied=False, required=False)
    doctor.print_table([finding(name=name, remedy="install it") for name in ("one", "two")])
    assert "warning one, two: install it\n" in capsys.readouterr().out


def test_mujoco_4_is_named_where_the_cable_is_gone(monkeypatch):
    monkeypatch.setattr("mujoco.__version__", "4.0.0")
    finding = doctor.examine_cable_plugin()
    assert (finding.value, finding.ok) == ("none in MuJoCo 4.0.0", True)


def test_every_extra_is_known_by_its_modules():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {*EXTRAS, "all", "dev"} == {*project["optional-dependencies"]}


def test_a_missing_package(monkeypatch):
    finding = doctor.examine_dependency(Requirement("no-such-package>=1"))
    assert (finding.value, finding.state) == ("not installed", "failed")
    assert finding.remedy == 'pip install "no-such-package>=1"'


def test_an_unsupported_python(monkeypatch):
    assert doctor.examine_python(SpecifierSet("<3.0")).state == "failed"


def test_requirements_of_an_installed_copy(tmp_path, monkeypatch):
    monkeypatch.setattr(hose_mj, "__file__", str(tmp_path / "hose_mj" / "__init__.py"))
    headers = importlib.metadata.PathDistribution(tmp_path)
    (tmp_path / "METADATA").write_text(
        "Metadata-Version: 2.4\nName: hose-mj\nVersion: 0.1.0\nRequires-Python: <3.13,>=3.11\n"
        "Requires-Dist: mujoco<5,>=3.11\nRequires-Dist: pytest>=9; extra == 'dev'\n"
        "Requires-Dist: rerun-sdk>=0.41; extra == 'viewer'\n"
        "Provides-Extra: dev\nProvides-Extra: viewer\n"
    )
    monkeypatch.setattr(importlib.metadata, "metadata", lambda name: headers.metadata)
    python, requirements = doctor.read_requirements()
    assert python.contains("3.12.1")
    assert {r.name: extra for r, extra in requirements.items()} == {
        "mujoco": "",
        "rerun-sdk": "viewer",
    }


def test_a_mujoco_without_the_cable(monkeypatch):
    monkeypatch.setattr(doctor, "CABLE_SCENE", doctor.CABLE_SCENE.replace('type="cable"', ""))
    finding = doctor.examine_cable_plugin()
    assert finding.state == "warning"
    assert finding.remedy == doctor.MUJOCO_REMEDY
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert doctor.examine_cable_plugin().state == "warning"


def test_a_kernel_cache_that_cannot_be_written(monkeypatch, tmp_path):
    from numba.core import caching

    def refuse(function):
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(caching, "FunctionCache", refuse)
    finding = doctor.examine_kernel_cache()
    assert finding.state == "failed"
    assert "NUMBA_CACHE_DIR" in finding.remedy


@pytest.mark.skipif(sys.platform != "linux", reason="looked for on Linux only")
class TestViewerOnLinux:
    def test_no_vulkan_driver_is_a_warning_with_the_packages(self, monkeypatch, tmp_path):
        monkeypatch.setattr(doctor, "has_library", lambda name: True)
        monkeypatch.setattr(doctor, "find_vulkan_drivers", list)
        finding = doctor.examine_vulkan()
        assert (finding.state, finding.ok) == ("warning", True)
        assert "mesa-vulkan-drivers libvulkan1" in finding.remedy

    def test_drivers_are_found_where_the_environment_says(self, monkeypatch, tmp_path):
        manifest = tmp_path / "vulkan" / "icd.d" / "some_icd.json"
        manifest.parent.mkdir(parents=True)
        manifest.write_text("{}")
        monkeypatch.setattr(doctor, "has_library", lambda name: True)
        for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
            monkeypatch.delenv(name, raising=False)
        monkeypatch.setenv("XDG_DATA_DIRS", str(tmp_path))
        assert manifest in doctor.find_vulkan_drivers()
        monkeypatch.setenv("VK_DRIVER_FILES", str(manifest))
        assert doctor.examine_vulkan().value == "some_icd"

    def test_no_loader(self, monkeypatch):
        monkeypatch.setattr(doctor, "has_library", lambda name: False)
        assert doctor.examine_vulkan().state == "warning"

    def test_display(self, monkeypatch):
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        monkeypatch.delenv("DISPLAY", raising=False)
        assert doctor.examine_display().state == "warning"
        monkeypatch.setenv("DISPLAY", ":0")
        assert doctor.examine_display().state == "ok"


def test_a_missing_viewer_is_a_warning(monkeypatch):
    monkeypatch.setattr(doctor.shutil, "which", lambda name, path: None)
    assert find("viewer").state == "warning"


def test_as_a_program():
    words = [sys.executable, "-m", "hose_mj.cli.main", "doctor", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["command"] == "doctor"
