"""The names that modules had before version 0.2, for one release.

Importing one gives the module that took its place and a DeprecationWarning that says which.
"""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
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
    """Finds a module by its old name where nothing else is found under it."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Returns a spec for an old name; None for others, and inside a user's own `learning`."""
        if fullname not in MOVED:
            return None
        top = sys.modules.get("learning")
        if fullname.startswith("learning.") and top and top.__name__ == "learning" and top.__file__:
            return None
        return ModuleSpec(fullname, _MovedLoader())


class _MovedLoader(Loader):
    """Loads the module that took another's place."""

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        new = MOVED[spec.name]
        if "." in spec.name:  # once for an import, not for each package on the way
            warnings.warn(f"{spec.name} is {new} now", DeprecationWarning, stacklevel=2)
        module = importlib.import_module(new)
        self._own = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._own  # which the import has replaced
