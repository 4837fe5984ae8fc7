"""The console script `hose-mj`: finds the sub-command, parses its arguments, reports its errors."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, cast

import hose_mj
from hose_mj.errors import HoseError, InputError

DONE, CHECK_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit statuses; 130 is what a shell expects of a program stopped with Ctrl-C."""


@dataclass(frozen=True)
class Command:
    """Where a sub-command lives, and the line about it in `hose-mj --help`."""

    module: str
    summary: str


COMMANDS = {
    "bench": Command("hose_mj.cli.bench.command", "measure speed beside peers that people know"),
    "check-breaks": Command(
        "hose_mj.cli.check_breaks", "check that hose models break alike under the same moves"
    ),
    "check-pcm": Command(
        "hose_mj.cli.check_pcm", "check that one task is a partially constrained model of another"
    ),
    "check-sequential": Command(
        "hose_mj.cli.check_sequential", "check that moves in turn are joint moves of one agent"
    ),
    "classifiers": Command(
        "hose_mj.cli.classifiers", "measure which classifiers predict undesired moves (chapter 8)"
    ),
    "compare": Command(
        "hose_mj.cli.compare", "measure the hose models against closed forms, or on your own hose"
    ),
    "consensus": Command(
        "hose_mj.cli.consensus", "let agents agree on whose turn it is, by messages"
    ),
    "curves": Command("hose_mj.cli.learning_curves", "draw how learners get better as they train"),
    "doctor": Command("hose_mj.cli.doctor", "check that this installation has what hose_mj needs"),
    "drive": Command("hose_mj.cli.drive", "drive the robots of a scene with the keyboard"),
    "joint-policy": Command(
        "hose_mj.cli.joint_policy", "compose what agents learned in turns into joint moves"
    ),
    "relevance": Command(
        "hose_mj.cli.relevance", "find the state variables that matter for each constraint"
    ),
    "reproduce": Command(
        "hose_mj.cli.reproduce", "repeat the thesis's experiments over seeds, beside its numbers"
    ),
    "rollout": Command("hose_mj.cli.rollout", "run an episode of a policy in a scene with a hose"),
    "train": Command(
        "hose_mj.cli.train", "train a learner on a task, test it and keep what it learned"
    ),
    "transfer": Command(
        "hose_mj.cli.transfer", "start on a task from what was learned on a simpler one"
    ),
    "view": Command("hose_mj.cli.view", "open a recording at the moment of the break"),
}


class CommandModule(Protocol):
    """What the module of a sub-command defines.

    Attributes:
        Args: frozen dataclass of its arguments; its docstrings are the `--help`.
        run: takes an `Args` and returns the exit status.
    """

    Args: type[Any]
    run: Callable[[Any], int]


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command line and returns the exit status.

    Args:
        argv: the words after the program's name; those of this process by default.

    Returns:
        0 done, 1 a check failed, 2 bad input, 130 interrupted.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        return run_command(words)
    except HoseError as error:
        print(f"hose-mj: error: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("hose-mj: interrupted", file=sys.stderr)
        return INTERRUPTED
    except SystemExit as stop:  # how argparse and tyro end after --help or a wrong argument
        return stop.code if isinstance(stop.code, int) else DONE


def run_command(words: Sequence[str]) -> int:
    """Dispatches to the sub-command that the first word names.

    Raises:
        InputError: there is no such sub-command.
        SystemExit: after --help, --version or arguments that do not parse.
    """
    parser = make_parser()
    name = parser.parse_args(words[:1]).command
    if name is None:
        parser.print_help(sys.stderr)
        return BAD_INPUT
    if name not in COMMANDS:
        raise InputError("command", name, f"{', '.join(COMMANDS)} (see hose-mj --help)")
    module = cast(CommandModule, importlib.import_module(COMMANDS[name].module))
    return module.run(parse_arguments(name, module.Args, words[1:]))


def parse_arguments(name: str, arguments: type[Any], words: Sequence[str]) -> Any:
    """Returns the `Args` of a sub-command that its words describe."""
    import tyro

    return tyro.cli(
        arguments,
        prog=f"hose-mj {name}",
        args=list(words),
        config=(tyro.conf.FlagCreatePairsOff,),
    )


def make_parser() -> argparse.ArgumentParser:
    """Returns the parser of the first word; what follows belongs to the sub-command."""
    width = max(map(len, COMMANDS))
    commands = "\n".join(f"  {name:{width}}  {c.summary}" for name, c in COMMANDS.items())
    parser = argparse.ArgumentParser(
        prog="hose-mj",
        usage="hose-mj COMMAND [ARGUMENTS]\n       hose-mj COMMAND --help",
        description=f"{hose_mj.__doc__.splitlines()[0] if hose_mj.__doc__ else ''}\n\n"
        f"commands:\n{commands}",
        epilog="Every command takes --json (one JSON document on stdout, messages on stderr) and\n"
        "--seed. Exit status: 0 done, 1 a check failed, 2 bad input.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", nargs="?", metavar="COMMAND", help=argparse.SUPPRESS)
    parser.add_argument("--version", action="version", version=f"hose-mj {hose_mj.__version__}")
    return parser


if __name__ == "__main__":
    sys.exit(main())
