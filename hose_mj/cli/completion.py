"""`hose-mj completion`: scripts that let a shell complete commands, options and names.

A script holds all words itself, so that completing starts no Python. Print it anew after an update.
"""

from __future__ import annotations

import dataclasses
import importlib
from dataclasses import dataclass
from typing import Annotated

import tyro

from hose_mj.cli.commands import COMMANDS
from hose_mj.cli.listing import KINDS
from hose_mj.errors import HoseError, check_choice
from hose_mj.recording.document import make_document, print_document

NAMED = {
    "scene": "scenes",
    "model": "models",
    "models": "models",
    "policy": "policies",
    "task": "tasks",
    "source": "tasks",
    "target": "tasks",
    "learner": "learners",
    "learners": "learners",
}
"""Arguments that take names of `hose-mj list`, by kind."""

BASH = """# hose-mj for bash: eval "$(hose-mj completion bash)"
_hose_mj() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} words="" k option=""
  if (( COMP_CWORD == 1 )); then
    COMPREPLY=($(compgen -W "{commands} --help --version" -- "$word")); return
  fi
  for (( k = 2; k < COMP_CWORD; k++ )); do
    [[ ${{COMP_WORDS[k]}} == --* ]] && option=${{COMP_WORDS[k]}}
  done
  case $option in {flags}) option="" ;; esac
  case "${{COMP_WORDS[1]}} $option" in
{values}
  esac
  if [[ $word == -* || -z $words ]]; then
    case "${{COMP_WORDS[1]}}" in
{options}
    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "$word"))
  (( ${{#COMPREPLY[@]}} )) || COMPREPLY=($(compgen -f -- "$word"))
}}
complete -o filenames -F _hose_mj hose-mj
"""
ZSH = """#compdef hose-mj
# hose-mj for zsh: eval "$(hose-mj completion zsh)"
autoload -U +X bashcompinit && bashcompinit
"""


@dataclass(frozen=True)
class Args:
    """Print a script that lets your shell complete commands, options and names.

    bash and zsh: eval "$(hose-mj completion bash)" in ~/.bashrc, or with zsh in ~/.zshrc.
    fish: hose-mj completion fish > ~/.config/fish/completions/hose-mj.fish
    """

    shell: Annotated[str, tyro.conf.Positional]  # bash, zsh or fish.
    json: bool = False  # Print the words as one JSON document instead of a script.


def run(args: Args) -> int:
    """Prints the script; 0 when done."""
    scripts = {"bash": make_bash, "zsh": lambda words: ZSH + make_bash(words), "fish": make_fish}
    check_choice("shell", args.shell, scripts)
    words = collect_words()
    if args.json:
        print_document(make_document("completion", args, results={"commands": words}))
    else:
        print(scripts[args.shell](words), end="")
    return 0


def collect_words() -> dict[str, dict[str, list[str]]]:
    """Returns for each command its options with the names that each takes; "" for no option."""
    names: dict[str, list[str]] = {}
    for kind in sorted({*NAMED.values(), "environments"}):
        try:
            names[kind] = [name for name in KINDS[kind]() if name.islower() or "/" in name]
        except (HoseError, ImportError):  # an extra that is not here
            names[kind] = []
    found: dict[str, dict[str, list[str]]] = {}
    for command, entry in COMMANDS.items():
        try:
            arguments = importlib.import_module(entry.module).Args
        except ImportError:
            found[command] = {"": [], "--help": []}
            continue
        words: dict[str, list[str]] = {"": []}
        for field in dataclasses.fields(arguments):
            known = names.get(NAMED.get(field.name, ""), [])
            if "Positional" in str(field.type):
                words[""] += [name for name in known if name not in words[""]]
            else:
                words[f"--{field.name.replace('_', '-')}"] = known
        found[command] = words | {"--quiet": [], "--help": []}
    found["list"][""] = list(KINDS)
    found["completion"][""] = ["bash", "zsh", "fish"]
    for command in ("warm", "bench"):
        if len(found[command]) > 2:
            found[command][""] = list(importlib.import_module(COMMANDS[command].module).GROUPS)
    return found


def list_flags() -> list[str]:
    """Returns the options that take no value, in whichever command."""
    flags = {"--quiet", "--help"}
    for entry in COMMANDS.values():
        try:
            arguments = importlib.import_module(entry.module).Args
        except ImportError:  # an extra that is not here
            continue
        own = (field.name for field in dataclasses.fields(arguments) if field.type == "bool")
        flags |= {f"--{name.replace('_', '-')}" for name in own}
    return sorted(flags)


def make_bash(words: dict[str, dict[str, list[str]]]) -> str:
    """Returns the script for bash."""
    values = [
        f'    "{command} {option}") words="{" ".join(known)}" ;;'
        for command, options in words.items()
        for option, known in options.items()
        if known
    ]
    lines = [
        f'      {command}) words+=" {" ".join(option for option in options if option)}" ;;'
        for command, options in words.items()
    ]
    return BASH.format(
        commands=" ".join(words),
        flags=" | ".join(list_flags()),
        values="\n".join(values),
        options="\n".join(lines),
    )


def make_fish(words: dict[str, dict[str, list[str]]]) -> str:
    """Returns the script for fish."""
    first = "complete -c hose-mj -n __fish_use_subcommand -f -a"
    about = {name: entry.summary.replace("'", "\\'") for name, entry in COMMANDS.items()}
    lines = ["# hose-mj for fish: put it into ~/.config/fish/completions/hose-mj.fish"]
    lines += [f"{first} {command} -d '{text}'" for command, text in about.items()]
    for command, options in words.items():
        here = f"complete -c hose-mj -n '__fish_seen_subcommand_from {command}'"
        for option, known in options.items():
            takes = f" -x -a '{' '.join(known)}'" if known and option else ""
            if option:
                lines.append(f"{here} -l {option.removeprefix('--')}{takes}")
            elif known:
                lines.append(f"{here} -a '{' '.join(known)}'")
    return "\n".join(lines) + "\n"
