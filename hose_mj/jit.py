"""How kernels are compiled: once per machine, kept on disk, with arithmetic that still sees a NaN.

`nnan` and `ninf` are left out of the fast-math flags on purpose: with them a banded Cholesky
factorization accepts a pivot that is not a number.

A kernel that serves hoses in a plane and in space takes `axes`, a tuple of two or three zeros: its
length is part of its type, so one source compiles into one specialised version for each.
"""

import gc
import hashlib
import importlib.util
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from llvmlite.binding import Linkage, parse_assembly  # type: ignore[import-untyped]
from numba import types
from numba.core import event
from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags
from numba.core.cpu import CPUTargetOptions
from numba.extending import overload, register_jitable

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "fastmath": {"contract", "reassoc", "arcp", "nsz"},
    "error_model": "numpy",
}
_PACKAGE = Path(__file__).resolve().parent
_ENVIRONMENT = "_ZN08NumbaEnv"
_DECLARE = '@"{}" = common global i64 0\n'
_MADE: set[Any] = set()  # what `_decorate` made, to tell ours from other people's


def _keep_known(**options: bool) -> dict[str, bool]:
    """The options that this version of numba knows; for one that is not public."""
    known = {}
    for name, value in options.items():
        try:
            CPUTargetOptions.parse_as_flags(Flags(), {name: value})  # type: ignore[no-untyped-call]
        except Exception:  # whatever a later version raises, kernels compile without it
            continue
        known[name] = value
    return known


# No allocation inside, which is left out of numba's types: less to compile.
_BARE = _keep_known(_nrt=False)
# To be called from C: nobody does that here.
_NO_C = _keep_known(no_cfunc_wrapper=True)
# The versions of numba under which code is linked as is (`_LinkedLibrary`, which overrides what is
# not public there); under others each kernel gets its wrappers too, in twice the time.
_LINKS = numba.version_info[:2] in {(0, 68)}
# Where records are small: linking a second version costs more than it saves.
_SMALL = ("hose_mj.tasks.", "hose_mj.envs.", "hose_learning.")
# To be called from Python: unpacking a hose's hundred arrays is more code than most kernels.
_NO_PYTHON = _keep_known(no_cpython_wrapper=True)
_OPTIONS |= _NO_C
_INLINED: Any = {"error_model": "numpy", "forceinline": True, **_NO_C}


@cache
def _read_fingerprint(package: Path) -> str:
    """A hash of all sources of a package that have kernels in them, and of what these import.

    Records and constants are often defined in files without kernels.
    """
    # The command line compiles nothing, it only gives notice.
    inside = (f for f in package.rglob("*.py") if "cli" not in f.relative_to(package).parts)
    files = list(inside) or [package]
    sources = {file: file.read_bytes() for file in files}
    chosen = {file for file, text in sources.items() if b"hose_mj.jit import" in text}
    lines = (re.findall(rb"^from ([\w.]+) import (.*)", sources[file], re.M) for file in chosen)
    for module, names in {(m.decode(), n.decode()) for found in lines for m, n in found}:
        place = package.parent.joinpath(*module.split("."))
        chosen |= {place / f"{name}.py" for name in re.findall(r"\w+", names)}
        chosen.add(place.with_suffix(".py"))
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


def _decorate(*, apart: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """njit with these options and a disk cache that notices a change in any kernel it inlines.

    numba looks at a function's own file only: after an update it would go on with the old code of
    what is inlined from other files. So the name of the cache file holds a fingerprint. With
    `apart`, compiled callers call the function, where others are put into them.
    """

    def decorator(function: Callable[..., Any]) -> Any:
        own = {"pipeline_class": _BareCompiler} if _LINKS and "_nrt" in options else {}
        made = numba.njit(**{**_OPTIONS, **options, **own})(function)
        _name_cache(made, "")
        _MADE.add(made)
        is_dear = not function.__module__.startswith(_SMALL)
        if is_dear and _LINKS and _NO_PYTHON and hasattr(made, "get_call_template"):
            _serve_callers(made, function, options, _ApartCompiler if apart else _LinkedCompiler)
        return made

    return decorator


def _name_cache(made: Any, suffix: str) -> None:
    # None where numba finds no place for a cache, or where NUMBA_DISABLE_JIT is set.
    own = getattr(getattr(made, "_cache", None), "_impl", None)
    if own is not None:
        name = f"{own.filename_base}{suffix}.{_find_fingerprint(made.py_func)}"
        stamp = own.locator.get_source_stamp()
        made._cache._cache_file = _CacheFiles(made._cache._cache_path, name, stamp)


class _BareLibrary(JITCodeLibrary):
    """Machine code of what allocates nothing: no references to prune before it is optimized."""

    def _optimize_final_module(self) -> None:
        codegen: Any = self._codegen
        manager, builder = codegen._module_pass_manager()
        manager.run(self._final_module, builder)


class _LinkedLibrary(JITCodeLibrary):
    """Code that others link into theirs, as is: no machine code is made of it."""

    is_apart = False

    def _optimize_final_module(self) -> None:
        """Leaves that to whoever links the code: it optimizes all of it together."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._verify_declare_only_symbols()  # type: ignore[no-untyped-call]
        self._shared_module, names = self._final_module, []
        for function in self._shared_module.functions:
            # May be defined in many modules, and dropped where nobody calls it.
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = "linkonce_odr"
                if self.is_apart and f"{len(self.name)}{self.name}" in function.name:
                    function.add_function_attribute("noinline")
        for variable in self._shared_module.global_variables:
            if variable.name.startswith(_ENVIRONMENT):
                names.append(variable.name)
        # What numba sets in memory for a function it has compiled, and nothing else.
        self._final_module = parse_assembly("".join(map(_DECLARE.format, names)))
        self._final_module.name = self.name
        super()._finalize_final_module()  # type: ignore[no-untyped-call]


class _ApartLibrary(_LinkedLibrary):
    """The same for code that its callers call."""

    is_apart = True


class _BareCompiler(Compiler):
    """Compiles a function as numba does, but into a library of ours."""

    library: Any = _BareLibrary

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compiles a function into a library of the class `library`."""
        self.state.library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)  # type: ignore[no-untyped-call]


