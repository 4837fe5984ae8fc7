"""How kernels are compiled: once per machine, kept on disk, with arithmetic that still sees a NaN.

`nnan` and `ninf` are left out of the fast-math flags on purpose: with them a banded Cholesky
factorization accepts a pivot that is not a number.

A kernel that serves hoses in a plane and in space takes `axes`, a tuple of two or three zeros: its
length is part of its type, so one source compiles into one specialised version for each.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba import types
from numba.core.caching import IndexDataCacheFile
from numba.extending import overload, register_jitable

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "fastmath": {"contract", "reassoc", "arcp", "nsz"},
    "error_model": "numpy",
}
_INLINED: Any = {"error_model": "numpy", "forceinline": True}
_PACKAGE = Path(__file__).resolve().parent


@cache
def _read_fingerprint(package: Path) -> str:
    """A hash of all sources of a package that have kernels in them, and of what these import.

    Records and constants are often defined in files without kernels.
    """
    files = package.rglob("*.py") if package.is_dir() else [package]
    sources = {file: file.read_bytes() for file in files}
    chosen = {file for file, text in sources.items() if b"hose_mj.jit import" in text}
    imported = (re.findall(rb"^from ([\w.]+) import", sources[file], re.M) for file in chosen)
    for module in {module.decode() for modules in imported for module in modules}:
        chosen.add(package.parent.joinpath(*module.split(".")).with_suffix(".py"))
    texts = [sources[file] for file in sorted(chosen & sources.keys())]
    return hashlib.sha256(b"".join(texts)).hexdigest()[:12]


def _find_fingerprint(function: Callable[..., Any]) -> str:
    """What a function's machine code may depend on: all kernels of hose_mj and of its own package.

    Kernels are inlined across files, and chosen by the types of records, so that no list of
    imports says which. Rules of other packages inline those of hose_learning.
    """
    top = function.__module__.partition(".")[0]
    places = [_PACKAGE]
    for name in ("hose_learning", top) if top != "hose_mj" else ():
        places += _find_places(name)
    return "-".join(_read_fingerprint(place.resolve()) for place in dict.fromkeys(places))


@cache
def _find_places(package: str) -> tuple[Path, ...]:
    """The folders of a package, or the file of a module; none for what runs as a program."""
    try:
        spec = None if package == "__main__" else importlib.util.find_spec(package)
    except ValueError:  # a module without a spec
        spec = None
    if spec is None:
        return ()
    return tuple(map(Path, spec.submodule_search_locations or filter(None, [spec.origin])))


def _find_record_packages(kind: Any) -> set[str]:
    """The packages of the records in a type, at any depth."""
    if isinstance(kind, types.BaseTuple):
        record = getattr(kind, "instance_class", None)
        inner = [_find_record_packages(part) for part in getattr(kind, "types", ())]
        return set().union(*inner) | ({record.__module__.partition(".")[0]} if record else set())
    return set()


class _CacheFiles:
    """The files of a function's versions: those for records of other packages stand apart.

    A loop of ours inlines the rules of a task or learner that another package registered, so the
    name of such a file has a fingerprint of that package. An index of its own, because whoever
    reads an index imports the packages of all records in it, and this one may be gone.
    """

    def __init__(self, place: str, name: str, stamp: Any) -> None:
        self._place, self._name, self._stamp = place, name, stamp

    def _open(self, signature: Any = ()) -> Any:
        kinds = getattr(signature, "args", signature)
        packages = set().union(*map(_find_record_packages, kinds)) - {"hose_mj", "hose_learning"}
        name = self._name
        for package in sorted(packages):
            marks = [_read_fingerprint(place.resolve()) for place in _find_places(package)]
            name += "." + "-".join([package, *marks])
        return IndexDataCacheFile(self._place, name, self._stamp)  # type: ignore[no-untyped-call]

    def load(self, key: tuple[Any, ...]) -> Any:
        """Returns the compiled version for a key, which begins with the signature, or None."""
        return self._open(key[0]).load(key)

    def save(self, key: tuple[Any, ...], data: Any) -> None:
        """Keeps a compiled version."""
        self._open(key[0]).save(key, data)

    def flush(self) -> None:
        """Empties the index of our own records."""
        self._open().flush()


def _decorate(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """njit with these options and a disk cache that notices a change in any kernel it inlines.

    numba looks at a function's own file only: after an update it would go on with the old code of
    what is inlined from other files. So the name of the cache file holds a fingerprint.
    """

    def decorator(function: Callable[..., Any]) -> Any:
        made = numba.njit(**{**_OPTIONS, **options})(function)
        # None where numba finds no place for a cache, or where NUMBA_DISABLE_JIT is set.
        own = getattr(getattr(made, "_cache", None), "_impl", None)
        if own is not None:
            name = f"{own.filename_base}.{_find_fingerprint(function)}"
            stamp = own.locator.get_source_stamp()
            place = made._cache._cache_path
            made._cache._cache_file = _CacheFiles(place, name, stamp)
        return made

    return decorator


compiled = _decorate()
# For loops that must give, bit for bit, what their source gives as plain Python: no contractions.
bitwise = _decorate(fastmath=False, _nrt=False)
# _nrt=False (no allocation inside) is left out of numba's types.
kernel = _decorate(_nrt=False)
# Over all cores, with the arithmetic of its source; what it calls has its own options.
parallel = _decorate(fastmath=False, parallel=True)
# For small functions of a record with many fields, which a call would have to copy one by one.
inlined = _decorate(_nrt=False, forceinline=True)
# Put into its callers before they are compiled: no code of its own, which each caller of a long
# function would optimize once more.
merged = _decorate(inline="always")
# Compiled into compiled callers; for others it stays plain Python, whatever its arguments are.
jitable: Callable[[Callable[..., Any]], Any] = register_jitable(
    forceinline=True, error_model="numpy"
)


def choose_by_unknowns(choices: Mapping[int, Any]) -> Any:
    """Returns a function of (axes, ...) that is `choices[len(axes)]`, or does nothing without one.

    Chosen before compilation, for compiled callers only: after an `if` numba would also compile
    what can never run.

    Args:
        choices: compiled functions that return nothing, by the number of unknowns of a control
            point; all take the same arguments, axes first.
    """

    def chosen(axes: tuple[float, ...], *arguments: Any) -> None:
        raise NotImplementedError

    @overload(chosen, strict=False, jit_options=_INLINED)
    def choose(axes: Any, *arguments: Any) -> Any:
        choice = choices.get(len(axes))
        if choice is None:
            return lambda axes, *arguments: None

        def call(axes: Any, *arguments: Any) -> None:
            choice(axes, *arguments)

        return call

    return chosen


@contextmanager
def compile_notice(what: str) -> Iterator[None]:
    """Says on stderr that kernels are being compiled when the block takes over a second."""
    notice = f"hose_mj: compiling the {what} (once on this machine, under a minute) ...\n"
    timer = threading.Timer(1.0, lambda: sys.stderr.write(notice))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


_called: set[tuple[Callable[..., Any], int]] = set()


def run_kernel(kernel: Callable[..., Any], axes: tuple[float, ...], *arguments: Any) -> Any:
    """Calls a kernel; a first call that takes over a second says on stderr that it compiles."""
    version = (kernel, len(axes))
    if version in _called:
        return kernel(axes, *arguments)
    with compile_notice("GEDS kernels"):
        result = kernel(axes, *arguments)
    _called.add(version)
    return result
