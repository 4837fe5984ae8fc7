"""What lacks an optional part says in one line which to install, before any work."""

from __future__ import annotations

import sys

import pytest

from hose_mj.errors import HoseError
from hose_mj.extras import EXTRAS, MissingExtra, find_extra, is_installed, require, require_all


@pytest.mark.parametrize("part", ["viewer", "rerun"])
def test_a_missing_extra_is_one_line_with_the_remedy(monkeypatch, part):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtra) as caught:
        require(part, "the viewer")
    assert str(caught.value) == (
        "the viewer needs the extra `viewer`: pip install 'hose-mj[viewer]'"
    )
    assert isinstance(caught.value, HoseError)
    assert isinstance(caught.value, ImportError)
    assert not is_installed("viewer")


def test_several_missing_extras_are_said_at_once(monkeypatch):
    for module in ("rerun", "matplotlib"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtra) as caught:
        require_all(("report", "rl", "viewer"), "a report")
    assert str(caught.value) == (
        "a report needs the extras `report` and `viewer`: pip install 'hose-mj[report,viewer]'"
    )
    require_all(("rl",), "nothing")


def test_what_is_there_passes_without_being_imported(monkeypatch, tmp_path):
    (tmp_path / "rerun.py").write_text("raise RuntimeError('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "rerun", raising=False)
    require("viewer", "the viewer")


def test_modules_belong_to_extras():
    assert find_extra("rerun.chunk") == "viewer"
    assert find_extra("numpy") is None
    modules = [module for extra in EXTRAS.values() for module in extra]
    assert len(set(modules)) == len(modules)
    with pytest.raises(ValueError, match="neither"):
        require("no_such_module", "nothing")
