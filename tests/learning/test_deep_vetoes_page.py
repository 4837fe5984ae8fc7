"""The example of docs/learners/deep-vetoes.md runs as it is written, in small."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "learners" / "deep-vetoes.md"
SB3 = "sb3-contrib is not installed: it comes with the extra deep"


@pytest.fixture
def example():
    return re.search(r"```python[^\n]*\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1]


def test_the_example_is_python_and_says_how_long_it_trains(example):
    compile(example, PAGE.name, "exec")
    assert "STEPS, SEEDS = 20_000, (0, 1, 2)" in example


@pytest.mark.slow
def test_the_example_runs(example, capsys):
    pytest.importorskip("sb3_contrib", reason=SB3)
    small = example.replace("20_000, (0, 1, 2)", "512, (0,)").replace("episodes=200", "episodes=5")
    assert small.count("512") > example.count("512")
    exec(compile(small, PAGE.name, "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(",")[0] for line in lines] == [
        *("no vetoes", "learned before", "learned meanwhile")
    ]
    assert "broken" in lines[0]
    assert "broken" not in lines[1]
