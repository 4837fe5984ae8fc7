"""The documentation is true: links lead somewhere, paths exist, examples run when pasted alone."""

from __future__ import annotations

import glob
import re
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
# Where a path in backticks may begin.
STARTS = (
    ROOT,
    ROOT / "hose_mj",
    ROOT / "hose_mj/hoses",
    ROOT / "learning",
    ROOT / "learning/hose_learning",
)


class Block(NamedTuple):
    """One fenced block of a page: its line, its info string (``python quotation``), its text."""

    page: Path
    line: int
    info: str
    text: str


def name_page(page):
    return str(page.relative_to(ROOT))


def read_blocks(page):
    text = page.read_text(encoding="utf-8")
    fences = re.finditer(r"^( *)```([^\n`]*)\n(.*?)^ *```$", text, re.MULTILINE | re.DOTALL)
    for fence in fences:
        indent = fence[1]
        inside = re.sub(rf"^{indent}", "", fence[3], flags=re.MULTILINE)
        yield Block(page, text[: fence.start()].count("\n") + 1, fence[2].strip(), inside)


def read_prose(page):
    """A page without its fenced blocks."""
    text = page.read_text(encoding="utf-8")
    return re.sub(r"^ *```.*?^ *```$", "", text, flags=re.MULTILINE | re.DOTALL)


def make_anchor(heading):
    """The anchor under which a heading is found, as forges make it."""
    plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"[^\w\- ]", "", plain.strip().lower()).replace(" ", "-")


def list_anchors(page):
    headings = re.findall(r"^#+ (.+)$", read_prose(page), re.MULTILINE)
    return {make_anchor(heading) for heading in headings}


def find_broken_link(page, link):
    """Says what is wrong with a link of a page, or None."""
    if re.match(r"[a-z]+:", link):
        return None
    place, _, anchor = link.partition("#")
    target = (page.parent / place).resolve() if place else page
    if not target.exists():
        return f"{link}: no such file"
    if anchor and target.suffix == ".md" and anchor not in list_anchors(target):
        return f"{link}: no such heading"
    return None


def spread_braces(path):
    """`a{b,c}` as `ab` and `ac`."""
    found = re.search(r"\{([^{}]*)\}", path)
    if not found:
        return [path]
    middles = found[1].split(",")
    return [
        p for m in middles for p in spread_braces(path[: found.start()] + m + path[found.end() :])
    ]


def is_tracked(path):
    done = subprocess.run(
        ["git", "check-ignore", "-q", path], cwd=ROOT, capture_output=True, check=False
    )
    return done.returncode != 0


def find_missing_path(page, path):
    """Says that a path in backticks leads nowhere, or None; what git ignores is a user's own."""
    tops = {entry.name for entry in ROOT.iterdir()}
    if re.search(r"-v\d$", path):  # the id of an environment
        return None
    if not (path.endswith(".py") or path.split("/")[0] in tops) or not is_tracked(path):
        return None
    for one in spread_braces(path):
        if not any(glob.glob(str(start / one)) for start in (*STARTS, page.parent)):
            return one
    return None


@pytest.mark.parametrize("page", PAGES, ids=name_page)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)\s]+)\)", read_prose(page))
    assert [broken for link in links if (broken := find_broken_link(page, link))] == []


@pytest.mark.parametrize("page", PAGES, ids=name_page)
def test_paths_exist(page):
    paths = re.findall(r"`([\w./*{},-]+/[\w./*{},-]*)`", read_prose(page))
    assert [missing for path in paths if (missing := find_missing_path(page, path))] == []


def test_what_is_wrong_is_found(tmp_path):
    page = ROOT / "README.md"
    assert find_broken_link(page, "docs/nothing.md")
    assert find_broken_link(page, "docs/physics.md#nothing")
    assert find_broken_link(page, "docs/physics.md#limits") is None
    assert find_missing_path(page, "hose_mj/nothing.py")
    assert find_missing_path(page, "hose_mj/{errors,nothing}.py")
    assert find_missing_path(page, "hose_mj/{errors,checks}.py") is None
    assert (
        make_anchor("`hose-mj` and [its](x.md) commands, plainly")
        == "hose-mj-and-its-commands-plainly"
    )


EXAMPLES = [
    block for page in PAGES for block in read_blocks(page) if block.info.split()[:1] == ["python"]
]


@pytest.mark.parametrize(
    "block",
    [block for block in EXAMPLES if block.info == "python"],
    ids=lambda block: f"{name_page(block.page)}:{block.line}",
)
def test_an_example_runs_when_pasted_alone(block, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    place = f"{name_page(block.page)}, line {block.line}"
    exec(compile(block.text, place, "exec"), {"__name__": "__main__"})


def test_what_is_not_run_is_marked_as_a_quotation():
    assert {block.info for block in EXAMPLES} <= {"python", "python quotation"}


QUOTATIONS = [
    block
    for block in EXAMPLES
    if block.info == "python quotation" and "learners" not in block.page.parts
]


@pytest.mark.parametrize("block", QUOTATIONS, ids=lambda b: f"{name_page(b.page)}:{b.line}")
def test_a_quotation_is_python(block):
    compile(block.text, name_page(block.page), "exec")
