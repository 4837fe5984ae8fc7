"""Every learner has a page, and the page keeps what it promises."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from hose_learning.learners.catalog import LEARNERS

from hose_mj.cli.learning_curves import Args, check_arguments
from hose_mj.cli.main import parse_arguments

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "learners"

every_learner = pytest.mark.parametrize("id", LEARNERS)


def read(name):
    return (PAGES / name).read_text(encoding="utf-8")


def find_linked_code(text):
    paths = re.findall(r"\]\(([^)#\s]+\.py)\)", text)
    return "\n".join((PAGES / path).read_text(encoding="utf-8") for path in paths)


@every_learner
def test_a_learner_has_a_row_in_the_index_with_its_file(id):
    row = next(line for line in read("README.md").splitlines() if f"[`{id}`]({id}.md)" in line)
    entry = LEARNERS[id]
    assert f"](../../learning/hose_learning/learners/{entry.module.rpartition('.')[2]}.py)" in row
    assert ("| at once |" in row) == (entry.schedule == "joint")
    assert entry.section in row


@every_learner
def test_a_page_has_an_equation_and_quotes_the_code_as_it_is(id):
    text = read(f"{id}.md")
    assert text.startswith(f"# `{id}`")
    assert "$$" in text
    assert f"{LEARNERS[id].module.rpartition('.')[2]}.py)" in text or "round_robin.py)" in text
    quoted = re.findall(r"```python quotation\n(.*?)```", text, re.DOTALL)
    source = {line.strip() for line in find_linked_code(text).splitlines()}
    lines = [line.strip() for block in quoted for line in block.splitlines() if line.strip()]
    assert lines
    assert [line for line in lines if line not in source] == []


@every_learner
def test_a_page_shows_a_curve_and_the_command_that_draws_it(id):
    text, picture = read(f"{id}.md"), f"images/{id}.png"
    assert re.search(rf"!\[[^]]+\]\({re.escape(picture)}\)", text)
    assert (PAGES / picture).read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    command = next(line for line in text.splitlines() if line.startswith("hose-mj curves"))
    args = parse_arguments("curves", Args, shlex.split(command)[2:])
    check_arguments(args)
    assert args.save == Path("docs/learners") / picture
    assert id in args.learners
    assert f"--learner {id}" in text
