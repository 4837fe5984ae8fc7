"""Files are whole or absent, whatever happens while they are written."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from hose_mj.recording import files
from hose_mj.recording.files import write_atomically


def test_writes_and_makes_the_folders(tmp_path):
    path = tmp_path / "runs" / "one" / "summary.json"
    write_atomically(path, b"\x00first")
    assert path.read_bytes() == b"\x00first"
    write_atomically(path, b"second")
    assert path.read_bytes() == b"second"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("stage", ["write_bytes", "fsync", "replace"])
def test_an_error_at_any_stage_leaves_the_old_file_and_no_other(tmp_path, monkeypatch, stage):
    path = tmp_path / "summary.json"
    path.write_bytes(b"old")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(Path if stage == "write_bytes" else files.os, stage, fail)
    with pytest.raises(OSError, match="disk full"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_process_that_dies_half_way_leaves_the_old_file(tmp_path):
    path = tmp_path / "summary.json"
    path.write_bytes(b"old")
    code = (
        "import os, pathlib, sys; from hose_mj.recording import files;"
        "files.os.replace = lambda *_: os._exit(9);"
        "files.write_atomically(pathlib.Path(sys.argv[1]), b'new')"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], timeout=60)
    assert done.returncode == 9
    assert path.read_bytes() == b"old"


@pytest.mark.skipif(os.name != "posix", reason="permission bits are POSIX's")
def test_others_may_read_what_the_umask_lets_them(tmp_path):
    before = os.umask(0o022)
    try:
        write_atomically(tmp_path / "a", b"")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o644
