"""The console script `hose-mj`: finds the sub-command, parses its arguments, reports its errors."""

from __future__ import annotations

import errno
import importlib
import io
import os
import re
import shutil
import sys
import textwrap
import warnings
from collections.abc import Callable, Sequence
from contextlib import ExitStack, nullcontext, redirect_stderr, redirect_stdout, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol, TextIO, cast, get_args, get_type_hints

import hose_mj
from hose_mj.cli.commands import COMMANDS, GROUPS, Command
from hose_mj.errors import HoseError, InputError
from hose_mj.extras import MissingExtra, find_extra, require_all

DONE, CHECK_FAILED, BAD_INPUT, REFUSED, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 3, 130, 141
"""Exit statuses; the last two are what a shell expects after Ctrl-C and of a closed pipe."""

ENDING = """Every command takes --json (one JSON document on stdout, messages on stderr) and --quiet
(no messages and no progress); those that leave something to chance take --seed.

Exit status: 0 done, 1 a check failed, 2 bad input, 3 the machine refused (disk, permission,
memory).
"""


class CommandModule(Protocol):
    """What the module of a sub-command defines.

    Attributes:
        Args: frozen dataclass of its arguments; what is said of them is the `--help`.
        run: takes an `Args` and returns the exit status.
    """

    Args: type[Any]
    run: Callable[[Any], int]


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command line, by default that of this process, and returns the exit status.

    It is 0 done, 1 a check failed, 2 bad input, 3 the machine refused, 130 interrupted, 141 nobody
    reads the output any more.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    if sys.stdout is None or sys.stderr is None:  # closed by whoever started this
        sys.stdout, sys.stderr = sys.stdout or _open_nothing(), sys.stderr or _open_nothing()
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        status = _run_reporting(words)
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _drop_output()
        return PIPE_CLOSED
    except OSError as error:
        _drop_output()
        _complain(f"cannot write to stdout: {error.strerror}")
        return BAD_INPUT
    return status


def _run_reporting(words: list[str]) -> int:
    """Runs a command line; what stops it becomes one line on stderr and a status."""
    try:
        return run_command(words)
    except HoseError as error:
        _complain(str(error))
        return BAD_INPUT
    except ModuleNotFoundError as error:
        extra = find_extra(error.name or "")
        if extra is None:
            raise
        _complain(str(MissingExtra(extra, f"this (the module {error.name})")))
        return BAD_INPUT
    except BrokenPipeError:
        _drop_output()
        return PIPE_CLOSED
    except OSError as error:
        if error.errno is None and error.strerror is None and not isinstance(error, TimeoutError):
            raise  # not the operating system's: a bug
        _complain(_describe_refusal(error))
        full = error.filename is None and error.errno in (errno.ENOSPC, errno.EIO, errno.EBADF)
        return BAD_INPUT if full and not _can_print() else REFUSED
    except MemoryError as error:
        _complain(f"not enough memory{f': {error}' if str(error) else ''}")
        return REFUSED
    except KeyboardInterrupt:
        print("hose-mj: interrupted", file=sys.stderr)
        return INTERRUPTED
    except SystemExit as stop:  # how tyro ends after --help or a wrong argument
        if isinstance(stop.__context__, BrokenPipeError):  # and rich where nobody reads on
            _drop_output()
            return PIPE_CLOSED
        return stop.code if isinstance(stop.code, int) else DONE


def _complain(text: str) -> None:
    with suppress(OSError):  # nowhere to say it: the status is all there is
        print(f"hose-mj: error: {text}", file=sys.stderr)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    with suppress(OSError):
        print(f"hose-mj: warning: {' '.join(str(message).split())}", file=sys.stderr)


def _describe_refusal(error: OSError) -> str:
    """The system's reason, with the file that it is about if it says so; one line."""
    names = [str(name) for name in (error.filename, error.filename2) if name is not None]
    reason = error.strerror or str(error)
    return " ".join(f"{', '.join(names)}{': ' * bool(names)}{reason}".split())


def _can_print() -> bool:
    """Says whether stdout takes what is written: where it goes is part of the command line."""
    try:
        print(flush=True)
    except OSError:
        _drop_output()
        return False
    return True


def _open_nothing() -> TextIO:
    return open(os.devnull, "w", encoding="utf-8")


def _drop_output() -> None:
    """Sends what is still to be written nowhere, so that Python's own flush at the end is quiet."""
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())
        os.close(nothing)
    except (OSError, ValueError):  # no file behind it, as in tests
        pass


def run_command(words: Sequence[str]) -> int:
    """Dispatches to the sub-command that the first word names.

    Raises:
        InputError: there is no such sub-command.
        SystemExit: after --help or arguments that do not parse.
    """
    quiet = "--quiet" in words
    words = [word for word in words if word != "--quiet"]
    name, rest = (words[0], words[1:]) if words else (None, [])
    if name == "help":
        name, rest = (rest[0], ["--help"]) if rest else ("--help", [])
    if name in (None, "-h", "--help"):
        print(make_help(), file=sys.stdout if words else sys.stderr, end="")
        return DONE if words else BAD_INPUT
    if name == "--version":
        print(f"hose-mj {hose_mj.__version__}")
        return DONE
    if name not in COMMANDS:
        what = "option" if name.startswith("-") else "command"
        known = "--help, --version, --quiet" if what == "option" else ", ".join(COMMANDS)
        raise InputError(what, name, known)
    command = COMMANDS[name]
    with redirect_stderr(io.StringIO()) if quiet else nullcontext():
        rest = rename_options(name, command, rest)
    module = cast(CommandModule, importlib.import_module(command.module))
    check_paths(module.Args, rest)
    args = parse_arguments(name, module.Args, rest)
    require_all(command.needs, f"hose-mj {name}")
    with ExitStack() as stack:
        if quiet:
            stack.enter_context(redirect_stderr(stack.enter_context(_open_nothing())))
        return module.run(args)


