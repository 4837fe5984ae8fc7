"""What README and docs show of the environments is run as it is written."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from hose_mj.envs import IDS
from tools import task_pictures

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def example():
    section = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n## Environments\n")[2]
    return re.search(r"```python\n(.*?)```", section, re.DOTALL)[1]


def test_the_example_in_the_readme_runs_in_ten_lines(example, capsys):
    assert len(example.strip().splitlines()) <= 10
    scope = {}
    exec(compile(example, "README.md", "exec"), scope)
    assert scope["terminated"] or scope["truncated"]
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].startswith("move ")
    assert float(lines[-1].split()[-1]) == scope["reward"]


def test_the_ids_in_the_documentation_are_those_registered():
    for file in ("README.md", "docs/environments.md"):
        text = (ROOT / file).read_text(encoding="utf-8")
        assert all(id.removeprefix("hose_mj/").removesuffix("-v0") in text for id in IDS)
        assert set(re.findall(r"hose_mj/\w+-v0", text)) <= set(IDS)


@pytest.mark.parametrize(
    ("first", "id"),
    [
        ("pass", "hose_mj.envs:hose_mj/Maze-v0"),
        ("pass", "hose_mj:hose_mj/Maze-v0"),
        ("import hose_mj", "hose_mj/Maze-v0"),
        ("import hose_mj.envs", "hose_mj/Maze-v0"),
    ],
)
def test_an_id_is_found_by_importing_or_naming_the_package(first, id):
    code = (
        f"import gymnasium, warnings; warnings.simplefilter('error'); {first};"
        f"assert gymnasium.make({id!r}).reset(seed=0)[0].shape == (6,)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr


def test_importing_the_environments_compiles_and_draws_nothing():
    code = "import sys, hose_mj.envs; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert not {"numba", "PIL", "matplotlib", "rerun", "mujoco", "pygame"} & set(
        done.stdout.split()
    )


def test_tasks_do_without_the_extra_and_environments_name_it():
    code = (
        "import sys;"
        "sys.modules.update(dict.fromkeys(['gymnasium', 'pettingzoo', 'dm_env', 'PIL']));"
        "from hose_mj.tasks.registry import TASKS, make_task; [make_task(id) for id in TASKS];"
        "import hose_mj.envs"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    last = done.stderr.splitlines()[-1]
    assert "hose_mj.envs needs the extra `rl`: pip install 'hose-mj[rl]'" in last


def test_the_picture_in_the_documentation_can_be_drawn():
    assert task_pictures.draw_all().startswith(b"\x89PNG\r\n\x1a\n")
