"""Another package's task and learner, installed beside ours: trained, cached, made as environments.

The package lies in `rope_pull/`. It is installed as pip does it, without a network: its modules and
a folder of metadata on the path of the processes that are to find it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path(__file__).parent / "rope_pull"


@pytest.fixture
def installed(tmp_path):
    """A folder with the package in it, its sources those of no other run."""
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    shutil.copytree(PACKAGE / "rope_pull", tmp_path / "site" / "rope_pull")
    rules = tmp_path / "site" / "rope_pull" / "kernels.py"
    with rules.open("a", encoding="utf-8") as file:
        file.write(f"\n# {tmp_path}\n")
    metadata = tmp_path / "site" / f"rope_pull-{project['version']}.dist-info"
    metadata.mkdir()
    name = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (metadata / "METADATA").write_text(name, encoding="utf-8")
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{key} = {value}" for key, value in entries.items())]
    (metadata / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")
    return tmp_path


@pytest.fixture
def run(installed):
    """Runs Python with the package on its path; returns what it wrote on stdout."""
    places = [installed / "site", ROOT, ROOT / "learning", os.environ.get("PYTHONPATH", "")]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, places)),
    }

    def run(*arguments):
        command = [sys.executable, *map(str, arguments)]
        done = subprocess.run(
            command, capture_output=True, text=True, env=environment, cwd=installed
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


PLAY = """
import numpy as np
from hose_mj.tasks import kernels
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream

task = make_task("rope-pull")
stream = make_stream(np.random.default_rng(0))
state, values, counts = task.reset(stream), np.zeros(1, np.int64), np.zeros(4, np.int64)
kernels.run_random(task.kernel, state, stream, 1000, values, counts)
plain = counts * 0
stream = make_stream(np.random.default_rng(0))
state = task.reset(stream)
kernels.run_random.py_func(task.kernel, state, stream, 1000, values, plain)
hits = sum(kernels.run_random.stats.cache_hits.values())
print(hits, (counts == plain).all(), *counts)
"""


def test_a_compiled_loop_finds_its_code_until_the_rules_change(run, installed):
    first, second = run("-c", PLAY).split(), run("-c", PLAY).split()
    assert (first[:2], second[:2]) == (["0", "True"], ["1", "True"])
    assert first[2:] == second[2:]
    rules = installed / "site" / "rope_pull" / "kernels.py"
    text = rules.read_text(encoding="utf-8").replace("PULL = 1", "PULL = 2")
    rules.write_text(text, encoding="utf-8")
    changed = run("-c", PLAY).split()
    assert changed[:2] == ["0", "True"]
    assert changed[2:] != first[2:]


def test_our_own_tasks_run_on_where_the_package_is_gone(run, installed):
    run("-c", PLAY)
    shutil.rmtree(installed / "site")
    assert run("-c", PLAY.replace("rope-pull", "maze").replace("zeros(1,", "zeros(6,"))


ENVIRONMENTS = """
import gymnasium, pettingzoo, hose_mj
env = gymnasium.make("hose_mj/RopePull-v0", n_cells=3)
env.reset(seed=0)
print(env.step((2, 2))[1])
copies = gymnasium.make_vec("hose_mj/RopePull-v0", 3)
copies.reset(seed=0)
print(copies.step(copies.action_space.sample())[1].shape)
for kind in ("aec", "parallel"):
    print(pettingzoo.make(kind, "hose_mj/RopePull-v0").possible_agents)
"""


def test_the_task_is_an_environment_of_every_interface(run):
    lines = run("-c", ENVIRONMENTS).splitlines()
    assert lines == ["100.0", "(3,)", *["['left', 'right']"] * 2]


@pytest.mark.parametrize("learner", ["d-rr-ql", "patient-q"])
def test_a_learner_learns_the_task(run, installed, learner):
    folder = installed / "run"
    arguments = ("rope-pull", "--learner", learner, "--episodes", 400, "--tests", 50)
    train = run("-m", "hose_mj.cli.main", "train", *arguments, "--out", folder, "--json")
    results = json.loads(train)
    assert (results["task"], results["learner"]) == ("rope-pull", learner)
    assert results["success_rate"] == 1.0
    more = ("--resume", folder, "--episodes", 500, "--tests", 10, "--json")
    again = json.loads(run("-m", "hose_mj.cli.main", "train", *more))
    assert again["episodes"] == 500
