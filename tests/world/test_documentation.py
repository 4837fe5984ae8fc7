"""What README and docs show of worlds is run as it is written."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("file", "heading", "printed"),
    [
        ("README.md", "## Robots in a scene", r"robot|segment|\["),
        ("docs/world.md", "# Worlds: robots on a hose", r"\[\["),
    ],
)
def test_the_example_runs_as_shown(file, heading, printed, capsys):
    section = (ROOT / file).read_text(encoding="utf-8").partition(f"{heading}\n")[2]
    example = re.search(r"```python\n(.*?)```", section, re.DOTALL)[1]
    exec(compile(example, file, "exec"), {})
    assert re.search(printed, capsys.readouterr().out)
