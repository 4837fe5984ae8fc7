"""The page of `hose-mj compare my_hose.toml`."""

from __future__ import annotations

from collections.abc import Sequence

from hose_mj.cli.compare_own import describe_findings, make_answer_row
from hose_mj.recording.page import Page, Picture
from hose_mj.validation.compare import Ratio
from hose_mj.validation.report.pictures import Pictures, choose_ratios
from hose_mj.validation.report.tables import make_ratio_row, write_runs
from hose_mj.validation.user_hose.study import OwnStudy


def write_own(page: Page, study: OwnStudy, ratios: Sequence[Ratio], pictures: Pictures) -> None:
    """What was asked, what was found, the pictures, all runs."""
    section = page.section("At a glance")
    section.paragraph(study.result.case.about)
    for line in describe_findings(study):
        section.paragraph(line)
    header = ["within", "model", "resolution", "step", "error", "wall s / sim s"]
    caption = "The cheapest setting within a wanted error, as a fraction of the length."
    rows = [make_answer_row(answer, study.cut_short) for answer in study.answers]
    section.table(header, rows, caption)
    like = choose_ratios(ratios, study.result.case.id)
    if like:
        head = ["case", "error", "against", "GEDS is cheaper by", "GEDS at", "the other at"]
        section.table(head, [make_ratio_row(ratio) for ratio in like], "Wall time at equal error.")
    section.checks(study.checks)
    section.link("models.rrd: the models overlaid, for the Rerun viewer", "models.rrd")
    drawn = [
        Picture(pictures[name], alt, alt) for name, alt in _PICTURES.items() if name in pictures
    ]
    if drawn:
        page.section("Pictures").figures(drawn)
    runs = page.section("How it was measured")
    for text in _METHOD:
        runs.paragraph(text)
    write_runs(runs, study.result)


_PICTURES = {
    "own-hose-shapes": "Shapes; at several instants the earlier are the paler",
    "own-hose-work-precision": "Error over cost: a line joins a model's best settings",
    "own-hose-distance": "Distance between the models' centre lines over time",
    "own-hose": "Error over resolution",
}
_METHOD = (
    "Error is the largest distance from the converged hose, over 17 places along it and over the "
    "whole motion, as a fraction of the length. The converged hose is GEDS with control points and "
    "time steps refined until two resolutions agree; it stretches as much as the file says. "
    "MuJoCo's chains do not stretch, and are held against it all the same.",
    "All models start from one shape. Their time steps are halved from 10 ms at most, chains until "
    "a halving takes little off their error. Finer resolutions are left out once coarser ones are "
    "within the smallest wanted error, and when the budget is spent.",
    "MuJoCo's clamp makes its first segment rigid; it is run as documented and, in the answers, "
    "with that segment centred on the end. Where the hose stays in a plane the cable has little "
    "torsional stiffness, which lets it take larger steps.",
    "Costs are the least wall times of a few runs on one thread. MuJoCo has no static solver; the "
    "one used for its rest shapes is ours, so rest shapes are compared by their errors.",
)
