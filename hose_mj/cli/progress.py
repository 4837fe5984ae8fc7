"""Long work in a terminal: a progress bar, and a Ctrl-C that waits for a good moment."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def show_progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Shows how much of some work is done on stderr where that is a terminal, else nothing.

    Args:
        what: named beside the bar.
        total: amount of work.

    Yields:
        A function to call with the amount just done.
    """
    if not sys.stderr.isatty():
        yield lambda amount: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        job = progress.add_task(what, total=total)
        yield lambda amount: progress.advance(job, amount)


@contextmanager
def defer_interrupt() -> Iterator[Callable[[], bool]]:
    """Keeps a first Ctrl-C from stopping the block half way; a second one stops it at once.

    Yields:
        A function that tells whether there was one.
    """
    interrupts: list[int] = []
    if threading.current_thread() is not threading.main_thread():  # no signals anywhere else
        yield lambda: False
        return
    previous = signal.getsignal(signal.SIGINT)

    def note(number: int, frame: object) -> None:
        interrupts.append(number)
        signal.signal(signal.SIGINT, previous)

    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: bool(interrupts)
    finally:
        signal.signal(signal.SIGINT, previous)
