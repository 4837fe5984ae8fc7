"""Entry points of other packages: found without an import, loaded with one clear error."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from hose_mj.cli.main import main
from hose_mj.errors import InputError
from hose_mj.plugins import find_plugins, load_plugin

GROUP = "hose_mj.tests"


def install(folder, package, text, group=GROUP, **modules):
    """Puts an installed package, as importlib.metadata sees it, into a folder on the path."""
    information = folder / f"{package}-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(f"[{group}]\n{text}\n", "utf-8")
    for name, source in modules.items():
        (folder / f"{name}.py").write_text(source)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]


def test_plugins_are_found_unimported_and_loaded(folder):
    install(
        folder,
        "swarm",
        "bee = swarm_one:BEE\nant = swarm_one:Ant",
        swarm_one="BEE = 3\nclass Ant: ...",
    )
    found = find_plugins(GROUP)
    assert list(found) == ["ant", "bee"]
    assert "swarm_one" not in sys.modules
    assert load_plugin(found["bee"]) == 3
    assert load_plugin(found["ant"], type).__name__ == "Ant"


def test_a_group_without_plugins_is_empty():
    assert find_plugins("hose_mj.no_such_group") == {}


def test_own_names_cannot_be_taken(folder):
    install(folder, "swarm", "bee = swarm_two:BEE")
    with pytest.raises(
        InputError, match=r"'bee' in hose_mj.tests of package swarm .* own: bee, wasp"
    ):
        find_plugins(GROUP, own=["bee", "wasp"])


def test_two_packages_cannot_take_one_name(folder):
    install(folder, "hive", "bee = hive:BEE")
    install(folder, "swarm", "bee = swarm:BEE")
    with pytest.raises(InputError, match=r"no other package takes \((hive|swarm) has it\)"):
        find_plugins(GROUP)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("1 / 0", "ZeroDivisionError"),
        ("raise SystemExit(5)", "SystemExit: 5"),
        ("raise ValueError('two\\nlines')", "ValueError: two lines"),
        ("", "has no attribute 'BEE'"),
    ],
)
def test_a_broken_plugin_names_its_package(folder, source, message):
    install(folder, "swarm", "bee = swarm_three:BEE", swarm_three=source)
    with pytest.raises(InputError, match="package swarm") as caught:
        load_plugin(find_plugins(GROUP)["bee"])
    assert message in str(caught.value)


def test_a_plugin_of_another_kind_is_refused(folder):
    install(folder, "swarm", "bee = swarm_four:BEE", swarm_four="BEE = 3")
    with pytest.raises(InputError, match="package swarm is 3; valid: a str or a type"):
        load_plugin(find_plugins(GROUP)["bee"], (str, type))


@pytest.mark.parametrize("name", ["two words", "a/b", "$(x)", "-x", "é"])
def test_a_name_that_is_no_word_is_refused(folder, name):
    install(folder, "swarm", f"{name} = swarm:BEE")
    with pytest.raises(InputError, match=r"of package swarm .* letters, digits"):
        find_plugins(GROUP)


def test_a_broken_task_of_others_leaves_runs_of_ours_alone(folder):
    from hose_learning.learners.catalog import make_settings
    from hose_learning.study.run_folder import describe
    from hose_learning.study.training import Training

    from hose_mj.tasks.registry import TASKS, find_task, list_tasks, make_task

    install(folder, "swarm", "bee = no_such_module:BEE", group="hose_mj.tasks")
    with pytest.raises(InputError, match="package swarm"):
        find_task("bee")
    with pytest.warns(RuntimeWarning, match="bee is left out: .*package swarm.*no_such_module"):
        assert list(list_tasks()) == list(TASKS)
    task = make_task("maze")
    training = Training(
        task, "q-learning", make_settings("q-learning", task), np.random.default_rng(0)
    )
    assert describe(training, 0)["task"] == "maze"


@pytest.mark.filterwarnings("always::RuntimeWarning")
@pytest.mark.parametrize(
    ("kind", "group", "ours"),
    [
        ("models", "hose_mj.hoses", "geds"),
        ("tasks", "hose_mj.tasks", "taxi"),
        ("learners", "hose_learning.learners", "usap"),
        ("scenes", "hose_mj.scenes", "floor_1"),
    ],
)
def test_a_broken_plugin_is_one_line_beside_the_list_of_the_others(
    folder, capsys, kind, group, ours
):
    install(folder, "swarm", "bee = no_such_module:BEE", group=group)
    assert main(["list", kind]) == 0
    captured = capsys.readouterr()
    assert f"\n{ours} " in f"\n{captured.out}"
    assert captured.err.startswith("hose-mj: warning: bee is left out: entry point 'bee'")
    assert "No module named 'no_such_module'" in captured.err
    assert captured.err.count("\n") == 1
    assert main(["list", kind, "--quiet"]) == 0
    assert not capsys.readouterr().err
