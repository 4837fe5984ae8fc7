"""Names that modules had before: one module under both, a warning, and what is the user's stays."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

from hose_mj.moved import MOVED

NEW = {
    **{old: new for old, new in MOVED.items() if "." in old and "dm_world" not in old},
    "learning.components.rules": "hose_learning.rules",  # what only a moved package has
}


def test_an_old_name_is_the_module_itself_and_says_so():
    """In any order: a package that was imported first must not hand out second copies."""
    program = f"""
import importlib, warnings
import hose_mj
for old, new in {NEW!r}.items():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        module = importlib.import_module(old)
    said = [str(one.message) for one in caught if one.category is DeprecationWarning]
    assert module is importlib.import_module(new), old
    assert said.count(f"{{old}} is {{new}} now") == 1, (old, said)
    assert module.__name__ == module.__spec__.name == new
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=300)


@pytest.mark.parametrize("is_package", [True, False])
def test_a_folder_of_the_users_own_wins(tmp_path, is_package):
    (tmp_path / "learning" / "study").mkdir(parents=True)
    (tmp_path / "learning" / "study" / "mine.py").write_text("X = 1")
    (tmp_path / "learning" / "settings.py").write_text("X = 2")
    if is_package:
        (tmp_path / "learning" / "__init__.py").touch()
    program = """
import hose_mj, learning.settings, learning.study.mine
print(learning.settings.X, learning.study.mine.X)
"""
    command = [sys.executable, "-W", "error", "-c", program]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300
    )
    assert done.stdout == "2 1\n"


def test_folders_that_an_update_leaves_behind_do_not_count(tmp_path, monkeypatch):
    (tmp_path / "learning" / "study" / "__pycache__").mkdir(parents=True)
    monkeypatch.syspath_prepend(tmp_path)
    names = [name for name in sys.modules if name.partition(".")[0] == "learning"]
    for name in names:
        monkeypatch.delitem(sys.modules, name)
    with pytest.warns(DeprecationWarning, match="learning.study is hose_learning.study now"):
        assert importlib.import_module("learning.study").__name__ == "hose_learning.study"
    for name in [name for name in sys.modules if name.partition(".")[0] == "learning"]:
        del sys.modules[name]
