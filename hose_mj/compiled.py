"""How kernels are compiled: once per machine, kept on disk, with arithmetic that still sees a NaN.

`nnan` and `ninf` are left out of the fast-math flags on purpose: with them a banded Cholesky
factorization accepts a pivot that is not a number.

A kernel that serves hoses in a plane and in space takes `axes`, a tuple of two or three zeros: its
length is part of its type, so one source compiles into one specialised version for each.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.extending import register_jitable

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "fastmath": {"contract", "reassoc", "arcp", "nsz"},
    "error_model": "numpy",
}
compiled = numba.njit(**_OPTIONS)
# _nrt=False (no allocation inside) is left out of numba's types.
kernel = numba.njit(**_OPTIONS, _nrt=False)  # type: ignore[call-overload]
# For small functions of a record with many fields, which a call would have to copy one by one.
inlined = numba.njit(**_OPTIONS, _nrt=False, forceinline=True)  # type: ignore[call-overload]
# Compiled into compiled callers; for others it stays plain Python, whatever its arguments are.
jitable: Any = register_jitable(forceinline=True, error_model="numpy")


@contextmanager
def compile_notice(what: str) -> Iterator[None]:
    """Says on stderr that kernels are being compiled when the block takes over a second."""
    notice = f"hose_mj: compiling the {what} (once on this machine, under 30 s) ...\n"
    timer = threading.Timer(1.0, lambda: sys.stderr.write(notice))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
