"""The sub-commands of `hose-mj`: where each lives, and what its help says beside its arguments."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Renamed:
    """What became of an option; its old spelling works on for one release."""

    new: str | None = None  # how it is called now; None if it had no effect and is gone
    prefix: str = ""  # goes before each of its values
    # Words that the option took; if there are some, it is only with several of these that it has
    # another name now.
    several: Sequence[str] = ()


@dataclass(frozen=True)
class Command:
    """A sub-command."""

    module: str  # has `Args`, a frozen dataclass whose docstrings and comments are the help
    summary: str  # its line in `hose-mj --help`
    examples: Sequence[str] = ()  # command lines that its own help ends with
    needs: Sequence[str] = ()  # extras without which it can do nothing, see `hose_mj.extras`
    # Its options that were called otherwise.
    renamed: Mapping[str, Renamed] = field(default_factory=dict)


def _read_groups() -> dict[str, dict[str, Command]]:
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    return {
        group: {name: _make_command(name, **entry) for name, entry in commands.items()}
        for group, commands in table.items()
    }


def _make_command(name: str, renamed: Mapping[str, Any] | None = None, **entry: Any) -> Command:
    module = f"hose_mj.cli.{entry.pop('module', name.replace('-', '_'))}"
    rules = {option: Renamed(**rule) for option, rule in (renamed or {}).items()}
    return Command(module, renamed=rules, **entry)


GROUPS = _read_groups()  # the commands of commands.toml, by what they are for
COMMANDS: dict[str, Command] = {
    name: command for group in GROUPS.values() for name, command in group.items()
}
