"""Reading a snapshot that a user hands back: what is missing or odd is an `InputError`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from hose_mj.errors import HoseError, InputError
from hose_mj.hoses.protocol import Array


def take(state: Any, key: str) -> Any:
    """Returns one entry; raises `InputError` for what is no dictionary or does not have it."""
    if not isinstance(state, dict):
        raise InputError("part of a snapshot", type(state).__name__, f"a dictionary with {key!r}")
    if key not in state:
        raise InputError("keys of a snapshot", sorted(map(str, state)), f"{key!r} among them")
    return state[key]


def take_array(
    state: Any, key: str, shape: tuple[int | None, ...], *, is_finite: bool = True
) -> Array:
    """Returns a copy of (finite) numbers of that shape, None for any length; else `InputError`."""
    value = take(state, key)
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        valid = f"numbers, shape {shape}"
        raise InputError(f"{key} of a snapshot", type(value).__name__, valid) from None
    fits = array.ndim == len(shape) and all(
        wanted in (None, found) for wanted, found in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise InputError(f"shape of {key} of a snapshot", array.shape, f"{shape}, as in this hose")
    if is_finite and not np.all(np.isfinite(array)):
        raise InputError(f"{key} of a snapshot", "not finite", "finite numbers")
    return array


def take_count(state: Any, key: str) -> int:
    """Returns a whole number at or above 0; raises `InputError` for anything else."""
    value = take(state, key)
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise InputError(f"{key} of a snapshot", value, "a whole number at or above 0")
    if not 0 <= value < 2**62:
        raise InputError(f"{key} of a snapshot", value, "a whole number at or above 0")
    return int(value)


def take_flag(state: Any, key: str) -> bool:
    """Returns True or False; raises `InputError` for anything else."""
    value = take(state, key)
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{key} of a snapshot", type(value).__name__, "True or False")
    return bool(value)


def take_list(state: Any, key: str) -> list[Any]:
    """Returns a list or tuple as a list; raises `InputError` for anything else."""
    value = take(state, key)
    if not isinstance(value, (list, tuple)):
        raise InputError(f"{key} of a snapshot", type(value).__name__, "a list")
    return list(value)


@contextmanager
def undo(restore: Callable[[], None]) -> Iterator[None]:
    """Calls `restore` where what is inside fails; what fails of an odd snapshot is `InputError`."""
    try:
        yield
    except HoseError:
        restore()
        raise
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        restore()
        what = f"{type(error).__name__}: {error}"
        raise InputError("state", what, "what `snapshot` has returned") from error
