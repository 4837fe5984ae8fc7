"""`hose-mj compare my_hose.toml`: reads the hose, runs the study, prints its answers."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from hose_mj.assets import find_assets
from hose_mj.cli.compare import MODELS
from hose_mj.errors import InputError
from hose_mj.recording.palette import name_model
from hose_mj.recording.plots.api import format_seconds
from hose_mj.scenes.hose_file.hose_file import OwnHose, read_own_hose
from hose_mj.validation.compare import compute_ratios
from hose_mj.validation.study import Study
from hose_mj.validation.user_hose.answers import Answer
from hose_mj.validation.user_hose.study import OwnStudy, list_own_models, run_own_study

QUICK_SHARE = 1.0 / 3.0
"""Of its budget that a hose gets with --quick."""


def read_own(path: Path, *, quick: bool) -> OwnHose:
    """Reads a user's hose: a file, or the name of an example that comes with hose_mj.

    Raises:
        InputError: no such file or example, or something wrong in it.
    """
    examples = find_assets() / "hoses"
    if not path.exists() and (examples / f"{path}.toml").is_file():
        path = examples / f"{path}.toml"
    elif not path.exists():
        names = ", ".join(sorted(example.stem for example in examples.glob("*.toml")))
        raise InputError("my_hose", str(path), f"a TOML file, or an example: {names}")
    own = read_own_hose(path)
    return replace(own, budget=own.budget * QUICK_SHARE) if quick else own


def choose_own_models(models: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the models to run; by default all that a user's hose can be compared with.

    Raises:
        InputError: another model, or none.
    """
    known = list_own_models()
    if models == MODELS:
        return known
    for model in models:
        if model not in known:
            raise InputError("model", model, f"for a hose of your own {', '.join(known)}")
    if not models:
        raise InputError("models", models, f"one or more of {', '.join(known)}")
    return tuple(dict.fromkeys(models))


def study_own_hose(own: OwnHose, models: tuple[str, ...], advance: Callable[[str], None]) -> Study:
    """Runs the comparison of a user's hose, as a study of one case."""
    found = run_own_study(own, models, advance)
    ratios = compute_ratios(found.result, own.errors) if own.duration is not None else []
    return Study(results=[found.result], checks=found.checks, ratios=ratios, own=found)


def print_own(study: OwnStudy) -> None:
    """Prints what was found, on stdout."""
    console = Console(highlight=False)
    console.print(f"[bold]{study.own.title}[/]\n{study.result.case.about}\n")
    for line in describe_findings(study):
        console.print(f"- {line}")
    table = Table(title="The cheapest setting within a wanted error (of the length)")
    header = ("wanted", "model", "resolution", "step", "error", "wall s / sim s")
    for name in header:
        table.add_column(name, justify="left" if name == "model" else "right")
    for answer in study.answers:
        table.add_row(*make_answer_row(answer, study.cut_short))
    console.print()
    console.print(table)


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


def describe_findings(study: OwnStudy) -> list[str]:
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
