"""What commands share: arguments in their valid sets, tables, and how a command ends."""

from __future__ import annotations

import json
from dataclasses import dataclass

import pytest

from hose_mj.checks import Check
from hose_mj.cli.results import check_counts, finish, make_folder, print_table
from hose_mj.errors import InputError


@dataclass(frozen=True)
class Args:
    """Some arguments."""

    json: bool = False
    seed: int = 3
    moves: int | None = None


def test_numbers_have_a_least_one_and_none_is_no_number():
    check_counts(Args(), seed=3, moves=1)
    with pytest.raises(InputError, match="seed is 3; valid: a whole number, at least 4"):
        check_counts(Args(), seed=4)


def test_a_folder_is_made_or_refused(tmp_path):
    make_folder(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    (tmp_path / "plain").touch()
    with pytest.raises(InputError, match="out is"):
        make_folder(tmp_path / "plain" / "b")


def test_a_table_shows_names_without_their_marks(capsys):
    print_table("Title", ("what", ">value"), [("length", "2.5")])
    shown = capsys.readouterr().out
    assert "Title" in shown
    assert "length" in shown
    assert ">" not in shown


@pytest.mark.parametrize(("value", "status"), [(0.5, 0), (2.0, 1)])
def test_a_command_ends_with_its_checks(capsys, value, status):
    checks = [Check("a thing", value, 1.0)]
    assert finish("fake", Args(), checks, {}, lambda: None, begun=0.0) == status
    said = capsys.readouterr().out
    assert "a thing" in said
    assert f"{1 - status} of 1 checks ok, " in said
    ended = finish("fake", Args(json=True), checks, {"found": 7}, pytest.fail, ending="the end")
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert (ended, err) == (status, "the end\n")
    assert (document["found"], document["seed"], len(document["checks"])) == (7, 3, 1)
