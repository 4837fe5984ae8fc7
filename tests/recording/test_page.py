import re
import xml.etree.ElementTree as ElementTree

import pytest

from hose_mj.checks import Check
from hose_mj.errors import InputError
from hose_mj.recording.page import Page, Picture, group_checks
from hose_mj.recording.plots.curves import plot_series

NASTY = "<script>alert('&\"')</script>"


@pytest.fixture(scope="module")
def png():
    return plot_series("t", "y", {"geds": ([0.0, 1.0], [0.0, 1.0])})


@pytest.fixture(scope="module")
def document(png):
    page = Page(NASTY, NASTY, NASTY)
    page.paragraph(NASTY + " `a < b` and **strong**")
    page.definitions({NASTY: NASTY, "step": 0.002})
    section = page.section(NASTY)
    section.table([NASTY, "error"], [[NASTY, 1.5e-3], ["b", None]], NASTY)
    section.figure(png, NASTY, NASTY)
    section.figures([Picture(png, NASTY), Picture(png, NASTY, NASTY)])
    section.checks([Check(NASTY, 0.1, 1.0), Check("two", 3.0, 2.0)])
    section.equation(NASTY, "1")
    section.code(NASTY)
    section.link(NASTY, "compare.rrd?" + NASTY)
    section.fold(NASTY).paragraph("inside")
    page.section("Twice").subsection("Below").paragraph("x")
    page.section("Twice")
    return page.render()


def parse(document):
    return ElementTree.fromstring(document.removeprefix("<!DOCTYPE html>\n"))


def test_the_page_is_well_formed_and_runs_nothing(document):
    tree = parse(document)
    assert tree.tag == "html"
    assert not list(tree.iter("script"))
    assert "".join(tree.find("head/title").itertext()) == NASTY
    assert not [key for e in tree.iter() for key in e.attrib if key.startswith("on")]


def test_nothing_is_fetched(document):
    for value in re.findall(r'(?:src|href)="([^"]*)"', document):
        assert value.startswith(("#", "data:image/png;base64,", "compare.rrd"))
    assert not re.search(r"url\(|@import|https?:", document)


def test_the_contents_lead_to_every_section(document):
    tree = parse(document)
    ids = [e.attrib["id"] for e in tree.iter() if "id" in e.attrib]
    links = [e.attrib["href"] for e in tree.find(".//nav").iter("a")]
    assert len(ids) == len(set(ids)) == 4
    assert links == [f"#{name}" for name in ids]


def test_numbers_are_aligned_right_and_texts_are_not(document):
    cells = list(parse(document).find(".//table/tbody/tr"))
    assert [cell.get("class") for cell in cells] == [None, "number"]


def test_checks_have_badges(document):
    badges = [e for e in parse(document).iter("span") if "badge" in e.get("class", "")]
    assert [(e.get("class"), e.text) for e in badges] == [
        ("badge failed", "failed"),  # once more above all others
        ("badge ok", "ok"),
        ("badge failed", "failed"),
    ]


def test_checks_that_share_a_part_of_their_names_stand_together():
    names = ("rod: a", "rod: b", "drift, x", "drift, y", "m: error", "n: error", "alone, z", "last")
    groups = group_checks([Check(name, 0.0, 1.0) for name in names])
    assert {heading: [rest for rest, _ in some] for heading, some in groups.items()} == {
        "rod": ["a", "b"],
        "drift": ["x", "y"],
        "error": ["m", "n"],
        "Others": ["alone, z", "last"],
    }


def test_a_phone_shows_the_page_at_its_own_width(document):
    viewport = parse(document).find("head/meta[@name='viewport']")
    assert viewport.get("content") == "width=device-width, initial-scale=1"


def test_running_text_marks_code_and_strong():
    page = Page("t")
    page.paragraph("`**a**` **b** c")
    assert "<p><code>**a**</code> <strong>b</strong> c</p>" in page.render()


def test_bad_input_is_refused(png, tmp_path):
    section = Page("t").section("s")
    with pytest.raises(InputError, match="row 1"):
        section.table(["a", "b"], [[1, 2], [1]])
    with pytest.raises(InputError, match="PNG"):
        section.figure(b"GIF89a", "alt")
    for target in ("https://example.org", "javascript:alert(1)", "//example.org/x"):
        with pytest.raises(InputError, match="relative path"):
            section.link("x", target)
    with pytest.raises(InputError, match="level"):
        section.subsection("a").subsection("b")


def test_a_page_is_written_whole(tmp_path):
    Page("Größe").write(tmp_path / "deep" / "report.html")
    assert "Größe" in (tmp_path / "deep" / "report.html").read_text(encoding="utf-8")
