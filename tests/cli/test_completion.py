"""`hose-mj completion`: what a shell offers."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys

import pytest

from hose_mj.cli.commands import COMMANDS
from hose_mj.cli.main import main


@pytest.fixture(scope="module")
def words():
    from hose_mj.cli.completion import collect_words

    return collect_words()


def test_all_commands_and_options_are_there(words, capsys):
    assert list(words) == list(COMMANDS)
    assert {"--learner", "--set", "--quiet", "--json", "--help"} <= set(words["train"])
    assert "d-rr-ql" in words["train"]["--learner"]
    assert "floor_4" in words["rollout"][""]
    assert all(len(set(names)) == len(names) for of in words.values() for names in of.values())
    assert main(["completion", "bash", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["commands"] == words


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["tr"], {"train", "transfer"}),
        (["train", "--le"], {"--learner", "--learning-rate"}),
        (["train", "--learner", "d-q"], {"d-ql"}),
        (["rollout", "corr"], {"corridor"}),
        (["list", "sc"], {"scenes"}),
        (["completion", "z"], {"zsh"}),
        (["rollout", "--json", "corr"], {"corridor"}),
        (["warm", "w"], {"world"}),
    ],
)
def test_bash_completes(typed, offered, words):
    from hose_mj.cli.completion import make_bash

    program = make_bash(words) + (
        'COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _hose_mj; printf \'%s\\n\' "${COMPREPLY[@]}"'
    )
    command = ["bash", "-c", program, "bash", "hose-mj", *typed]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert set(done.stdout.split()) == offered


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells(shell, words, capsys):
    assert main(["completion", shell]) == 0
    out = capsys.readouterr().out
    assert all(command in out for command in COMMANDS)
    assert "learning-rate" in out
    if shutil.which(shell):
        done = subprocess.run([shell, "-n"], input=out, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, done.stderr


def test_an_unknown_shell(capsys):
    assert main(["completion", "tcsh"]) == 2
    assert "shell is 'tcsh'; valid: one of bash, zsh, fish" in capsys.readouterr().err
    assert sys.modules["hose_mj.cli.completion"]
