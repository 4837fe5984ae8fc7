"""The command line: what it prints where, and its exit statuses."""

from __future__ import annotations

import errno
import re
import shlex
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
        assert command.summary in " ".join(out.split())
    for group in cli.GROUPS:
        assert f"\n{group}\n" in out


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
def test_every_command_takes_json_and_its_help_reads_well(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    module = import_module(cli.COMMANDS[name].module)
    hints = get_type_hints(module.Args)
    assert hints["json"] is bool
    assert hints.get("seed", int) is int
    assert module.Args.__dataclass_params__.frozen
    assert cli.main([name, "--help"]) == 0
    out = capsys.readouterr().out
    assert "{None}" not in out
    assert not re.search(r"None\)|\(default:[\s│]*\)", out)
    assert "without effect" not in out
    assert max(map(len, out.splitlines())) <= 60
    for line in cli.COMMANDS[name].examples:
        assert f"  {line}\n" in out.replace(" \\\n   ", "")


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_has_an_example_that_parses(name):
    assert cli.COMMANDS[name].examples
    for line in cli.COMMANDS[name].examples:
        words = shlex.split(line.removeprefix('eval "$(').removesuffix(')"'))
        assert words[:2] == ["hose-mj", name]
        arguments = import_module(cli.COMMANDS[name].module).Args
        assert isinstance(cli.parse_arguments(name, arguments, words[2:]), arguments)


def test_a_misspelt_command_or_name_is_corrected(fake_command, capsys):
    assert cli.main(["trian"]) == 2
    assert "(did you mean train?)" in capsys.readouterr().err
    fake_command.run = raising(InputError("scene", "flor_2", "one of floor_1, floor_2"))
    assert cli.main(["fake"]) == 2
    assert capsys.readouterr().err.endswith("(did you mean floor_2?)\n")


def test_a_misspelt_option_is_corrected(fake_command, capsys):
    assert cli.main(["fake", "--conut", "3"]) == 2
    assert "--count" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "a.rrd"), "a.rrd: No space left"),
        (PermissionError(errno.EACCES, "Permission denied", "/x"), "/x: Permission denied"),
        (OSError(errno.EROFS, "Read-only file system"), "Read-only file system"),
        (NotADirectoryError(errno.ENOTDIR, "Not a directory", "plain/b"), "plain/b: Not a dir"),
        (MemoryError("Unable to allocate 8 EiB"), "not enough memory: Unable to allocate"),
        (MemoryError(), "not enough memory"),
    ],
)
def test_a_machine_that_refuses_is_one_line_and_status_3(fake_command, capsys, error, said):
    fake_command.run = raising(error)
    assert cli.main(["fake"]) == 3
    err = capsys.readouterr().err
    assert err.startswith(f"hose-mj: error: {said}")
    assert err.count("\n") == 1


def test_a_missing_extra_is_said_before_any_work(fake_command, capsys, monkeypatch):
    done = []
    fake_command.run = lambda args: done.append(args) or 0
    wanting = cli.Command("tools.fake", "does something", needs=("viewer",))
    monkeypatch.setitem(cli.COMMANDS, "fake", wanting)
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert cli.main(["fake"]) == 2
    assert not done
    line = "hose-mj fake needs the extra `viewer`: pip install 'hose-mj[viewer]'"
    assert capsys.readouterr().err == f"hose-mj: error: {line}\n"


def test_a_module_of_an_extra_that_is_imported_late(fake_command, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)

    def run(args):
        import pyarrow.parquet  # noqa: F401

    fake_command.run = run
    assert cli.main(["fake"]) == 2
    assert "pip install 'hose-mj[report]'" in capsys.readouterr().err


def test_quiet_leaves_results_and_errors(fake_command, capsys):
    def run(args):
        sys.stderr.write("progress\n")
        sys.stdout.write("result\n")
        raise StepError("step 3 diverged")

    fake_command.run = run
    assert cli.main(["fake", "--quiet"]) == 2
    captured = capsys.readouterr()
    assert captured.out == "result\n"
    assert captured.err == "hose-mj: error: step 3 diverged\n"