class _LinkedCompiler(_BareCompiler):
    """For compiled callers."""

    library = _LinkedLibrary


class _ApartCompiler(_LinkedCompiler):
    """For compiled callers that are to call it."""

    library = _ApartLibrary


def _serve_callers(
    made: Any, function: Callable[..., Any], options: Mapping[str, Any], compiler: type[Compiler]
) -> None:
    """Gives compiled callers a version of a function that Python cannot call.

    The function itself is for Python: it is compiled only where Python calls it.
    """

    @cache
    def make_inner() -> Any:
        settings = {**_OPTIONS, **options, **_NO_PYTHON, "pipeline_class": compiler}
        inner = numba.njit(**settings)(function)
        _name_cache(inner, ".inner")
        return inner

    made.get_call_template = lambda arguments, names: make_inner().get_call_template(
        arguments, names
    )
    made.get_overload = lambda signature: make_inner().get_overload(signature)


compiled = _decorate()
# For loops that must give, bit for bit, what their source gives as plain Python: no contractions.
bitwise = _decorate(fastmath=False, **_BARE)
kernel = _decorate(**_BARE, forceinline=False)
# A long function with several callers: once in each entry's code, not once in each caller.
apart = _decorate(apart=True, **_BARE, forceinline=False)
# Over all cores, with the arithmetic of its source; what it calls has its own options.
parallel = _decorate(fastmath=False, parallel=True)
# For small functions of a record with many fields, which a call would have to copy one by one.
inlined = _decorate(**_BARE, forceinline=True)
# Put into its callers before they are compiled: no code of its own, which each caller of a long
# function would optimize once more.
merged = _decorate(inline="always")
# Compiled into compiled callers; for others it stays plain Python, whatever its arguments are.
jitable: Callable[[Callable[..., Any]], Any] = register_jitable(**_INLINED)


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


class _Notice(event.Listener):
    """Says on stderr that kernels are being compiled: once in a process, and only if any are.

    numba tells of a compilation, not of what it loads from the disk. A stage is a kernel that is
    called from Python, with all that goes into it; in a terminal the line counts them.
    """

    def __init__(self) -> None:
        self.about = "kernels"
        self.stages = self._depth = 0
        self._is_shown = False

    def on_start(self, told: Any) -> None:
        """Counts a stage where it begins."""
        self._depth += 1
        if self._depth > 1 or told.data.get("dispatcher") not in _MADE:
            return
        self.stages += 1
        live = sys.stderr.isatty()
        if self.stages == 1 or live:
            text = f"hose_mj: compiling the {self.about}, once on this machine"
            text += f": stage {self.stages} ..." if live else " (some take half a minute) ..."
            sys.stderr.write(f"\r{text}\x1b[K" if live else f"{text}\n")
            sys.stderr.flush()
            self._is_shown = live

    def on_end(self, told: Any) -> None:
        """Takes the line back where a terminal can."""
        self._depth -= 1
        if not self._depth and self._is_shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
            self._is_shown = False


class _GarbageLater(event.Listener):
    """Keeps Python's garbage collector out of compilations, a tenth of their time.

    Of numba's millions of objects nearly all are needed until the end, so it searches in vain.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._is_on = False

    def on_start(self, told: Any) -> None:
        """Stops the collector where the outermost compilation begins."""
        self._depth += 1
        if self._depth == 1:
            self._is_on = gc.isenabled()
            gc.disable()

    def on_end(self, told: Any) -> None:
        """Lets it go on as before."""
        self._depth -= 1
        if not self._depth and self._is_on:
            gc.enable()


_NOTICE = _Notice()
for _listener in (_NOTICE, _GarbageLater()):
    event.register("numba:compile", _listener)  # type: ignore[no-untyped-call]


def count_compiled() -> int:
    """Returns how many kernels this process has compiled that were called from Python."""
    return _NOTICE.stages


@contextmanager
def compile_notice(about: str) -> Iterator[None]:
    """Names what the block compiles, if it does, for the notice on stderr."""
    before, _NOTICE.about = _NOTICE.about, about
    try:
        yield
    finally:
        _NOTICE.about = before
