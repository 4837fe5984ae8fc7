"""Files of `hose-mj compare`: numbers, plots, recording, report; each written in one piece."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.recording import plots
from hose_mj.recording.episode import HoseTrack, Scene, Series
from hose_mj.recording.files import write_atomically
from hose_mj.recording.palette import COLORS
from hose_mj.recording.parquet import write_records
from hose_mj.recording.rerun import write_recording
from hose_mj.validation.compare import CaseResult, find_cheapest
from hose_mj.validation.run import Outcome
from tools.compare_report import Plots, make_report
from tools.compare_study import Study
from tools.document import format_document

N_SNAPSHOTS = 6
"""Instants drawn into one picture of shapes."""


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
    scenes = [make_scene(result) for result in study.results if result.case.motion is not None]
    scenes = [scene for scene in scenes if scene is not None]
    if scenes:
        settings = {str(k): str(v) for k, v in document["settings"].items()}
        settings["revision"] = str(document["revision"])
        write_recording(folder / "models.rrd", scenes, settings, "hose-mj-compare")
    return make_report(study, document, pictures, folder / "report.html")


def draw_all(study: Study) -> Plots:
    """Returns the PNG of every plot by file name."""
    pictures: Plots = {}
    for result in study.results:
        if result.case.motion is not None:
            pictures.update(_draw_motion(result))
    for family, members in group_statics(study.results).items():
        points = [
            plots.ErrorPoint(
                outcome.setting.model,
                f"{_parameter(result)}{outcome.setting.resolution}",
                outcome.error,
                outcome.setting.clamp_corrected,
            )
            for result in members
            for outcome in result.outcomes
        ]
        if points:
            pictures[family] = plots.plot_bars_vs_reference(family.replace("-", " "), points)
    pictures.update(_draw_numerics(study))
    return pictures


def group_statics(results: list[CaseResult]) -> dict[str, list[CaseResult]]:
    """Static results by family, in order."""
    groups: dict[str, list[CaseResult]] = {}
    for result in results:
        if result.case.motion is None:
            groups.setdefault(result.case.family, []).append(result)
    return groups


def choose_shown(result: CaseResult) -> dict[str, Outcome]:
    """The run of each model that pictures and recording show: the cheapest within 1 %, or the best."""
    shown = {}
    for model in dict.fromkeys(outcome.setting.model for outcome in result.outcomes):
        best = find_cheapest(result.outcomes, model, 0.01)
        if best is None:
            mine = [outcome for outcome in result.outcomes if outcome.setting.model == model]
            best = min(mine, key=lambda outcome: outcome.error)
        shown[model] = best
    return shown


def compute_distance(one: Outcome, other: Outcome) -> np.ndarray:
    """Largest distance between two centre lines at each instant, (k,), m."""
    return np.max(np.linalg.norm(one.points - other.points, axis=2), axis=1)


def make_scene(result: CaseResult) -> Scene | None:
    """The models of a motion overlaid, with their distances from GEDS; None without a run."""
    shown = choose_shown(result)
    if not shown:
        return None
    tracks = tuple(
        HoseTrack(
            outcome.setting.label,
            np.linspace(0.0, result.case.spec.length, outcome.points.shape[1]),
            outcome.times,
            outcome.points,
            result.case.spec.radius,
            COLORS[model],
        )
        for model, outcome in shown.items()
    )
    series = tuple(
        Series(
            f"{model} to geds", shown[model].times, compute_distance(shown["geds"], outcome), "m"
        )
        for model, outcome in shown.items()
        if model != "geds" and "geds" in shown
    )
    return Scene(result.case.id, result.case.title, tracks, series, result.case.about)


def _parameter(result: CaseResult) -> str:
    tail = result.case.id.removeprefix(result.case.family).lstrip("-")
    return f"{tail}, " if tail else ""


def _draw_motion(result: CaseResult) -> Plots:
    case = result.case
    points = [
        plots.WorkPoint(
            outcome.setting.model,
            str(outcome.setting.resolution),
            outcome.error,
            outcome.wall_s_per_sim_s or np.nan,
            outcome.setting.clamp_corrected,
        )
        for outcome in result.outcomes
    ]
    pictures: Plots = {}
    if points:
        pictures[f"{case.id}-work-precision"] = plots.plot_work_precision(case.title, points)
    shown = choose_shown(result)
    if shown:
        one = next(iter(shown.values()))
        picks = np.linspace(0, len(one.times) - 1, N_SNAPSHOTS).round().astype(int)
        curves = {outcome.setting.label: outcome.points[picks] for outcome in shown.values()}
        pictures[f"{case.id}-shapes"] = plots.plot_shapes(
            case.title, curves, times=[float(one.times[k]) for k in picks]
        )
    if "geds" in shown and len(shown) > 1:
        groups = {
            outcome.setting.label: (outcome.times, compute_distance(shown["geds"], outcome))
            for model, outcome in shown.items()
            if model != "geds"
        }
        pictures[f"{case.id}-distance"] = plots.plot_series(
            "Largest distance from " + shown["geds"].setting.label, "distance (m)", groups
        )
    return pictures


def _draw_numerics(study: Study) -> Plots:
    pictures: Plots = {}
    for title, curves in study.curves.items():
        if title.startswith("Wall"):
            pictures["cost"] = plots.plot_convergence(title, "control points", curves, (1.0,))
            continue
        slopes = (4.0,) if "frequencies" in title else (3.0,) if "swing" in title else (1.0, 2.0)
        xlabel = "time step (s)" if "time step" in title else "span length (m)"
        name = title.lower().replace(" ", "-")
        pictures[name] = plots.plot_convergence(
            title, xlabel, curves, slopes, finer_is_larger=False
        )
    if study.energy is not None:
        pictures["energy"] = plots.plot_series(
            "Energy of the released rod over ten seconds, BDF2 at 5 ms",
            "energy over its start",
            {"geds, 12 control points": study.energy},
        )
    return pictures
