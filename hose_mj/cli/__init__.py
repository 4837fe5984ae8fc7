"""The command line `hose-mj`: one file per sub-command, and `main.py`, which picks among them.

A sub-command is a module with a frozen dataclass `Args`, whose docstrings and comments are the
`--help`, and a function `run(args) -> int` that returns the exit status. An entry in commands.toml
makes it known.
"""
