"""The JSON documents: the shared top level, checks, and numbers that JSON cannot hold."""

from __future__ import annotations

import json
import math
import subprocess
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hose_mj import version
from hose_mj.checks import Check
from hose_mj.errors import InputError
from hose_mj.recording import document
from hose_mj.recording.document import format_document, make_document


@dataclass(frozen=True)
class Settings:
    length: float = 2.0
    out: Path = Path("out")
    json: bool = True
    seed: int = 7


def test_top_level_is_the_contract():
    made = make_document("compare", Settings(), checks=[], results={"records": []})
    assert list(made) == [
        *("command", "version", "revision", "machine", "seed", "settings", "checks", "records")
    ]
    assert made["command"] == "compare"
    assert made["version"] == version.__version__
    assert made["seed"] == 7
    assert made["settings"] == {"length": 2.0, "out": Path("out")}
    assert set(made["machine"]) == {"cpu", "cores", "os", "python"}
    assert made["machine"]["cores"] >= 1
    assert json.loads(format_document(made))["settings"]["out"] == "out"


def test_a_command_that_checks_nothing_has_no_checks():
    made = make_document("rollout", {"scene": "floor"}, seed=3)
    assert "checks" not in made
    assert made["seed"] == 3


def test_a_result_may_not_replace_a_shared_entry():
    with pytest.raises(InputError, match="'machine'"):
        make_document("bench", {}, results={"machine": "mine"})


@pytest.mark.parametrize(
    ("comparison", "below", "equal", "above"),
    [
        ("<=", True, True, False),
        ("<", True, False, False),
        (">=", False, True, True),
        (">", False, False, True),
        ("==", False, True, False),
    ],
)
def test_comparisons(comparison, below, equal, above):
    verdicts = [Check("error", value, 1.0, comparison).ok for value in (0.5, 1.0, 1.5)]
    assert verdicts == [below, equal, above]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("comparison", ["<=", "<", ">=", ">", "=="])
def test_a_value_that_is_not_finite_never_passes_and_can_be_printed(value, comparison):
    check = Check("error", value, 1.0, comparison)
    assert not check.ok
    assert json.loads(format_document(check.as_record()))["value"] is None


@pytest.mark.parametrize("limit", [math.nan, math.inf])
def test_a_limit_is_finite(limit):
    with pytest.raises(InputError, match="limit of error"):
        Check("error", 0.0, limit)


def test_an_unknown_comparison():
    with pytest.raises(InputError, match="comparison is '=<'"):
        Check("error", 0.0, 1.0, "=<")


def test_a_check_measured_with_numpy_prints():
    record = Check("error", np.float32(0.5), np.float64(1.0)).as_record()
    expected = {"name": "error", "value": 0.5, "limit": 1.0, "comparison": "<=", "ok": True}
    assert json.loads(format_document(record)) == expected


class Color(Enum):
    RED = "red"


@pytest.mark.parametrize(
    ("value", "plain"),
    [
        (np.float32(0.5), 0.5),
        (np.int64(3), 3),
        (np.bool_(True), True),
        (np.arange(4).reshape(2, 2), [[0, 1], [2, 3]]),
        (Path("a") / "b", str(Path("a") / "b")),
        (Color.RED, "red"),
        ((1, 2), [1, 2]),
        (Settings(), {"length": 2.0, "out": "out", "json": True, "seed": 7}),
        ({3: None}, {"3": None}),
    ],
)
def test_values_become_plain(value, plain):
    assert json.loads(format_document({"value": value})) == {"value": plain}


@pytest.mark.parametrize("number", [math.nan, math.inf, np.float32("nan"), np.array([np.inf])])
def test_numbers_that_json_cannot_hold_are_refused_with_their_place(number):
    with pytest.raises(InputError, match=r"document\.records\[1\]\.error"):
        format_document({"records": [{"error": 0.0}, {"error": number}]})


def test_a_value_without_a_json_form_is_refused_with_its_place():
    with pytest.raises(TypeError, match=r"document\.thing is a object"):
        format_document({"thing": object()})


@given(
    st.recursive(
        st.none()
        | st.booleans()
        | st.integers()
        | st.text()
        | st.floats(allow_nan=False, width=64),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_what_is_printed_reads_back_the_same_or_is_refused(value):
    try:
        text = format_document({"value": value})
    except InputError:
        return

    def refuse(name):
        raise AssertionError(name)

    assert json.loads(text, parse_constant=refuse) == {"value": value}


def run_git(folder, *words):
    identity = ["-c", "user.name=someone", "-c", "user.email=someone@example.com"]
    done = subprocess.run(["git", *identity, *words], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A git repository whose package hose_mj the document takes for the running one."""
    package = tmp_path / "hose_mj"
    package.mkdir()
    (package / "__init__.py").write_text("")
    run_git(tmp_path, "init", "--quiet")
    run_git(tmp_path, "add", ".")
    run_git(tmp_path, "commit", "--quiet", "-m", "first")
    monkeypatch.setattr(version, "__file__", str(package / "__init__.py"))
    return tmp_path


def test_revision_of_a_checkout(checkout):
    commit = run_git(checkout, "rev-parse", "HEAD")
    assert document.find_revision() == commit
    (checkout / "hose_mj" / "new.py").write_text("")
    assert document.find_revision() == f"{commit}+dirty"


def test_no_revision_for_a_copy_installed_inside_another_repository(checkout, monkeypatch):
    installed = checkout / ".venv" / "hose_mj" / "__init__.py"
    installed.parent.mkdir(parents=True)
    installed.write_text("")
    monkeypatch.setattr(version, "__file__", str(installed))
    assert document.find_revision() is None


def test_no_revision_without_git(checkout, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert document.find_revision() is None
