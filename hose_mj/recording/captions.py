"""Texts beside the pictures of a recording, in Markdown."""

from __future__ import annotations

from hose_mj.recording.episode import Scene

_QUANTITIES = {
    "m": "Distance",
    "mm": "Distance",
    "m/s": "Speed",
    "N": "Force",
    "N m": "Moment",
    "J": "Energy",
    "rad": "Angle",
}


def name_quantity(unit: str) -> str:
    """Returns the title of a plot of numbers in a unit: "Distance (mm)"."""
    name = _QUANTITIES.get(unit, "Numbers")
    return f"{name} ({unit})" if unit else name


def format_settings(settings: dict[str, str]) -> str:
    """Returns the settings as a Markdown table under a heading."""
    return f"# Settings\n\n{format_table(settings)}"


def format_table(settings: dict[str, str]) -> str:
    """Returns the settings as a Markdown table."""
    rows = [f"| {_cell(name)} | {_cell(value)} |" for name, value in settings.items()]
    return "\n".join(["| setting | value |", "|---|---|", *rows])


def format_legend(scene: Scene) -> str:
    """Returns one Markdown line per track: name, number of points and samples, radius."""
    lines = [
        f"| {_cell(t.name)} | {len(t.arc_lengths)} | {len(t.times)} | {1e3 * t.radius:.3g} |"
        for t in scene.tracks
    ]
    head = ["| hose | points | samples | radius (mm) |", "|---|---|---|---|"]
    return "\n".join([*head, *lines])


def _cell(text: object) -> str:
    return " ".join(str(text).split()).replace("|", "\\|")
