"""Hoses carried by robots: spline, cable and flex models, scenes, tasks, environments, recordings.

Importing the package costs next to nothing; what it exports is loaded at first use:

    import hose_mj

    spec = hose_mj.HoseSpec.from_material(length=2.0, youngs_modulus=1e7, ...)
    hose = hose_mj.make_hose("geds", spec)
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hose_mj.errors import HoseError, InputError, StepError
    from hose_mj.hoses.registry import make_hose
    from hose_mj.hoses.spec import HoseSpec

__version__ = "0.1.0"

__all__ = ["HoseError", "HoseSpec", "InputError", "StepError", "__version__", "make_hose"]

_HOMES = {
    "HoseError": "hose_mj.errors",
    "HoseSpec": "hose_mj.hoses.spec",
    "InputError": "hose_mj.errors",
    "StepError": "hose_mj.errors",
    "make_hose": "hose_mj.hoses.registry",
}


def __getattr__(name: str) -> Any:
    """Loads an exported name from its home at first use."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})


if "gymnasium" in sys.modules:
    # As Gymnasium's users expect; `gymnasium.make("hose_mj:hose_mj/Line-v0")` comes here too.
    from hose_mj.extras import is_installed

    if is_installed("rl"):
        import hose_mj.envs  # noqa: F401  (registers the ids)
