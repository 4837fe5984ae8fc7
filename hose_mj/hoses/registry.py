"""The hose models by id, imported when they are made."""

from __future__ import annotations

import importlib
import inspect
from dataclasses import dataclass
from typing import Any, cast

from hose_mj.errors import InputError
from hose_mj.hoses.protocol import HoseModel
from hose_mj.hoses.spec import HoseSpec


@dataclass(frozen=True)
class ModelEntry:
    """Where a hose model is and what it is.

    Attributes:
        target: "module:class"; the class takes a `HoseSpec` and keyword options.
        description: one line for listings.
    """

    target: str
    description: str

    def load(self) -> type[Any]:
        """Imports the class."""
        module, _, name = self.target.partition(":")
        return cast(type[Any], getattr(importlib.import_module(module), name))


MODELS: dict[str, ModelEntry] = {
    "geds": ModelEntry(
        "hose_mj.hoses.geds.hose:GedsHose",
        "geometrically exact dynamic spline, implicit in time",
    ),
    "cable": ModelEntry(
        "hose_mj.hoses.mujoco.cable:CableHose",
        "MuJoCo's composite cable: rigid segments, ball joints, explicit elastic forces",
    ),
    "flex": ModelEntry(
        "hose_mj.hoses.mujoco.flex:FlexHose",
        "MuJoCo's 1-D flex: point masses, rigid edges, implicit bending, no twist",
    ),
    "hinge-chain": ModelEntry(
        "hose_mj.hoses.mujoco.hinge_chain:HingeChainHose",
        "planar chain of hinges and joint springs in MuJoCo, for validation only",
    ),
}


def make_hose(model: str, spec: HoseSpec, **options: Any) -> HoseModel:
    """Makes a hose.

    Args:
        model: a key of `MODELS`.
        spec: what the hose is made of.
        options: keyword options of the model's class; `timestep` always.

    Raises:
        InputError: an unknown model or option, a missing option, or a value out of range.
    """
    if model not in MODELS:
        raise InputError("model", model, "one of " + ", ".join(MODELS))
    made = MODELS[model].load()
    parameters = dict(list(inspect.signature(made).parameters.items())[1:])
    for name in options:
        if name not in parameters:
            raise InputError(f"option of {model}", name, "one of " + ", ".join(parameters))
    for name, parameter in parameters.items():
        if parameter.default is inspect.Parameter.empty and name not in options:
            raise InputError(f"options of {model}", sorted(options), f"with {name!r} among them")
    return cast(HoseModel, made(spec, **options))
