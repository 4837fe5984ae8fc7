"""Files of `hose-mj compare`: numbers, plots, recording, report; each written in one piece."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.recording.document import format_document
from hose_mj.recording.episode import HoseTrack, Scene, Series
from hose_mj.recording.files import write_atomically
from hose_mj.recording.palette import COLORS
from hose_mj.recording.parquet import write_records
from hose_mj.recording.plots.api import choose_length_unit
from hose_mj.recording.rerun import write_recording
from hose_mj.validation.compare import CaseResult
from hose_mj.validation.report.page import make_report
from hose_mj.validation.report.pictures import (
    HERO,
    choose_shown,
    compute_distance,
    draw_all,
    name_setting,
)
from hose_mj.validation.run import Outcome
from hose_mj.validation.study import Study


def write_all(study: Study, document: dict[str, Any], folder: Path) -> Path:
    """Writes everything into a folder and returns the path of report.html."""
    columns = {"timestep": float, "clamp_corrected": bool, "wall_s_per_sim_s": float}
    write_records(
        document["records"],
        folder / "records.parquet",
        folder / "records.csv",
        metadata={name: str(document[name]) for name in ("version", "revision", "machine")},
        types=columns,
    )
    write_atomically(folder / "document.json", format_document(document).encode())
    pictures = draw_all(study)
    for name, png in pictures.items():
        write_atomically(folder / "plots" / f"{name}.png", png)
    motions = [result for result in study.results if study.own or result.case.motion is not None]
    motions.sort(key=lambda result: result.case.id != HERO)  # the first is the one in view
    made = [make_scene(result, study.shown_within) for result in motions]
    scenes = [scene for scene in made if scene is not None]
    if scenes:
        settings = {str(k): str(v) for k, v in document["settings"].items()}
        settings["revision"] = str(document["revision"])
        write_recording(folder / "models.rrd", scenes, settings, "hose-mj-compare")
    return make_report(study, document, pictures, folder / "report.html")


def make_scene(result: CaseResult, within: float) -> Scene | None:
    """The models of a motion overlaid, with their distances from GEDS; None without a run."""
    shown = choose_shown(result, within)
    if not shown:
        return None
    case = result.case
    tracks = tuple(
        HoseTrack(
            f"{model} {name_setting(outcome)}",
            np.linspace(0.0, case.spec.length, outcome.points.shape[1]),
            outcome.times,
            outcome.points,
            case.spec.outer_radius,
            COLORS[model],
        )
        for model, outcome in shown.items()
    )
    errors = "\n".join(
        f"- {outcome.setting.label}: error {100 * outcome.error:.2g} %"
        for outcome in shown.values()
    )
    return Scene(case.id, case.title, tracks, _list_distances(shown), f"{case.about}\n\n{errors}")


def _list_distances(shown: dict[str, Outcome]) -> tuple[Series, ...]:
    """Distances from GEDS, in millimetres where they are small."""
    if "geds" not in shown:
        return ()
    gaps = {
        model: compute_distance(shown["geds"], outcome)
        for model, outcome in shown.items()
        if model != "geds"
    }
    unit, factor = choose_length_unit(max((float(gap.max()) for gap in gaps.values()), default=0.0))
    return tuple(
        Series(f"{model} to GEDS", shown[model].times, factor * gap, unit)
        for model, gap in gaps.items()
    )
