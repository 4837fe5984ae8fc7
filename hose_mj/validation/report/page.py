"""The page of `hose-mj compare`: what was measured, in the order a physicist asks for it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.recording.page import Page, Picture, Section
from hose_mj.recording.palette import name_model
from hose_mj.validation.compare import CaseResult, Ratio, find_cheapest
from hose_mj.validation.report.own_page import write_own
from hose_mj.validation.report.pictures import (
    HERO,
    Pictures,
    choose_ratios,
    group_statics,
)
from hose_mj.validation.report.tables import HEADER, TIMES, make_ratio_row, make_row, write_runs
from hose_mj.validation.report.texts import write_method, write_physics
from hose_mj.validation.run import EQUAL_ERRORS
from hose_mj.validation.study import Study

_STATIC_COLUMNS = (0, 1, 2, 5, 6)
"""Columns of case and `HEADER` that a static case fills."""


def make_report(study: Study, document: dict[str, Any], pictures: Pictures, path: Path) -> Path:
    """Writes the page and returns its path."""
    machine = document["machine"]
    page = Page(
        study.own.own.title if study.own else "GEDS against MuJoCo's cable and closed forms",
        subtitle=f"hose-mj {document['version']}, revision {str(document['revision'])[:12]}",
        footer=f"{machine['cpu']}, {machine['cores']} cores, {machine['os']}, "
        f"Python {machine['python']}, seed {document['seed']}",
    )
    if study.own is not None:
        write_own(page, study.own, study.ratios, pictures)
        write_physics(page)
    else:
        _write_glance(page, study, pictures)
        write_physics(page)
        _write_motions(page, study, pictures)
        _write_statics(page, study, pictures)
        _write_numerics(page, pictures)
        write_method(page, study.quick)
    page.write(path)
    return path


def _write_glance(page: Page, study: Study, pictures: Pictures) -> None:
    section = page.section("At a glance")
    failed = [check for check in study.checks if not check.ok]
    section.paragraph(
        f"**{len(study.checks) - len(failed)} of {len(study.checks)} checks hold.** GEDS is a "
        "cubic spline with a banded implicit solve; MuJoCo's composite cable is a chain of rigid "
        "segments with explicit elastic forces; the hinge chain is its cheapest planar form; the "
        "flex is a row of point masses with implicit bending, and what MuJoCo 4 is left with."
    )
    _write_verdict(section, study.ratios)
    if "overview" in pictures:
        section.figures([Picture(pictures["overview"], _OVERVIEW)])
    pair = [
        Picture(pictures[name], alt, alt)
        for name, alt in _GLANCE_STATICS.items()
        if name in pictures
    ]
    if pair:
        section.figures(pair)
    _write_ratios(section, study)
    if study.checks:
        section.subsection("Checks").checks(study.checks)


_OVERVIEW = "The released rod: snapshots of the motion, and error over wall time of each model"
_GLANCE_STATICS = {
    "heavy-cantilever-shapes": "A cantilever under growing weight, \u0393 = \u03c1 g L\u00b3 / EI",
    "heavy-cantilever": "Its error against the elastica, over the resolution",
}


def _write_verdict(section: Section, ratios: Sequence[Ratio]) -> None:
    """A sentence for each equal error of the hero, or of the first case that has ratios."""
    cases = list(dict.fromkeys(ratio.case for ratio in ratios))
    if not cases:
        return
    case = HERO if HERO in cases else cases[0]
    parts = []
    for level in EQUAL_ERRORS:
        found = [r for r in choose_ratios(ratios, case) if r.at_error == level]
        if found:
            texts = [f"the {name_model(r.against)} **{r.wall_ratio:.3g}{TIMES}**" for r in found]
            parts.append(f"at {100 * level:g} % error {' and '.join(texts)}")
    name = case.replace("-", " ").capitalize()
    section.paragraph(f"{name}, wall time over that of GEDS: {'; '.join(parts)}.")


def _write_ratios(section: Section, study: Study) -> None:
    cases = list(dict.fromkeys(ratio.case for ratio in study.ratios))
    like = [ratio for case in cases for ratio in choose_ratios(study.ratios, case)]
    header = ["case", "error", "against", "GEDS is cheaper by", "GEDS at", "the other at"]
    if like:
        caption = (
            "Wall time at equal error, every model at its cheapest setting of the grid; like "
            "against like: space against the cable and the flex, plane against the hinge chain."
        )
        section.table(header, [make_ratio_row(ratio) for ratio in like], caption)
    rest = [ratio for ratio in study.ratios if ratio not in like]
    if rest:
        fold = section.fold(f"{len(rest)} more ratios, space against plane")
        fold.table(header, [make_ratio_row(ratio) for ratio in rest])


def _write_motions(page: Page, study: Study, pictures: Pictures) -> None:
    motions = [result for result in study.results if result.case.motion is not None]
    if not motions:
        return
    section = page.section("Motions")
    section.paragraph(
        "Error: largest distance from the converged motion over the whole run, as a fraction of "
        "the length. A line joins a model's best settings, labelled with control points or "
        "segments and time step; hollow marks on dotted lines have MuJoCo's clamp as documented, "
        "filled ones have it corrected by half a segment. Bars along a level say how many times "
        "as long the other model takes at equal error."
    )
    section.link("models.rrd: the motions overlaid, for the Rerun viewer", "models.rrd")
    for result in motions:
        _write_motion(section, result, pictures)


def _write_motion(section: Section, result: CaseResult, pictures: Pictures) -> None:
    case = result.case
    block = section.subsection(case.title)
    block.paragraph(case.about)
    block.paragraph(_describe_references(result))
    if f"{case.id}-work-precision" in pictures:
        block.figure(pictures[f"{case.id}-work-precision"], f"{case.title}: error over wall time")
    pair = [
        Picture(pictures[f"{case.id}-{kind}"], f"{case.title}: {kind}", caption)
        for kind, caption in (
            ("shapes", "Shapes at a few instants, the earlier the paler."),
            ("distance", "Distance between the models' centre lines over time."),
        )
        if f"{case.id}-{kind}" in pictures
    ]
    if pair:
        block.figures(pair)
    rows = [
        [f"{100 * at_error:g} %", *make_row(best)]
        for at_error in EQUAL_ERRORS
        for model in case.models
        for planar in ((False, True) if model == "geds" else (False,))
        if (best := find_cheapest(result.outcomes, model, at_error, planar=planar)) is not None
    ]
    if rows:
        block.table(["within", *HEADER], rows, "Cheapest settings.")
    write_runs(block, result)


def _describe_references(result: CaseResult) -> str:
    parts = []
    for name, reference in (
        ("the reference of GEDS", result.stretchable),
        ("the inextensible one of the chains", result.inextensible),
    ):
        if reference is not None:
            parts.append(f"{name} is converged to {reference.uncertainty:.1e} L")
    text = ", ".join(parts) + "."
    text = text[0].upper() + text[1:]
    if result.stretchable is not None and result.inextensible is not None and result.case.scale:
        gap = result.stretchable.values - result.inextensible.values
        largest = np.max(np.linalg.norm(gap.reshape(len(gap), -1, 3), axis=2)) / result.case.scale
        text += f" The stretch between them is {largest:.1e} L."
    if result.limit_gap is not None:
        text += (
            " MuJoCo's hinge chain, extrapolated to infinitely many segments, agrees with the "
            f"inextensible reference to {result.limit_gap:.1e} L."
        )
    return text


def _write_statics(page: Page, study: Study, pictures: Pictures) -> None:
    groups = group_statics(study.results)
    if not groups:
        return
    section = page.section("Statics and frequencies against closed forms")
    section.paragraph(
        "A panel for each model, a line for each parameter, error over resolution. Dotted lines "
        "through hollow marks have MuJoCo's clamp as documented."
    )
    header = ["case", *HEADER]
    for family, members in groups.items():
        block = section.subsection(family.replace("-", " ").capitalize())
        block.paragraph(members[0].case.about)
        kinds = {family: "error by model and resolution", f"{family}-shapes": "equilibria"}
        drawn = [
            Picture(pictures[name], f"{family}: {alt}")
            for name, alt in kinds.items()
            if name in pictures
        ]
        if len(drawn) > 1:
            block.figures(drawn)
        elif drawn:
            block.figure(drawn[0].png, drawn[0].alt)
        rows = [[r.case.id, *make_row(o)] for r in members for o in r.outcomes]
        if rows:
            columns = [header[k] for k in _STATIC_COLUMNS]
            kept = [[row[k] for k in _STATIC_COLUMNS] for row in rows]
            block.fold(f"All {len(rows)} numbers").table(columns, kept)


def _write_numerics(page: Page, pictures: Pictures) -> None:
    names = [
        name
        for name in pictures
        if name in ("cost", "energy") or name.startswith(("error-of", "error-over"))
    ]
    if not names:
        return
    section = page.section("GEDS's own numerics")
    section.paragraph("Each line ends in its name and its measured slope.")
    section.figures([Picture(pictures[name], name.replace("-", " ")) for name in names])
