"""What all recordings have in common: the application's name, the timeline, plain entities."""

from __future__ import annotations

import rerun as rr

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
