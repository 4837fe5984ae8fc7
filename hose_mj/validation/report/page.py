"""Files of `hose-mj compare`, each written in one piece: numbers, plots, recording, the page.

The page says what was measured in the order a physicist asks for it; the words that depend on no
measurement stand in texts.md.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from hose_mj.recording.document import format_document
from hose_mj.recording.files import write_atomically
from hose_mj.recording.page import Block, Page, Picture, Section
from hose_mj.recording.palette import name_model
from hose_mj.recording.parquet import write_records
from hose_mj.recording.plots.style import format_seconds
from hose_mj.recording.rerun.comparison import write_recording
from hose_mj.validation import settings
from hose_mj.validation.cases import find_trials
from hose_mj.validation.compare import CaseResult, Ratio, find_cheapest
from hose_mj.validation.report.findings import describe_findings, make_answer_row
from hose_mj.validation.report.pictures import (
    HERO,
    Pictures,
    choose_ratios,
    draw_all,
    group_statics,
    make_scene,
    name_setting,
)
from hose_mj.validation.run import EQUAL_ERRORS, RunResult
from hose_mj.validation.study import Study
from hose_mj.validation.user_hose.study import UserHoseStudy

TIMES = "\u00d7"
HEADER = ["model", "resolution", "step", "scheme", "clamp", "error", "wall s / sim s", "fallbacks"]
_STATIC_COLUMNS = (0, 1, 2, 5, 6)  # columns of case and `HEADER` that a static case fills
_RATIO_HEADER = ["case", "error", "against", "GEDS is cheaper by", "GEDS at", "the other at"]
_RATIO_CAPTION = (
    "Wall time at equal error, every model at its cheapest setting of the grid; like "
    "against like: space against the cable and the flex, plane against the hinge chain."
)
_TEXTS = Path(__file__).with_name("texts.md")


def write_all(study: Study, document: dict[str, Any], folder: Path) -> Path:
    """Writes everything into a folder and returns the path of report.html."""
    write_records(
        document["records"],
        folder / "records.parquet",
        folder / "records.csv",
        metadata={name: str(document[name]) for name in ("version", "revision", "machine")},
        types={"timestep": float, "clamp_corrected": bool, "wall_s_per_sim_s": float},
    )
    write_atomically(folder / "document.json", format_document(document).encode())
    pictures = draw_all(study)
    for name, png in pictures.items():
        write_atomically(folder / "plots" / f"{name}.png", png)
    motions = [result for result in study.results if study.user or result.case.motion is not None]
    motions.sort(key=lambda result: result.case.id != HERO)  # the first is the one in view
    scenes = [s for result in motions if (s := make_scene(result, study.shown_within)) is not None]
    if scenes:
        shown = {str(k): str(v) for k, v in document["settings"].items()}
        shown["revision"] = str(document["revision"])
        write_recording(folder / "models.rrd", scenes, shown, "hose-mj-compare")
    return make_report(study, document, pictures, folder / "report.html")


def make_report(study: Study, document: dict[str, Any], pictures: Pictures, path: Path) -> Path:
    """Writes the page and returns its path."""
    machine, user = document["machine"], study.user
    page = Page(
        user.hose.title if user else "GEDS against MuJoCo's cable and closed forms",
        subtitle=f"hose-mj {document['version']}, revision {str(document['revision'])[:12]}",
        footer=f"{machine['cpu']}, {machine['cores']} cores, {machine['os']}, "
        f"Python {machine['python']}, seed {document['seed']}",
    )
    if user is not None:
        _write_user_hose(page, user, study.ratios, pictures)
        write_text(page, "The physics in brief")
    else:
        _write_glance(page, study, pictures)
        write_text(page, "The physics in brief")
        _write_motions(page, study, pictures)
        _write_statics(page, study, pictures)
        _write_committed(page, study)
        _write_trials(page, study, pictures)
        _write_numerics(page, pictures)
        _write_method(page, settings.QUICK if study.quick else settings.FULL)
    page.write(path)
    return path


def write_text(page: Page, heading: str, **values: object) -> Section:
    """Adds the section of texts.md under a heading: paragraphs, and indented equations (number)."""
    parts = _TEXTS.read_text(encoding="utf-8").split("\n# ")
    _, *paragraphs = next(p for p in parts if p.startswith(f"{heading}\n")).strip().split("\n\n")
    section = page.section(heading)
    for text in paragraphs:
        equation = re.fullmatch(r"    (.*)    \((\w+)\)", text)
        if equation is not None:
            section.equation(equation[1], equation[2])
        else:
            section.paragraph(Template(text).substitute(values))
    return section


def _show(block: Block, pictures: Pictures, captions: dict[str, str]) -> None:
    """Adds the pictures by file name that were drawn, with what they show below them, if any."""
    drawn = [Picture(pictures[n], text, text) for n, text in captions.items() if n in pictures]
    if drawn:
        block.figures(drawn)


def _write_glance(page: Page, study: Study, pictures: Pictures) -> None:
    n_held = sum(check.ok for check in study.checks)
    section = write_text(page, "At a glance", n_held=n_held, n_checks=len(study.checks))
    _write_verdict(section, study.ratios)
    if "overview" in pictures:
        section.figures([Picture(pictures["overview"], _OVERVIEW)])
    _show(section, pictures, _GLANCE_STATICS)
    _write_ratios(section, study)
    if study.checks:
        section.subsection("Checks").checks(study.checks)


_MOTION_PICTURES = {
    "shapes": "Shapes at a few instants, the earlier the paler.",
    "distance": "Distance between the models' centre lines over time.",
}
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
    if like:
        section.table(_RATIO_HEADER, [make_ratio_row(ratio) for ratio in like], _RATIO_CAPTION)
    rest = [ratio for ratio in study.ratios if ratio not in like]
    if rest:
        fold = section.fold(f"{len(rest)} more ratios, space against plane")
        fold.table(_RATIO_HEADER, [make_ratio_row(ratio) for ratio in rest])


def _write_motions(page: Page, study: Study, pictures: Pictures) -> None:
    motions = [result for result in study.results if result.case.motion is not None]
    if not motions:
        return
    section = write_text(page, "Motions")
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
        for kind, caption in _MOTION_PICTURES.items()
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
    named = {
        "the reference of GEDS": result.stretchable,
        "the inextensible one of the chains": result.inextensible,
    }
    parts = [f"{n} is converged to {r.uncertainty:.1e} L" for n, r in named.items() if r]
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
    section = write_text(page, "Statics and frequencies against closed forms")
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
            kept = [[row[k] for k in _STATIC_COLUMNS] for row in rows]
            columns = [header[k] for k in _STATIC_COLUMNS]
            block.fold(f"All {len(rows)} numbers").table(columns, kept)


def _write_committed(page: Page, study: Study) -> None:
    """The runs of the cable that stand in for it where MuJoCo has none."""
    cable = study.committed
    if cable is None:
        return
    section = write_text(
        page, "MuJoCo's cable, as committed", here=cable.here, mujoco=cable.mujoco, cpu=cable.cpu
    )
    columns = ("case", "resolution", "timestep", "scheme", "error", "wall_s_per_sim_s")
    fold = section.fold(f"All {len(cable.records)} runs")
    rows = [[record[name] for name in columns] for record in cable.records]
    fold.table(["case", "segments", "step (s)", "scheme", "error", "wall s / sim s"], rows)


def _write_trials(page: Page, study: Study, pictures: Pictures) -> None:
    """A part for each trial: its words and pictures; its checks stand with all others."""
    if not study.findings:
        return
    section = write_text(page, "Hard cases")
    for trial in find_trials(tuple(study.findings)):
        block = section.subsection(trial.title)
        block.paragraph(trial.about)
        for name, plot in study.findings[trial.id].plots.items():
            block.figure(pictures[name], plot.title)


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


def _write_method(page: Page, grid: settings.Grid) -> None:
    """Writes how the peers were treated, and the grid of settings."""
    section = write_text(
        page,
        "How the peers were treated",
        largest_step=f"{1e3 * settings.LARGEST_STEP:g}",
        stagnation=f"{100 * settings.STAGNATION:g}",
        cable_twist=f"{settings.CABLE_TWIST:g}",
    )
    section.fold("The grid of settings").definitions(
        {
            "GEDS control points": ", ".join(map(str, grid.dynamic["geds"])),
            "chain segments": ", ".join(map(str, grid.dynamic["hinge-chain"])),
            "GEDS schemes": "; ".join(grid.schemes["geds"]) + "; Newton tolerance 1e-3 L",
            "flex segments": ", ".join(map(str, grid.dynamic["flex"])),
            "cable integrators": ", ".join(grid.schemes["cable"]),
            "hinge-chain integrators": ", ".join(grid.schemes["hinge-chain"]),
            "flex integrator": ", ".join(grid.schemes["flex"]),
            "MuJoCo solver": "Newton, 100 iterations, tolerance 1e-8, the faster Jacobian: "
            "chains dense, flex sparse",
            "longest run scored": f"{grid.longest_run:g} s",
            "timing": f"least of {grid.rounds} rounds, all models in turn, one thread",
        }
    )


def _write_user_hose(
    page: Page, study: UserHoseStudy, ratios: Sequence[Ratio], pictures: Pictures
) -> None:
    """Writes what was asked, what was found, the pictures, all runs."""
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
        rows_of_ratios = [make_ratio_row(ratio) for ratio in like]
        section.table(_RATIO_HEADER, rows_of_ratios, "Wall time at equal error.")
    section.checks(study.checks)
    section.link("models.rrd: the models overlaid, for the Rerun viewer", "models.rrd")
    if set(pictures) & set(_USER_HOSE_PICTURES):
        _show(page.section("Pictures"), pictures, _USER_HOSE_PICTURES)
    write_runs(write_text(page, "How it was measured"), study.result)


_USER_HOSE_PICTURES = {
    "own-hose-shapes": "Shapes; at several instants the earlier are the paler",
    "own-hose-work-precision": "Error over cost: a line joins a model's best settings",
    "own-hose-distance": "Distance between the models' centre lines over time",
    "own-hose": "Error over resolution",
}


def make_ratio_row(ratio: Ratio) -> list[object]:
    """Case, level, peer, how many times cheaper GEDS is, and both settings."""
    labels = (ratio.model_setting, ratio.against_setting)
    ours, theirs = (shorten_label(label).partition(", ")[2] for label in labels)
    level, times = f"{100 * ratio.at_error:g} %", f"{ratio.wall_ratio:.3g}{TIMES}"
    return [ratio.case, level, ratio.against, times, ours, theirs]


def shorten_label(label: str) -> str:
    """A label without what goes without saying, and "0.833333 ms" written as "833 \u00b5s"."""
    label = label.removesuffix(", clamp-corrected").replace("control ", "")
    return re.sub(r"([\d.]+) ms", lambda m: format_seconds(1e-3 * float(m[1])), label)


def make_row(run: RunResult) -> list[Any]:
    """The cells under `HEADER`."""
    setting, wall = run.setting, run.wall_s_per_sim_s
    return [
        setting.model,
        setting.resolution,
        "" if setting.timestep is None else name_setting(run).split(", ")[-1],
        setting.scheme,
        {None: "", True: "corrected", False: "raw"}[setting.clamp_corrected],
        f"{100 * run.error:.3g} %",
        "" if wall is None else f"{wall:.3g}",
        run.fallbacks,
    ]


def write_runs(block: Block, result: CaseResult) -> None:
    """Adds folds with all runs and with all settings that were not scored."""
    if result.outcomes:
        fold = block.fold(f"All {len(result.outcomes)} runs")
        fold.table(HEADER, [make_row(outcome) for outcome in result.outcomes])
    if result.skipped:
        fold = block.fold(f"{len(result.skipped)} settings not scored")
        fold.table(["setting", "why"], [[s.setting.label, s.why] for s in result.skipped])
