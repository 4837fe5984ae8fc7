"""The names that modules had before version 0.2, for one release.

Importing one gives the module that took its place and a DeprecationWarning that says which.
"""

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

MOVED = {
    "hose_mj.envs.dm_world": "hose_mj.rollout.dm_world",
    "hose_mj.hoses.cable": "hose_mj.hoses.mujoco.cable",
    "hose_mj.hoses.flex": "hose_mj.hoses.mujoco.flex",
    "hose_mj.hoses.geds.hose_contact": "hose_mj.hoses.geds.hose_pair",
    "hose_mj.hoses.geds.model": "hose_mj.hoses.geds.hose",
    "hose_mj.hoses.model": "hose_mj.hoses.protocol",
    "learning": "hose_learning",
    "learning.components": "hose_learning",
    "learning.components.experience": "hose_learning.experience",
    "learning.components.masks": "hose_learning.action_masks",
    "learning.components.partial_models": "hose_learning.mdp.partially_constrained",
    "learning.components.relevance": "hose_learning.relevance",
    "learning.components.transfer": "hose_learning.transfer",
    "learning.components.usap": "hose_learning.learners.usap",
    "learning.learners": "hose_learning.learners",
    "learning.learners.catalog": "hose_learning.learners.catalog",
    "learning.settings": "hose_learning.settings",
    "learning.study": "hose_learning.study",
    "learning.study.measures": "hose_learning.study.jobs",
    "learning.study.training": "hose_learning.study.training",
}


class MovedFinder(MetaPathFinder):
    """Finds a module by its old name, unless the user has one of that name.

    It comes before Python's own finders: these would look into the folder of the package that took
    an old one's place, and load what they find there a second time, under the old name.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Returns a spec for an old name; None for others, and for what the user has."""
        new = _find_new_name(fullname)
        if new is None or _is_users(fullname):
            return None
        return ModuleSpec(fullname, _MovedLoader(new))


def _find_new_name(name: str) -> str | None:
    """Returns what a module is called now; None for one that is not ours or still called so."""
    if name in MOVED:
        top = sys.modules.get("learning") if name.startswith("learning.") else None
        own = top is not None and top.__name__ == "learning" and top.__file__
        return None if own else MOVED[name]
    parent, _, last = name.rpartition(".")
    if parent not in MOVED or parent not in sys.modules:
        return None
    now = sys.modules[parent].__name__
    return None if now == parent else f"{now}.{last}"


def _is_users(name: str) -> bool:
    """Says whether a module is the user's: not in a package of ours that has another name now.

    Nor in a folder without code, such as the caches that an update of a checkout leaves behind.
    """
    parent = name.rpartition(".")[0]
    module = sys.modules.get(parent)
    if parent and (module is None or module.__name__ != parent or parent.startswith("hose_mj")):
        return False
    spec = PathFinder.find_spec(name, getattr(module, "__path__", None))
    if spec is None or spec.origin is not None:
        return spec is not None
    places = map(Path, spec.submodule_search_locations or ())
    return any(True for place in places for _ in place.rglob("*.py"))


class _MovedLoader(Loader):
    """Loads the module that took another's place."""

    def __init__(self, new: str) -> None:
        self._new = new

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        if "." in spec.name:  # once for an import, not for each package on the way
            text = f"{spec.name} is {self._new} now"
            warnings.warn(text, DeprecationWarning, stacklevel=2)
        module = importlib.import_module(self._new)
        self._own = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._own  # which the import has replaced