def test_old_spellings_of_options_work_on(capsys):
    rename = cli.rename_options
    old = ["line", "--source-set", "a=1", "b=2", "--moves", "5", "--target-set=c=3"]
    new = ["line", "--set", "source.a=1", "source.b=2", "target.c=3", "--moves", "5"]
    assert rename("transfer", cli.COMMANDS["transfer"], old) == new
    assert "--source-set is now --set" in capsys.readouterr().err
    old = ["view", "--seed", "3", "a.rrd"]
    assert rename("view", cli.COMMANDS["view"], old) == ["view", "a.rrd"]
    assert "--seed has no effect" in capsys.readouterr().err
    old = ["floor_1", "--model", "geds", "cable"]
    found = rename("rollout", cli.COMMANDS["rollout"], old)
    assert found == ["floor_1", "--models", "geds", "cable"]
    for same in (["floor_1", "--model", "geds"], ["--model", "geds", "floor_1"]):
        assert rename("rollout", cli.COMMANDS["rollout"], same) == same
    capsys.readouterr()
    assert cli.main(["doctor", "--seed", "3", "--quiet", "surplus"]) == 2
    assert "no effect" not in capsys.readouterr().err


LIST = f"'{sys.executable}' -m hose_mj list models"


@pytest.mark.skipif(sys.platform == "win32", reason="written for a POSIX shell")
@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        (f"( {LIST}; echo status $? >&2 ) | true", {0, 141}),
        (f"{LIST} > /dev/full; echo status $? >&2", {2}),
        (f"{LIST} >&-; echo status $? >&2", {0}),
    ],
)
def test_an_output_that_ends_is_no_crash(line, wanted):
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
    *said, last = done.stderr.strip().splitlines()
    assert int(last.split()[-1]) in wanted
    assert not any("Traceback" in text or "Exception ignored" in text for text in said)


def test_the_package_runs_as_a_program():
    words = [sys.executable, "-m", "hose_mj", "--version"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.stdout == f"hose-mj {hose_mj.__version__}\n"


@pytest.mark.parametrize(
    ("words", "more"),
    [([], ("tyro", "numpy")), *(([name], ()) for name in cli.COMMANDS)],
    ids=lambda words: "-".join(words),
)
def test_help_loads_nothing_heavy(words, more):
    code = (
        f"import sys; from hose_mj.cli import main as cli; status = cli.main([*{words}, '--help']);"
        f"heavy = {{*{HEAVY}, *{more}}} & set(sys.modules);"
        "sys.exit(status or (f'loaded {heavy}' if heavy else 0))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


HEAVY = ("numba", "scipy", "mujoco", "rerun", "matplotlib", "pyarrow", "gymnasium", "pettingzoo")


@pytest.mark.parametrize("names", [[], *([name] for name in cli.COMMANDS)])
def test_help_fits_into_a_narrow_terminal(names, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    assert cli.main(["help", *names]) == 0
    assert not [line for line in capsys.readouterr().out.splitlines() if len(line) > 40]


def test_help_is_a_command_too(capsys):
    shown = []
    for words in (["help"], ["--help"], ["help", "list"], ["list", "--help"]):
        assert cli.main(words) == 0
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1] != shown[2] == shown[3]
    assert cli.main(["help", "lits"]) == 2
    assert "command is 'lits'" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--quiet", "fake"], ["fake", "--quiet"]])
def test_quiet_stands_before_a_command_or_after_it(fake_command, capsys, words):
    fake_command.run = lambda args: sys.stderr.write("progress") and 0
    assert cli.main(words) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "words",
    [
        ["train", "maze", "--out", ""],
        ["train", "maze", "--out="],
        ["train", "maze", "--resume", ""],
        ["curves", "--save", ""],
        ["reproduce", "--out", ""],
        ["compare", "--quick", "--out", ""],
        ["consensus", "--out="],
    ],
)
def test_an_empty_path_is_refused_before_any_work(words, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert cli.main(words) == 2
    error = capsys.readouterr().err
    assert re.fullmatch(r"hose-mj: error: --\w+ is ''; valid: a path that is not empty\n", error)
    assert not list(tmp_path.iterdir())
