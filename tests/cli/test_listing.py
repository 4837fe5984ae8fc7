"""`hose-mj list`: every kind, as lines and as a document."""

from __future__ import annotations

import json
import sys

import pytest

from hose_mj.cli.listing import KINDS
from hose_mj.cli.main import main

KNOWN = {
    "scenes": "floor_4",
    "hoses": "garden-hose-19mm",
    "materials": "steel",
    "models": "geds",
    "policies": "to-goal",
    "tasks": "line",
    "learners": "d-rr-ql",
    "environments": "hose_mj/Line-v0",
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_names_and_a_line_about_each(kind, capsys):
    assert main(["list", kind, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["settings"] == {"kind": kind}
    items = {item["name"]: item["description"] for item in document["items"]}
    assert KNOWN[kind] in items
    assert all(items.values())
    assert main(["list", kind]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(items)


def test_an_unknown_kind(capsys):
    assert main(["list", "scene"]) == 2
    assert "(did you mean scenes?)" in capsys.readouterr().err


def test_environments_want_their_extra(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    assert main(["list", "environments"]) == 2
    assert "pip install 'hose-mj[rl]'" in capsys.readouterr().err
