"""docs/constraints.md: its example runs, its links lead somewhere, its defaults are the code's."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

from hose_mj.constraints.kinds import KINDS
from hose_mj.constraints.limits import Limits

PAGE = Path(__file__).resolve().parents[2] / "docs" / "constraints.md"


def test_the_example_breaks_as_the_page_says(capsys):
    text = PAGE.read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", text, re.S).group(1)
    said = re.search(r"It prints `(.*?)`", text).group(1)
    exec(compile(example, "docs/constraints.md", "exec"), {})
    assert said in capsys.readouterr().out


def test_links_lead_to_files():
    for link in re.findall(r"\]\(([^)#]+)\)", PAGE.read_text(encoding="utf-8")):
        assert (PAGE.parent / link).exists(), link


def test_every_kind_and_every_limit_is_explained():
    text = PAGE.read_text(encoding="utf-8")
    for kind in KINDS:
        assert f"| `{kind.name} i" in text
    for field in fields(Limits):
        assert f"`{field.name}`" in text
