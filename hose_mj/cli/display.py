"""Whether there is a display to open a window on."""

from __future__ import annotations

import os
import sys

from hose_mj.errors import InputError


def check_display(what: str) -> None:
    """Raises `InputError` where a window cannot be opened.

    Args:
        what: needs the window.
    """
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        valid = "a display (DISPLAY or WAYLAND_DISPLAY); without one, hose-mj rollout --save F.rrd"
        raise InputError(f"display for {what}", None, valid)
