import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from hose_mj import jit

LOWER = "from hose_mj.jit import kernel\n\n@kernel\ndef lower(x):\n    return x + {}\n"
UPPER = """from hose_mj.jit import kernel
from hose_mj.{}.lower import lower

@kernel
def upper(x):
    return 10.0 * lower(x)
"""


@pytest.mark.parametrize(("below", "above"), [("part", "part"), ("hoses", "validation")])
def test_a_change_in_an_inlined_kernel_of_another_file_is_noticed(tmp_path, below, above):
    # A copy of jit.py in a package of its own, so that its root is this folder.
    package = tmp_path / "hose_mj"
    for folder in (package, package / below, package / above):
        folder.mkdir(exist_ok=True)
        (folder / "__init__.py").touch()
    source = Path(jit.__file__).read_text(encoding="utf-8")
    (package / "jit.py").write_text(source, encoding="utf-8")
    (package / above / "upper.py").write_text(UPPER.format(below), encoding="utf-8")
    program = f"from hose_mj.{above}.upper import upper; print(upper(1.0), upper.stats.cache_hits)"
    said = []
    for number in (1, 1, 2, 1):
        (package / below / "lower.py").write_text(LOWER.format(number), encoding="utf-8")
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        said.append(done.stdout.split(" ", 1))
    assert [answer for answer, _ in said] == ["20.0", "20.0", "30.0", "20.0"]
    # Both versions stay on the disk, so going back costs nothing.
    assert [("float64" in hits) for _, hits in said] == [False, True, False, True]


def test_an_edit_of_any_kernel_file_renames_all_caches(tmp_path):
    """Those of references too, which inline band.py from another folder."""
    package = tmp_path / "hose_mj"
    leave = shutil.ignore_patterns("__pycache__", "*.xml", "*.toml")
    shutil.copytree(Path(jit.__file__).parent, package, ignore=leave)
    before = jit._read_fingerprint(package)
    with open(package / "hoses" / "geds" / "band.py", "a", encoding="utf-8") as file:
        file.write("\n# an edit\n")
    jit._read_fingerprint.cache_clear()
    assert jit._read_fingerprint(package) != before


@pytest.mark.parametrize("name", ["hose_mj.hoses.geds.band", "hose_mj.tasks.line.kernels"])
def test_every_cache_is_named_after_the_fingerprint(name):
    made = [value for value in vars(import_module(name)).values() if hasattr(value, "py_func")]
    assert made
    for kernel in made:
        mark = jit._find_fingerprint(kernel.py_func)
        assert mark in kernel._cache._cache_file._name


def test_an_option_that_numba_does_not_know_is_left_out():
    assert jit._keep_known(_no_such_option=False) == {}
    assert jit._keep_known(boundscheck=False) == {"boundscheck": False}


CALLERS = """
from hose_mj.jit import kernel

@kernel
def low(x):
    if x < 0.0:
        raise ValueError("below zero")
    return x + 1.0

@kernel
def high(x):
    return 2.0 * low(x)
"""
SECOND = """
import gc, sys
from hose_mj.jit import count_compiled, kernel
from callers import high, low

@kernel
def other(x):
    return 3.0 * low(x)

print(other(1.0), count_compiled())
print(high(1.0), low(1.0), count_compiled())
try:
    other(-1.0)
except ValueError as error:
    print(error)
print(gc.isenabled())
"""


def test_what_compiled_callers_link_serves_later_ones_and_python_has_its_own(tmp_path):
    (tmp_path / "callers.py").write_text(CALLERS)
    (tmp_path / "second.py").write_text(SECOND)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DEBUG_CACHE": "1"}
    said = []
    for program in ("from callers import high; high(1.0)", "import second"):
        command = [sys.executable, "-c", program]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        said.append(done.stdout)
    lines = said[1].splitlines()
    # `low` as `high` has linked it is read again, not compiled; for Python it is compiled now.
    loaded = [line for line in lines if "data loaded" in line]
    assert ["inner" in line for line in loaded] == [True, False]
    assert "callers.low" in loaded[0]
    assert "callers.high" in loaded[1]
    answers = [line for line in lines if not line.startswith("[cache]")]
    assert answers == ["6.0 1", "4.0 2.0 2", "below zero", "True"]


NOTICE = """
from hose_mj.jit import compile_notice, count_compiled, kernel

@kernel
def first(x):
    return x + 1.0

@kernel
def second(x):
    return first(x) * 2.0

with compile_notice("example"):
    second(1.0)
    first(1)
print(count_compiled())
"""


def test_one_notice_and_only_if_something_is_compiled(tmp_path):
    (tmp_path / "example.py").write_text(NOTICE)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    said = []
    for _ in range(2):
        command = [sys.executable, "-c", "import example"]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        said.append((int(done.stdout), done.stderr.splitlines()))
    assert said[0][0] == 2
    assert len(said[0][1]) == 1
    assert said[0][1][0].startswith("hose_mj: compiling the example, once on this machine")
    assert said[1] == (0, [])
