"""Sentences and cells that say what was found about a user's hose."""

from collections.abc import Collection

from hose_mj.recording.palette import name_model
from hose_mj.recording.plots.style import format_seconds
from hose_mj.validation.user_hose.answers import Answer
from hose_mj.validation.user_hose.study import UserHoseStudy


def make_answer_row(answer: Answer, cut_short: Collection[str]) -> list[str]:
    """Cells: wanted error, model, resolution, time step, error, cost.

    What models that were `cut_short` by the budget did not reach, they might with more of it.
    """
    model = f"{answer.model} planar" if answer.planar else answer.model
    row = [f"{100 * answer.at_error:g} %", name_model(model)]
    if answer.error is None:
        why = "not in the budget" if answer.model in cut_short else "not reached"
        return [*row, why, "", "", ""]
    step = "" if answer.timestep is None else format_seconds(answer.timestep)
    cost = "" if answer.wall_s_per_sim_s is None else f"{answer.wall_s_per_sim_s:.2g}"
    return [*row, str(answer.resolution), step, f"{100 * answer.error:.2g} %", cost]


def describe_findings(study: UserHoseStudy) -> list[str]:
    """Sentences on the reference, on how far each model stays away, and on what was left out."""
    reference = study.result.stretchable
    assert reference is not None
    lines = [
        f"Truth is GEDS, refined until it stood still within {_percent(reference.uncertainty)} "
        "of the length."
    ]
    for gap in study.disagreements:
        clamp = {None: "", True: ", clamp corrected", False: ", clamp as documented"}
        lines.append(
            f"{name_model(gap.model)}{clamp[gap.clamp_corrected]}: at its finest it stays within "
            f"{_millimetres(gap.distance)} ({_percent(gap.error)}) of it."
        )
    scored = {gap.model for gap in study.disagreements}
    for model in dict.fromkeys(answer.model for answer in study.answers):
        reasons = [item.why for item in study.result.skipped if item.setting.model == model]
        if model not in scored:
            lines.append(f"{name_model(model)}: no run was scored ({reasons[-1]}).")
    if study.stretch is not None:
        lines.append(
            f"A hose that does not stretch differs by {_percent(study.stretch)}: MuJoCo's chains "
            "cannot come closer."
        )
    lines += [f"{name_model(model)} did not run: {why}." for model, why in study.refused.items()]
    return lines


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2g} %"


def _millimetres(distance: float) -> str:
    return f"{1e3 * distance:.2g} mm" if distance < 1.0 else f"{distance:.2g} m"
