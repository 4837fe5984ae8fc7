"""The hose models by id with what each can do, imported when they are made.

Models of other packages come by entry points of the group `hose_mj.hoses`: a `ModelEntry`, or the
model's class, which then counts as one that can do what the entry's defaults say.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, cast

from hose_mj.errors import InputError, check_choice
from hose_mj.hoses.spec import HoseSpec, check_spec
from hose_mj.plugins import find_plugins, load_plugin, load_plugins

if TYPE_CHECKING:
    from hose_mj.hoses.protocol import HoseModel

GROUP = "hose_mj.hoses"
"""Entry points of this group are hose models."""


@dataclass(frozen=True, kw_only=True)
class ModelEntry:
    """Where a hose model is, what it can do, and what its options are called.

    Attributes:
        target: "module:class"; the class takes a `HoseSpec` and keyword options.
        description: one line for listings.
        resolution: option that says how finely the hose is divided.
        scheme: option that chooses the integrator; None where there is but one.
        schemes: integrators that comparisons try, the best first.
        statics: how `solve_static` finds equilibrium, in words.
        plane: option that keeps the hose in a plane; None where there is none.
        is_planar: it always moves in the xz-plane.
        stretches: it has the spec's axial stiffness, and is not inextensible.
        twists: it has the spec's torsional stiffness.
        has_clamp_correction: its clamps are to be corrected by the option clamp_correction.
        contact: the class takes obstacles.
        contact_law: the class takes a contact law as well.
        requires: package that must be installed, "" for none.
        since: version from which on that package will do, (major, minor); None for any.
        below: major version from which on it no longer will do; None for any.
        missing: what a package that is too old or too new lacks, in words.
    """

    target: str
    description: str
    resolution: str = "segments"
    scheme: str | None = "integrator"
    schemes: tuple[str, ...] = ()
    statics: str = "newton on joint angles"
    plane: str | None = None
    is_planar: bool = False
    stretches: bool = False
    twists: bool = True
    has_clamp_correction: bool = False
    contact: bool = False
    contact_law: bool = False
    requires: str = ""
    since: tuple[int, int] | None = None
    below: int | None = None
    missing: str = ""

    def find_obstacle(self) -> str | None:
        """Returns why the model cannot be made with what is installed, in words, or None."""
        if not self.requires:
            return None
        try:
            installed = version(self.requires)
        except PackageNotFoundError:
            return f"it needs {self.requires}: pip install {self.requires}"
        parts = tuple(int(part) for part in installed.split(".")[:2])
        if self.since is not None and parts < self.since:
            needed = "{}.{} or later".format(*self.since)
        elif self.below is not None and parts[0] >= self.below:
            needed = f"below {self.below}"
        else:
            return None
        told = f"{self.requires} {installed} {self.missing}"
        return f"{told}; it needs {self.requires} {needed}"

    def load(self) -> type[Any]:
        """Imports the class.

        Raises:
            InputError: there is no such class, or it cannot be imported.
        """
        module, _, name = self.target.partition(":")
        try:
            return cast(type[Any], getattr(importlib.import_module(module), name))
        except (ImportError, AttributeError) as error:
            raise InputError(
                "class of a hose model", self.target, f"importable ({error})"
            ) from error


_MUJOCO: dict[str, Any] = {"has_clamp_correction": True, "requires": "mujoco"}
MODELS: dict[str, ModelEntry] = {
    "geds": ModelEntry(
        target="hose_mj.hoses.geds.hose:GedsHose",
        description="geometrically exact dynamic spline, implicit in time",
        resolution="control_points",
        scheme="scheme",
        schemes=("bdf2",),
        statics="statics",
        plane="plane",
        stretches=True,
        contact=True,
        contact_law=True,
    ),
    "cable": ModelEntry(
        target="hose_mj.hoses.mujoco.cable:CableHose",
        description=(
            "MuJoCo's composite cable: rigid segments, ball joints, explicit elastic forces"
        ),
        schemes=("euler", "rk4"),
        contact=True,
        below=4,
        missing="has no composite cable",
        **_MUJOCO,
    ),
    "flex": ModelEntry(
        target="hose_mj.hoses.mujoco.flex:FlexHose",
        description="MuJoCo's 1-D flex: point masses, rigid edges, implicit bending, no twist",
        scheme=None,
        schemes=("discrete",),
        since=(3, 13),
        missing='has no integrator "discrete"',
        statics="newton on vertices",
        twists=False,
        **_MUJOCO,
    ),
    "hinge-chain": ModelEntry(
        target="hose_mj.hoses.mujoco.hinge_chain:HingeChainHose",
        description="planar chain of hinges and joint springs in MuJoCo, for validation only",
        schemes=("euler", "rk4", "discrete"),
        is_planar=True,
        twists=False,
        **_MUJOCO,
    ),
}


def list_models() -> dict[str, ModelEntry]:
    """Returns all models by id: our own, then those of other packages.

    Raises:
        InputError: a plug-in that takes a name of ours.
    """
    return {**MODELS, **load_plugins(find_plugins(GROUP, own=MODELS), _read_plugin)}


def find_model(model: str) -> ModelEntry:
    """Returns the entry of a model.

    Raises:
        InputError: an unknown model, or a plug-in that is broken.
    """
    if isinstance(model, str) and model in MODELS:
        return MODELS[model]
    plugins = find_plugins(GROUP, own=MODELS)
    check_choice("model", model, [*MODELS, *plugins])
    return _read_plugin(plugins[model])


def check_model(model: str) -> ModelEntry:
    """Returns the entry of a model; raises `InputError` for one that cannot be made here."""
    entry = find_model(model)
    obstacle = entry.find_obstacle()
    if obstacle is not None:
        others = [name for name, other in MODELS.items() if other.find_obstacle() is None]
        raise InputError("model", model, f"one of {', '.join(others)} ({obstacle})")
    return entry


def check_options(
    model: str, made: type[Any], options: Mapping[str, Any]
) -> dict[str, inspect.Parameter]:
    """Returns the keyword options of a model's class; raises `InputError` for an unknown one."""
    parameters = dict(list(inspect.signature(made).parameters.items())[1:])
    for name in options:
        check_choice(f"option of {model}", name, parameters)
    return parameters


def _read_plugin(plugin: EntryPoint) -> ModelEntry:
    loaded = load_plugin(plugin, (ModelEntry, type))
    if isinstance(loaded, ModelEntry):
        return loaded
    description = (inspect.getdoc(loaded) or plugin.name).partition("\n")[0]
    return ModelEntry(target=f"{loaded.__module__}:{loaded.__qualname__}", description=description)


def make_hose(model: str, spec: HoseSpec, **options: Any) -> HoseModel:
    """Makes a hose.

    Args:
        model: a key of `list_models`.
        spec: what the hose is made of.
        options: keyword options of the model's class; `timestep` always.

    Raises:
        InputError: an unknown model or option, a missing option, a value out of range, or a model
            that cannot be made with what is installed.
    """
    made = check_model(model).load()
    check_spec(spec)
    parameters = check_options(model, made, options)
    for name, parameter in parameters.items():
        if parameter.default is inspect.Parameter.empty and name not in options:
            raise InputError(f"options of {model}", sorted(options), f"with {name!r} among them")
    return cast("HoseModel", made(spec, **options))
