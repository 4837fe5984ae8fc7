"""Hoses carried by robots: spline, cable and flex models, scenes, tasks, environments, recordings.

Importing the package costs next to nothing; what it exports is loaded at first use:

    import hose_mj

    spec = hose_mj.HoseSpec.ready("garden-hose-19mm", length=2.0)
    hose = hose_mj.make_hose("geds", spec, timestep=0.01)
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

from hose_mj.moved import MovedFinder
from hose_mj.version import __version__

if TYPE_CHECKING:
    from hose_mj.constraints.limits import Limits
    from hose_mj.constraints.monitor import Monitor
    from hose_mj.errors import HoseError, HoseWarning, InputError, StepError
    from hose_mj.hoses.fluid import Fluid
    from hose_mj.hoses.health import Health
    from hose_mj.hoses.obstacles import ContactLaw, Obstacle
    from hose_mj.hoses.protocol import Hold, HoseModel
    from hose_mj.hoses.registry import make_hose
    from hose_mj.hoses.spec import Fitting, HoseSpec
    from hose_mj.hoses.springs import Spring
    from hose_mj.scenes.mjcf.catalogue import find_scene
    from hose_mj.scenes.mjcf.scene import read_scene
    from hose_mj.tasks.registry import make_task
    from hose_mj.world.registry import make_world

__all__ = [
    "ContactLaw",
    "Fitting",
    "Fluid",
    "Health",
    "Hold",
    "HoseError",
    "HoseModel",
    "HoseSpec",
    "HoseWarning",
    "InputError",
    "Limits",
    "Monitor",
    "Obstacle",
    "Spring",
    "StepError",
    "__version__",
    "find_scene",
    "make_hose",
    "make_task",
    "make_world",
    "read_scene",
]

_HOMES = {
    "ContactLaw": "hose_mj.hoses.obstacles",
    "Fitting": "hose_mj.hoses.spec",
    "Fluid": "hose_mj.hoses.fluid",
    "Health": "hose_mj.hoses.health",
    "Hold": "hose_mj.hoses.protocol",
    "HoseError": "hose_mj.errors",
    "HoseModel": "hose_mj.hoses.protocol",
    "HoseSpec": "hose_mj.hoses.spec",
    "HoseWarning": "hose_mj.errors",
    "InputError": "hose_mj.errors",
    "Limits": "hose_mj.constraints.limits",
    "Monitor": "hose_mj.constraints.monitor",
    "Obstacle": "hose_mj.hoses.obstacles",
    "Spring": "hose_mj.hoses.springs",
    "StepError": "hose_mj.errors",
    "find_scene": "hose_mj.scenes.mjcf.catalogue",
    "make_hose": "hose_mj.hoses.registry",
    "make_task": "hose_mj.tasks.registry",
    "make_world": "hose_mj.world.registry",
    "read_scene": "hose_mj.scenes.mjcf.scene",
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


sys.meta_path.insert(0, MovedFinder())


if "gymnasium" in sys.modules:
    # As Gymnasium's users expect; `gymnasium.make("hose_mj:hose_mj/Line-v0")` comes here too.
    from hose_mj.extras import is_installed

    if is_installed("rl"):
        import hose_mj.envs  # noqa: F401  (registers the ids)
