"""What of the recordings works without the extras `report` and `viewer`, and what then is said."""

from __future__ import annotations

import subprocess
import sys

import pytest

BLOCKED = (
    "import sys\n"
    "for name in ('matplotlib', 'pyarrow', 'rerun'): sys.modules[name] = None\n"
    "from hose_mj.extras import MissingExtra\n"
)


def run(code):
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED + code], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_data_files_documents_and_pages_need_no_extra():
    parts = "document, episode, files, grid, keep, page, palette, parquet, scene_description"
    assert run(f"from hose_mj.recording import {parts}, sinks, world_episode, world_table") == ""


@pytest.mark.parametrize(
    ("line", "extra"),
    [
        ("import hose_mj.recording.rerun.viewer", "viewer"),
        ("import hose_mj.recording.plots.curves", "report"),
        ("from hose_mj.recording.parquet import load_pyarrow; load_pyarrow()", "report"),
    ],
)
def test_what_lacks_an_extra_says_which_to_install(line, extra):
    said = run(f"try:\n    {line}\nexcept MissingExtra as error:\n    print(error)")
    assert f"pip install 'hose-mj[{extra}]'" in said
    assert said.count("\n") == 1
