"""Pieces that all recordings share: stream, layout, plain entities, texts, waiting."""

import socket
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hose_mj.errors import HoseError
from hose_mj.recording.episode import Array
from hose_mj.recording.palette import Rgb

APPLICATION_ID = "hose_mj"
TIMELINE = "sim_time"
TURNS = "turn"
OUTCOME = "outcome"  # begins the names of the properties that say how episodes ended
FACTS = ("ended_by", "break_kind", "break_time", "break_text")
DARK = (17, 20, 24)  # ground colour of the spatial views
HALF_VIEW = float(np.tan(np.radians(27.5)))  # the viewer's vertical field of view is 55 degrees
_QUANTITIES = {"m": "Distance", "mm": "Distance", "m/s": "Speed", "N": "Force", "N m": "Moment"}
_QUANTITIES |= {"J": "Energy", "rad": "Angle"}


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


def make_blueprint(view: rrb.Container, follow: bool = False) -> rrb.Blueprint:
    """Lays out a view, side panels folded; its time plays in a loop, or follows what comes."""
    return rrb.Blueprint(
        view,
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=TIMELINE,
            play_state="following" if follow else "playing",
            loop_mode="off" if follow else "all",
        ),
    )


def make_space_view(
    name: str, eye: tuple[Array, Array, Array], grid: tuple[float, Array, float], **more: Any
) -> rrb.Spatial3DView:
    """Returns a dark view in space, with a faint grid.

    Args:
        name: above it.
        eye: its place, the place it looks at, and what is up there, (3,) each.
        grid: spacing (m), normal (3,), and distance from the origin along it (m).
        more: origin, contents and the like.
    """
    position, target, up = eye
    return rrb.Spatial3DView(
        name=name,
        background=rrb.Background(color=DARK),
        line_grid=rrb.LineGrid3D(
            visible=True,
            spacing=grid[0],
            plane=rr.components.Plane3D(grid[1], grid[2]),
            color=(255, 255, 255, 12),
        ),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=up
        ),
        **more,
    )


def wait_until(is_done: Callable[[], object], deadline: float, why: str) -> None:
    """Returns once something is done; raises `HoseError` at the deadline (`time.monotonic`)."""
    while not is_done():
        if time.monotonic() > deadline:
            raise HoseError(why)
        time.sleep(0.1)


def is_listening(host: str, port: int) -> bool:
    """Says whether somebody listens at a port."""
    try:
        socket.create_connection((host, port), timeout=1.0).close()
    except OSError:
        return False
    return True


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
