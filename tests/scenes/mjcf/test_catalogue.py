"""Scenes by name: shipped ones, those of other packages, and what is wrong with an entry point."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from hose_mj import plugins
from hose_mj.errors import InputError
from hose_mj.scenes import mjcf
from hose_mj.scenes.mjcf.catalogue import find_named, find_scene, list_scenes

ROOT = Path(__file__).resolve().parents[3]
SHIPPED = ("corridor", "deck", *(f"floor_{n}" for n in range(1, 7)), "lift")


@pytest.fixture
def add_scenes(tmp_path, monkeypatch):
    """Lets a package "yard_scenes" add entry points: name of the scene, what of the package."""
    folder = tmp_path / "yard_scenes"
    (folder / "mjcf").mkdir(parents=True)
    text = (ROOT / "assets/scenes/floor_1.xml").read_text()
    for place in ("yard.xml", "mjcf/field.xml"):
        (folder / place).write_text(text)
    (folder / "__init__.py").write_text(
        "from pathlib import Path\n"
        "HERE = Path(__file__).parent\n"
        "FILE, FOLDER, GONE = str(HERE / 'yard.xml'), HERE / 'mjcf', HERE / 'gone.xml'\n"
        "NUMBER = 7\n"
        "def find():\n    return FOLDER\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    entries: list[EntryPoint] = []

    def find(group):
        return [entry for entry in entries if entry.group == group]

    monkeypatch.setattr(plugins, "entry_points", find)

    def add(name, value):
        entries.append(EntryPoint(name, f"yard_scenes{value}", "hose_mj.scenes"))
        return folder

    yield add
    sys.modules.pop("yard_scenes", None)


@pytest.mark.parametrize(
    ("name", "value", "file"),
    [
        ("yard", "", "yard.xml"),
        ("yard", ":FILE", "yard.xml"),
        ("far", ":FILE", "yard.xml"),
        ("field", ":FOLDER", "mjcf/field.xml"),
        ("field", ":find", "mjcf/field.xml"),
    ],
)
def test_other_packages_add_scenes(add_scenes, name, value, file):
    folder = add_scenes(name, value)
    assert list_scenes() == (*SHIPPED, name)
    assert find_scene(name) == folder / file
    assert find_named("floor_1") == find_scene("floor_1")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("yard", ":GONE", "gone.xml"),
        ("other", "", "other.xml"),
        ("yard", ":NUMBER", "'7'; valid: the path"),
        ("yard", ":nothing", "importable"),
    ],
)
def test_a_wrong_entry_is_one_error(add_scenes, name, value, said):
    add_scenes(name, value)
    with pytest.raises(InputError, match=said):
        find_scene(name)


def test_shipped_scenes_win(add_scenes):
    add_scenes("lift", "")
    assert find_scene("lift").parent.name == "scenes"
    with pytest.raises(InputError, match=r"lift.*hose_mj's own"):
        list_scenes()


def test_files_are_no_names(tmp_path, monkeypatch):
    assert find_named(tmp_path / "floor_1") is None
    assert find_named("floor_1.xml") is None
    for find in (find_scene, mjcf.read_scene):
        with pytest.raises(InputError, match=r"floor_1, floor_2.*\(did you mean floor_\d\?\)"):
            find("floor_7")
        with pytest.raises(InputError, match="scene is None; valid: the name of a scene"):
            find(None)


def test_a_scene_is_read_by_its_name():
    assert mjcf.read_scene("floor_1").path == find_scene("floor_1")
    with pytest.raises(AttributeError, match="no_such"):
        _ = mjcf.no_such
