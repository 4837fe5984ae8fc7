"""The command line: what it prints where, and its exit statuses."""

from __future__ import annotations

import subprocess
import sys
import types
from dataclasses import dataclass
from importlib import import_module
from typing import get_type_hints

import pytest

import hose_mj
from hose_mj.cli import main as cli
from hose_mj.errors import InputError, StepError


@dataclass(frozen=True)
class FakeArgs:
    """Do something."""

    count: int = 1
    """How often."""
    json: bool = False


@pytest.fixture
def fake_command(monkeypatch):
    """A sub-command `fake` whose `run` the test replaces."""
    module = types.ModuleType("tools.fake")
    module.Args = FakeArgs
    module.run = lambda args: 0
    monkeypatch.setitem(sys.modules, "tools.fake", module)
    monkeypatch.setitem(cli.COMMANDS, "fake", cli.Command("tools.fake", "does something"))
    return module


def raising(error):
    def run(args):
        raise error

    return run


def test_help_lists_every_command_with_its_summary(capsys):
    assert cli.main(["--help"]) == 0
    out = capsys.readouterr().out
    for name, command in cli.COMMANDS.items():
        assert f"  {name} " in out
        assert command.summary in out


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"hose-mj {hose_mj.__version__}\n"


def test_no_command_prints_the_help_as_an_error(capsys):
    assert cli.main([]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "commands:" in captured.err


def test_unknown_command_lists_the_valid_ones(capsys):
    assert cli.main(["nonsense"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("hose-mj: error: command is 'nonsense'; valid: ")
    assert captured.err.count("\n") == 1
    for name in cli.COMMANDS:
        assert name in captured.err


def test_unknown_global_option(capsys):
    assert cli.main(["--nonsense"]) == 2
    assert "--nonsense" in capsys.readouterr().err


def test_arguments_reach_the_command(fake_command):
    received = []
    fake_command.run = lambda args: received.append(args) or 1
    assert cli.main(["fake", "--count", "3", "--json"]) == 1
    assert received == [FakeArgs(count=3, json=True)]


def test_help_of_a_command(fake_command, capsys):
    assert cli.main(["fake", "--help"]) == 0
    out = capsys.readouterr().out
    assert "hose-mj fake" in out
    assert "How often." in out
    assert "--no-json" not in out


@pytest.mark.parametrize("words", [["--count", "many"], ["--nonsense"], ["surplus"]])
def test_arguments_that_do_not_parse(fake_command, capsys, words):
    assert cli.main(["fake", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words[-1] in captured.err


@pytest.mark.parametrize(
    "error", [InputError("length", -1, "a finite number above 0"), StepError("step 3 diverged")]
)
def test_an_error_of_ours_is_one_line_without_a_traceback(fake_command, capsys, error):
    fake_command.run = raising(error)
    assert cli.main(["fake"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"hose-mj: error: {error}\n"


def test_an_error_that_is_a_bug_keeps_its_traceback(fake_command):
    fake_command.run = raising(ZeroDivisionError("bug"))
    with pytest.raises(ZeroDivisionError):
        cli.main(["fake"])


def test_interrupt(fake_command, capsys):
    fake_command.run = raising(KeyboardInterrupt())
    assert cli.main(["fake"]) == 130
    assert capsys.readouterr().err == "hose-mj: interrupted\n"


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_takes_json_and_seed(name):
    pytest.importorskip(cli.COMMANDS[name].module, exc_type=ModuleNotFoundError)
    module = import_module(cli.COMMANDS[name].module)
    hints = get_type_hints(module.Args)
    assert hints["json"] is bool
    assert "seed" in hints
    assert module.Args.__dataclass_params__.frozen
    with pytest.raises(SystemExit) as stop:
        cli.parse_arguments(name, module.Args, ["--help"])
    assert stop.value.code == 0


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from tools import cli; status = cli.main(['--help']);"
        "heavy = {'tyro', 'numpy', 'numba', 'mujoco', 'rerun', 'matplotlib'} & set(sys.modules);"
        "sys.exit(status or (f'loaded {heavy}' if heavy else 0))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
