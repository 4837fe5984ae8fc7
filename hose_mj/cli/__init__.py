"""The command line `hose-mj`: one file per sub-command, and `main.py`, which picks among them.

A sub-command is a module with a frozen dataclass `Args`, whose docstrings are the `--help`, and a
function `run(args) -> int` that returns the exit status. One entry in `commands.GROUPS` makes it
known.
"""
