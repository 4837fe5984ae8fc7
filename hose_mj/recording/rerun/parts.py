"""Pieces that all recordings share: stream, timeline, plain entities, texts, round spacings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hose_mj.recording.episode import Array
from hose_mj.recording.palette import Rgb

APPLICATION_ID = "hose_mj"
TIMELINE = "sim_time"
TURNS = "turn"
OUTCOME = "outcome"
"""Begins the names of the properties that say how episodes ended."""
FACTS = ("ended_by", "break_kind", "break_time", "break_text")
DARK = (17, 20, 24)
"""Ground colour of the spatial views."""
HALF_VIEW = float(np.tan(np.radians(27.5)))
"""The viewer's vertical field of view is 55 degrees."""
_QUANTITIES = {
    "m": "Distance",
    "mm": "Distance",
    "m/s": "Speed",
    "N": "Force",
    "N m": "Moment",
    "J": "Energy",
    "rad": "Angle",
}


def open_stream(
    blueprint: rrb.BlueprintLike, recording_id: str | None = None
) -> tuple[rr.RecordingStream, Callable[[], bytes]]:
    """Opens a recording in memory; returns its stream and what gives the bytes of the whole .rrd.

    Not `stream.save`: on a full disk that waits for its dead writer forever.
    """
    stream = rr.RecordingStream(APPLICATION_ID, recording_id=recording_id)
    sink = rr.binary_stream(stream)
    stream.send_blueprint(blueprint, make_active=False, make_default=True)
    return stream, lambda: bytes(sink.read(flush=True) or b"")


def make_time(times: Array) -> rr.TimeColumn:
    """Returns simulated times (k,), s, as the index of rows."""
    return rr.TimeColumn(TIMELINE, duration=times)


def log_document(stream: rr.RecordingStream, path: str, text: str) -> None:
    """Logs a Markdown text once."""
    stream.log(path, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


def log_scalars(
    stream: rr.RecordingStream,
    path: str,
    times: Array,
    values: Array,
    name: str,
    color: Rgb,
    width: float,
) -> None:
    """Logs numbers over time, (k,) each, and how their line looks."""
    style = rr.SeriesLines(colors=[color], widths=[width], names=[name])
    stream.log(path, style, static=True)
    stream.send_columns(path, [make_time(times)], rr.Scalars.columns(scalars=values))


def name_quantity(unit: str) -> str:
    """Returns the title of a plot of numbers in a unit: "Distance (mm)"."""
    name = _QUANTITIES.get(unit, "Numbers")
    return f"{name} ({unit})" if unit else name


def format_table(settings: dict[str, str]) -> str:
    """Returns the settings as a Markdown table."""
    rows = [f"| {escape_cell(name)} | {escape_cell(value)} |" for name, value in settings.items()]
    return "\n".join(["| setting | value |", "|---|---|", *rows])


def round_spacing(length: float) -> float:
    """Returns the largest of 1, 2, 5 times a power of ten that is not above a length."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(step for step in (1, 2, 5) if step <= length / power * (1 + 1e-9)))


def escape_cell(text: object) -> str:
    """Returns a text on one line, as it may stand in a Markdown table."""
    return " ".join(str(text).split()).replace("|", "\\|")
