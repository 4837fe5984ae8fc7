"""Tables of the page of `hose-mj compare`: a row per run, a row per ratio."""

from __future__ import annotations

import re
from typing import Any

from hose_mj.recording.page import Block
from hose_mj.recording.plots.api import format_seconds
from hose_mj.validation.compare import CaseResult, Ratio
from hose_mj.validation.report.pictures import name_setting
from hose_mj.validation.run import Outcome

TIMES = "\u00d7"
HEADER = ["model", "resolution", "step", "scheme", "clamp", "error", "wall s / sim s", "fallbacks"]


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


def make_row(outcome: Outcome) -> list[Any]:
    """The cells under `HEADER`."""
    setting = outcome.setting
    clamp = {None: "", True: "corrected", False: "raw"}[setting.clamp_corrected]
    wall = outcome.wall_s_per_sim_s
    return [
        setting.model,
        setting.resolution,
        "" if setting.timestep is None else name_setting(outcome).split(", ")[-1],
        setting.scheme,
        clamp,
        f"{100 * outcome.error:.3g} %",
        "" if wall is None else f"{wall:.3g}",
        outcome.fallbacks,
    ]


def write_runs(block: Block, result: CaseResult) -> None:
    """Folds with all runs and with all settings that were not scored."""
    if result.outcomes:
        fold = block.fold(f"All {len(result.outcomes)} runs")
        fold.table(HEADER, [make_row(outcome) for outcome in result.outcomes], "")
    if result.skipped:
        fold = block.fold(f"{len(result.skipped)} settings not scored")
        fold.table(["setting", "why"], [[s.setting.label, s.why] for s in result.skipped], "")
