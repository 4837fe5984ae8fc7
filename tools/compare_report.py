"""The page of `hose-mj compare`: what was measured, in the order a physicist asks for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.recording.page import Block, Page, Picture, Section
from hose_mj.validation.compare import EQUAL_ERRORS, CaseResult, find_cheapest
from hose_mj.validation.run import Outcome
from hose_mj.validation.settings import CABLE_TWIST, FULL, LARGEST_STEP, QUICK, STAGNATION
from tools.compare_study import Study

Plots = dict[str, bytes]


def make_report(study: Study, document: dict[str, Any], pictures: Plots, path: Path) -> Path:
    """Writes the page and returns its path."""
    machine = document["machine"]
    page = Page(
        "GEDS against MuJoCo's cable and closed forms",
        subtitle=f"hose-mj {document['version']}, revision {document['revision']}",
        footer=f"{machine['cpu']}, {machine['cores']} cores, {machine['os']}, "
        f"Python {machine['python']}, seed {document['seed']}",
    )
    _write_glance(page, study, pictures)
    motions = [result for result in study.results if result.case.motion is not None]
    if motions:
        section = page.section("Motions")
        section.paragraph(
            "Error: largest distance from the converged motion over the whole run, as a fraction of "
            "the length. Filled marks have MuJoCo's clamp corrected by half a segment, hollow ones "
            "are as documented. Each line joins a model's best settings."
        )
        for result in motions:
            _write_motion(section, result, pictures)
    _write_statics(page, study, pictures)
    _write_numerics(page, study, pictures)
    _write_method(page, study)
    page.write(path)
    return path


def _write_glance(page: Page, study: Study, pictures: Plots) -> None:
    section = page.section("At a glance")
    failed = [check for check in study.checks if not check.ok]
    section.paragraph(
        f"**{len(study.checks) - len(failed)} of {len(study.checks)} checks hold.** GEDS is a cubic "
        "spline with a banded implicit solve; MuJoCo's composite cable is a chain of rigid segments "
        "with explicit elastic forces; the hinge chain is its cheapest planar form."
    )
    if "released-rod-work-precision" in pictures:
        section.figure(
            pictures["released-rod-work-precision"],
            alt="Error over wall time for the released rod",
            caption="Released rod: error over wall time per simulated second. Left and low is better.",
        )
    if study.ratios:
        section.table(
            ["case", "error", "GEDS is cheaper by", "GEDS at", "against"],
            [
                [
                    ratio.case,
                    f"{100 * ratio.at_error:g} %",
                    f"{ratio.wall_ratio:.1f}\u00d7",
                    ratio.model_setting.removeprefix("geds, "),
                    ratio.against_setting,
                ]
                for ratio in study.ratios
            ],
            "Wall time at equal error, every model at its cheapest setting of the grid. Space "
            "against the cable, plane against the hinge chain compares like with like.",
        )
    if study.checks:
        section.subsection("Checks").checks(study.checks)


def _write_motion(section: Section, result: CaseResult, pictures: Plots) -> None:
    case = result.case
    block = section.subsection(case.title)
    block.paragraph(case.about)
    block.paragraph(_describe_references(result))
    for kind, caption in (
        (
            "work-precision",
            "Error over wall time per simulated second; labels count segments or control points.",
        ),
        ("shapes", "Shapes at a few instants, the earlier the paler."),
        ("distance", "Distance between the models' centre lines over time."),
    ):
        name = f"{case.id}-{kind}"
        if name in pictures:
            block.figure(pictures[name], alt=f"{case.title}: {kind}", caption=caption)
    rows = []
    for at_error in EQUAL_ERRORS:
        for model in case.models:
            for planar in (False, True) if model == "geds" else (False,):
                best = find_cheapest(result.outcomes, model, at_error, planar=planar)
                if best is not None:
                    rows.append([f"{100 * at_error:g} %", *_row(best)])
    if rows:
        block.table(["within", *_HEADER], rows, "Cheapest settings.")
    _write_runs(block, result)


def _describe_references(result: CaseResult) -> str:
    parts = []
    for name, reference in (
        ("The reference of GEDS", result.stretchable),
        ("the inextensible one of the chains", result.inextensible),
    ):
        if reference is not None:
            parts.append(f"{name} is converged to {reference.uncertainty:.1e} L")
    text = ", ".join(parts) + "."
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


_HEADER = [
    "model",
    "resolution",
    "time step",
    "scheme",
    "clamp",
    "error",
    "wall s / sim s",
    "fallbacks",
]


def _row(outcome: Outcome) -> list[Any]:
    setting = outcome.setting
    clamp = {None: "", True: "corrected", False: "raw"}[setting.clamp_corrected]
    step = "" if setting.timestep is None else f"{1e3 * setting.timestep:g} ms"
    wall = outcome.wall_s_per_sim_s
    return [
        setting.model,
        setting.resolution,
        step,
        setting.scheme,
        clamp,
        f"{100 * outcome.error:.3g} %",
        "" if wall is None else f"{wall:.3g}",
        outcome.fallbacks,
    ]


def _write_runs(block: Block, result: CaseResult) -> None:
    if result.outcomes:
        fold = block.fold(f"All {len(result.outcomes)} runs")
        fold.table(_HEADER, [_row(outcome) for outcome in result.outcomes], "")
    if result.skipped:
        fold = block.fold(f"{len(result.skipped)} settings not scored")
        fold.table(["setting", "why"], [[s.setting.label, s.why] for s in result.skipped], "")


def _write_statics(page: Page, study: Study, pictures: Plots) -> None:
    statics = [result for result in study.results if result.case.motion is None]
    if not statics:
        return
    section = page.section("Statics and frequencies against closed forms")
    families: dict[str, list[CaseResult]] = {}
    for result in statics:
        families.setdefault(result.case.family, []).append(result)
    for family, members in families.items():
        block = section.subsection(family.replace("-", " ").capitalize())
        block.paragraph(members[0].case.about)
        if family in pictures:
            block.figure(pictures[family], alt=f"{family}: error by model and resolution")
        fold = block.fold("Numbers")
        rows = [[r.case.id, *_row(o)] for r in members for o in r.outcomes]
        keep = [0, 1, 2, 5, 6, 8]
        header = ["case", *_HEADER]
        fold.table([header[k] for k in keep], [[row[k] for k in keep] for row in rows], "")


def _write_numerics(page: Page, study: Study, pictures: Plots) -> None:
    names = [
        name
        for name in pictures
        if name in ("cost", "energy") or name.startswith(("error-of", "error-over"))
    ]
    if not names:
        return
    section = page.section("GEDS's own numerics")
    section.figures([Picture(pictures[name], name.replace("-", " ")) for name in names])


def _write_method(page: Page, study: Study) -> None:
    grid = QUICK if study.quick else FULL
    section = page.section("How it was measured")
    section.definitions(
        {
            "GEDS control points": ", ".join(map(str, grid.dynamic["geds"])),
            "chain segments": ", ".join(map(str, grid.dynamic["hinge-chain"])),
            "GEDS schemes": ", ".join(grid.schemes["geds"]) + "; Newton tolerance 1e-3 L",
            "cable integrators": ", ".join(grid.schemes["cable"]),
            "hinge-chain integrators": ", ".join(grid.schemes["hinge-chain"]),
            "MuJoCo solver": "Newton, 100 iterations, tolerance 1e-8, dense Jacobian (faster here)",
            "longest run scored": f"{grid.longest_run:g} s",
            "timing": f"least of {grid.rounds} rounds for short runs, all models in turn, one thread",
        }
    )
    section.paragraph(
        f"Chains start at {1e3 * LARGEST_STEP:g} ms and halve their time step until they are stable, "
        f"then go on until a halving takes less than {100 * STAGNATION:g} % off the error. The cable's "
        f"torsional stiffness is lowered to {CABLE_TWIST:g} EI in motions, all planar, which lets it take "
        "larger steps. **Equal error** means: each model at its cheapest setting on this grid whose "
        "error is within the bound. Chains are scored against the inextensible limit, GEDS against "
        "the limit with its stiffness; raw clamps never count in ratios."
    )
