"""Opens a recording in the viewer at the moment that matters, or takes a picture of it."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from hose_mj.recording.document import make_document, print_document


@dataclass(frozen=True)
class Args:
    """Open a recording (.rrd), or a run's folder, at the moment of the break."""

    file: Annotated[Path, tyro.conf.Positional]
    """The recording. Of a folder: its first break, else the best, else the last episode."""
    screenshot: Path | None = None
    """Write a picture (PNG) instead of opening a window; needs no display."""
    at: float | None = None
    """Simulated time to show (s); by default that of the break, else the last sample."""
    json: bool = False  # Print one JSON document about the recording.


def run(args: Args) -> int:
    """Shows the recording and says what it holds."""
    from hose_mj.recording.keep import find_recording
    from hose_mj.recording.rerun import open_recording, read_outcomes, take_screenshot

    recording = find_recording(args.file)
    outcomes = read_outcomes(recording)
    broke_at = [one["break_time"] for one in outcomes.values() if "break_time" in one]
    at_s = args.at
    if at_s is None and broke_at:
        at_s = min(broke_at) + 1e-6  # just after, whatever the clock is rounded to
    for name, outcome in outcomes.items():
        text = outcome.get("break_text", f"ended by {outcome['ended_by']}")
        print(f"{recording.name}, {name}: {text}", file=sys.stderr)
    if args.screenshot is not None:
        take_screenshot(recording, args.screenshot, at_s=at_s)
        print(f"wrote {args.screenshot}", file=sys.stderr)
    else:
        open_recording(recording, at_s)
    if args.json:
        facts = ("ended_by", "break_kind", "break_time")
        episodes = [
            {"model": name, **{fact: outcome.get(fact) for fact in facts}}
            for name, outcome in outcomes.items()
        ]
        results = {"recording": recording, "at": at_s, "episodes": episodes}
        print_document(make_document("view", args, results=results))
    return 0
