"""The rules on imports: every arrow runs down, and importing the package costs next to nothing."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent

# What each part stands on; the longest prefix of a module's name decides its part.
_BASE = {
    *("hose_mj.errors", "hose_mj.checks", "hose_mj.jit", "hose_mj.assets", "hose_mj.extras"),
}
_SCENES = _BASE | {"hose_mj.hoses.spec"}
_HOSES = _BASE | {"hose_mj.hoses.spec"}
_WORLD = _SCENES | {"hose_mj.hoses", "hose_mj.scenes"}
_CONSTRAINTS = _WORLD | {"hose_mj.world"}
FLOORS = {
    "hose_mj": {"hose_mj.errors", "hose_mj.hoses.registry", "hose_mj.hoses.spec"},
    "hose_mj.__main__": {"hose_mj.cli"},
    "hose_mj.errors": set(),
    "hose_mj.assets": {"hose_mj.errors"},
    "hose_mj.checks": {"hose_mj.errors"},
    "hose_mj.extras": {"hose_mj.errors"},
    "hose_mj.jit": set(),
    "hose_mj.recording": {"hose_mj", "hose_mj.errors", "hose_mj.checks", "hose_mj.extras"},
    "hose_mj.hoses.spec": {"hose_mj.errors"},
    "hose_mj.hoses": _HOSES,
    "hose_mj.scenes": _SCENES,
    "hose_mj.validation": _WORLD | {"hose_mj.recording"},
    "hose_mj.world": _WORLD,
    "hose_mj.constraints": _CONSTRAINTS,
    "hose_mj.rollout": _CONSTRAINTS | {"hose_mj.constraints", "hose_mj.recording"},
    "hose_mj.tasks": {"hose_mj.errors", "hose_mj.jit"},
    "hose_mj.envs": {
        *("hose_mj.errors", "hose_mj.extras", "hose_mj.jit", "hose_mj.tasks"),
        "hose_mj.recording",
    },
    "hose_learning": {
        *("hose_mj", "hose_mj.errors", "hose_mj.checks", "hose_mj.jit", "hose_mj.envs"),
        *("hose_mj.tasks", "hose_mj.recording", "hose_mj.extras"),
    },
    "hose_mj.cli": {"hose_mj", "hose_learning"},
}
PACKAGES = ("hose_mj", "hose_learning")
ROOTS = {"hose_mj": ROOT, "hose_learning": ROOT / "learning", "tools": ROOT}
HEAVY = {"gymnasium", "matplotlib", "mujoco", "numba", "pyarrow", "rerun", "scipy", "sklearn"}
JIT = {"compiled", "inlined", "jit", "jitable", "kernel", "njit", "vectorize", "guvectorize"}


class Import(NamedTuple):
    """`from module import name`, or `import module` with no name."""

    module: str
    name: str | None

    @property
    def target(self) -> str:
        """The module imported: `from a import b` is a.b where that is a module."""
        full = f"{self.module}.{self.name}"
        return full if self.name and find_file(full) else self.module


def find_file(module: str) -> Path | None:
    parts = module.split(".")
    base = ROOTS.get(parts[0], ROOT).joinpath(*parts)
    for file in (base.with_suffix(".py"), base / "__init__.py"):
        if file.is_file():
            return file
    return None


def find_modules(*packages: str) -> dict[str, ast.Module]:
    found = {}
    for package in packages:
        for file in sorted((ROOTS[package] / package).rglob("*.py")):
            parts = file.relative_to(ROOTS[package]).with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = ast.parse(file.read_text(encoding="utf-8"), str(file))
    return found


def find_imports(module: str, tree: ast.Module) -> Iterator[Import]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            source = node.module or ""
            if node.level:
                is_package = getattr(find_file(module), "name", None) == "__init__.py"
                parts = module.split(".")[: None if is_package else -1]
                parts = parts[: len(parts) - (node.level - 1)]
                source = ".".join([*parts, *filter(None, [source])])
            yield from (Import(source, alias.name) for alias in node.names)


def is_within(module: str, packages) -> bool:
    return any(module == package or module.startswith(f"{package}.") for package in packages)


def find_floor(module: str) -> str:
    """The part a module belongs to; the top level of hose_mj is a part of its own."""
    inside = [part for part in FLOORS if part != "hose_mj" and is_within(module, [part])]
    assert inside or module == "hose_mj", f"{module} is on no floor: add it to FLOORS"
    return max(inside, key=len, default="hose_mj")


def find_breach(module: str, imported: Import) -> str | None:
    """What an import breaks, in words, or None."""
    target = imported.target
    if is_within(target, ["rerun", "rerun_bindings"]):
        allowed = is_within(module, ["hose_mj.recording.rerun"])
        return None if allowed else "only hose_mj.recording.rerun imports rerun"
    if is_within(target, ["tools", "tests"]):
        return "what is shipped imports nothing that is not"
    floor = find_floor(module)
    if is_within(target, PACKAGES) and find_floor(target) != floor:
        below = FLOORS[floor]
        if floor == "hose_mj.cli" or find_floor(target) in below or target in below:
            return None
        return f"{floor} stands on {sorted(below)} alone"
    return None


def find_circle(arrows: dict[str, set[str]]) -> list[str] | None:
    """A way along the arrows that comes back to where it began, or None."""
    done: set[str] = set()

    def walk(module: str, way: list[str]) -> list[str] | None:
        if module in way:
            return [*way[way.index(module) :], module]
        if module in done:
            return None
        for target in sorted(arrows.get(module, ())):
            if circle := walk(target, [*way, module]):
                return circle
        done.add(module)
        return None

    return next(filter(None, (walk(module, []) for module in sorted(arrows))), None)


def is_kernel_file(module: str, tree: ast.Module) -> bool:
    decorators = (
        decorator.func if isinstance(decorator, ast.Call) else decorator
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        for decorator in node.decorator_list
    )
    names = (d.attr if isinstance(d, ast.Attribute) else getattr(d, "id", "") for d in decorators)
    return module.endswith("_kernels") or any(name in JIT for name in names)


def is_class_of_ours(imported: Import) -> bool:
    """Whether a name is a class of ours; a NamedTuple of arrays is data that numba understands."""
    file = find_file(imported.module)
    if not is_within(imported.module, PACKAGES) or file is None:
        return False
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ClassDef) and node.name == imported.name:
            return not any(getattr(base, "id", "") == "NamedTuple" for base in node.bases)
    return False


MODULES = find_modules(*PACKAGES)


@pytest.mark.parametrize("module", MODULES)
def test_arrows_run_down(module):
    breaches = [
        f"{imported}: {breach}"
        for imported in find_imports(module, MODULES[module])
        if (breach := find_breach(module, imported))
    ]
    assert not breaches


def test_there_is_no_circle():
    """Under TYPE_CHECKING either: a type that two files share has a file of its own."""
    arrows = {
        module: {i.target for i in find_imports(module, tree) if is_within(i.target, PACKAGES)}
        for module, tree in MODULES.items()
    }
    assert find_circle(arrows) is None


def test_circles_are_found():
    assert find_circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert find_circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) is None


# A learner's file holds its update rule and, for its reader, what makes it from settings.
KERNEL_FILES = [
    module
    for module, tree in MODULES.items()
    if is_kernel_file(module, tree) and not is_within(module, ["hose_learning.learners"])
]


@pytest.mark.parametrize("module", KERNEL_FILES)
def test_kernels_import_no_class_of_ours(module):
    assert not [i for i in find_imports(module, MODULES[module]) if is_class_of_ours(i)]


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("hose_mj.errors", "import tools.scene_pictures"),
        ("hose_mj.envs.gym", "from hose_learning import tables"),
        ("hose_mj.envs.gym", "from hose_mj.world.world import World"),
        ("hose_mj.tasks.registry", "from hose_mj.hoses.spec import HoseSpec"),
        ("hose_mj.hoses.geds", "from hose_mj.world import world"),
        ("hose_mj.hoses.spec", "from hose_mj.hoses.protocol import HoseModel"),
        ("hose_mj.hoses.mujoco.cable", "from hose_mj import HoseSpec"),
        ("hose_mj.hoses.mujoco.cable", "from hose_mj.scenes.mjcf.scene import read_scene"),
        ("hose_mj.recording.episode", "from hose_mj.hoses import spec"),
        ("hose_mj.errors", "from .hoses import spec"),
        ("hose_mj.recording.episode", "import rerun as rr"),
        ("hose_mj.cli.view", "from rerun.chunk import RrdReader"),
        ("hose_mj.rollout.episode", "from hose_mj.cli import progress"),
        ("hose_learning.loop", "from hose_mj.cli import main"),
        ("hose_learning.loop", "from hose_mj.hoses import spec"),
        ("hose_learning.loop", "from hose_mj.world.world import World"),
    ],
)
def test_the_rules_catch(module, line):
    assert any(find_breach(module, i) for i in find_imports(module, ast.parse(line)))


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("hose_mj.recording.rerun.episodes", "import rerun as rr"),
        ("hose_mj.recording.rerun.episodes", "from hose_mj.recording.episode import Scene"),
        ("hose_mj.world.world", "from hose_mj.hoses.protocol import HoseModel"),
        ("hose_mj.envs.gym", "from hose_mj.tasks.task import Task"),
        ("hose_learning.loop", "from hose_mj import InputError"),
        ("hose_learning.loop", "from hose_mj.envs.turns import make"),
        ("hose_mj.cli.view", "from hose_mj.recording import rerun"),
        ("hose_mj.cli.train", "from hose_learning.study.training import Training"),
    ],
)
def test_the_rules_allow(module, line):
    assert not any(find_breach(module, i) for i in find_imports(module, ast.parse(line)))


def test_the_kernel_rule_tells_kernels_and_classes():
    assert is_kernel_file("a", ast.parse("@numba.njit(cache=True)\ndef f(): ..."))
    assert is_kernel_file("a", ast.parse("@njit\ndef f(): ..."))
    assert is_kernel_file("a.b_kernels", ast.parse(""))
    assert not is_kernel_file("a", ast.parse("@property\ndef f(): ..."))
    assert is_class_of_ours(Import("hose_mj.hoses.spec", "HoseSpec"))
    assert not is_class_of_ours(Import("hose_mj.hoses.spec", "check_number"))
    assert not is_class_of_ours(Import("numpy", "ndarray"))


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_nothing_heavy(package):
    code = f"import sys, {package}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert not HEAVY & set(done.stdout.split())


def test_exports_are_loaded_at_first_use():
    import hose_mj
    from hose_mj.hoses.spec import HoseSpec

    assert hose_mj.HoseSpec is HoseSpec
    assert set(hose_mj.__all__) <= set(dir(hose_mj))
    with pytest.raises(AttributeError, match="'no_such_name'"):
        _ = hose_mj.no_such_name