def rename_options(name: str, command: Command, words: Sequence[str]) -> list[str]:
    """Returns the words with old spellings of options replaced; says so on stderr.

    The values of one option that stood under several spellings are put together.
    """
    parts: list[list[str]] = [[]]
    for word in words:
        key, equals, value = word.partition("=")
        if key.startswith("--"):
            parts.append([key, value] if equals else [key])
        else:
            parts[-1].append(word)
    kept: list[list[str]] = []
    for part in parts:
        rule = command.renamed.get(part[0]) if part else None
        if rule is None or (rule.several and not _are_several(part[1:], rule.several)):
            kept.append(part)
            continue
        said = "has no effect" if rule.new is None else f"is now {rule.new}"
        print(f"hose-mj {name}: {part[0]} {said}", file=sys.stderr)
        if rule.new is None:
            kept.append(part[2:])  # without its value
            continue
        values = [rule.prefix + value for value in part[1:]]
        same = next((other for other in kept if other[:1] == [rule.new]), None)
        if same is None:
            kept.append([rule.new, *values])
        else:
            same += values
    return [word for part in kept for word in part]


def _are_several(values: Sequence[str], known: Sequence[str]) -> bool:
    """Says whether these are all values: a last one that is not known is the next argument."""
    return len(values) > 1 and set(values) <= set(known)


def check_paths(arguments: type[Any], words: Sequence[str]) -> None:
    """Raises `InputError` for an option's empty path, which Python takes for the current folder."""
    parts = [
        part for word in words for part in (word.split("=", 1) if word[:2] == "--" else [word])
    ]
    kinds = get_type_hints(arguments)
    for word, value in pairwise(parts):
        kind = kinds.get(word[2:].replace("-", "_"))
        if word[:2] == "--" and not value and Path in (kind, *get_args(kind)):
            raise InputError(word, value, "a path that is not empty")


def parse_arguments(name: str, arguments: type[Any], words: Sequence[str]) -> Any:
    """Returns the `Args` of a sub-command that its words describe."""
    import tyro

    asks = bool({"-h", "--help"} & set(words))
    shown = io.TextIOWrapper(io.BytesIO(), getattr(sys.stdout, "encoding", None) or "utf-8")
    try:
        with redirect_stdout(shown) if asks else nullcontext():
            config = (tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone)
            return tyro.cli(arguments, prog=f"hose-mj {name}", args=list(words), config=config)
    except SystemExit:
        if asks:
            shown.seek(0)
            print(_finish_help(name, shown.read()), end="")
        raise


def _finish_help(name: str, text: str) -> str:
    """The help of a sub-command, wrapped, with examples, without defaults that say nothing."""
    empty = re.compile(r"\(default:[\s│|]*(None|False)?[\s│|]*\)")  # wrapped or not
    text = empty.sub(lambda found: re.sub(r"[^\s│|]", " ", found.group()), text)
    lines = [line for line in text.splitlines() if not re.fullmatch(r"[│|]\s+[│|]", line)]
    lines = [line if line[:1] in "│╭╰|+" else _wrap(line) for line in lines]
    examples = COMMANDS[name].examples if name in COMMANDS else ()
    if examples:
        lines += ["", "examples:", *map(_wrap_command, examples), ""]
    return "\n".join([*lines, _wrap(ENDING), ""])


def _wrap(text: str) -> str:
    """Returns paragraphs that fit into the terminal."""
    parts = (" ".join(one.split()) for one in text.split("\n\n"))
    return "\n\n".join(textwrap.fill(part, _find_width()) for part in parts)


def _wrap_command(line: str) -> str:
    """Returns a command line that a shell takes as it stands, in lines that fit."""
    style: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}
    parts = textwrap.wrap(line, _find_width() - 6, **style)
    return "  " + " \\\n    ".join(parts)


def _find_width() -> int:
    return min(100, max(40, shutil.get_terminal_size().columns))


def make_help() -> str:
    """Returns the help of the program: the commands, by what they are for."""
    indent = 4 + max(map(len, COMMANDS))
    width = _find_width()
    about = (hose_mj.__doc__ or "").splitlines()[0]
    lines = ["usage: hose-mj COMMAND [ARGUMENTS]", "       hose-mj COMMAND --help", ""]
    lines += [*textwrap.wrap(about, width), "", "commands:"]
    for group, commands in GROUPS.items():
        lines += ["", group]
        for name, command in commands.items():
            head, after = f"  {name}".ljust(indent), " " * indent
            style: dict[str, Any] = {"initial_indent": head, "subsequent_indent": after}
            lines += textwrap.wrap(command.summary, width, **style)
    return "\n".join([*lines, "", _wrap(ENDING), ""])


if __name__ == "__main__":
    sys.exit(main())
