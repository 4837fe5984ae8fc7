"""A scene as MuJoCo compiled it: checks on the model's numbers, and the facts a `Scene` needs."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.errors import InputError
from hose_mj.scenes.mjcf.files import shorten

MOST = {"nbody": 2000, "ngeom": 5000, "nsite": 5000, "nv": 3000, "nu": 1000, "nnumeric": 1000}
"""Largest counts of a compiled scene."""
LONGEST_STEP = 0.1
"""Largest time step (s)."""
START = "start"
"""Name of the keyframe, if a scene has one, in which it starts."""
_OBJECTS = {
    **{"body": "body", "jnt": "joint", "geom": "geom", "site": "site", "actuator": "actuator"},
    **{"tendon": "tendon", "eq": "equality", "key": "key", "numeric": "numeric", "cam": "camera"},
    **{"light": "light", "mat": "material", "sensor": "sensor", "pair": "pair"},
}
_NOT_NEGATIVE = (
    *("body_mass", "body_inertia", "jnt_stiffness", "dof_damping", "dof_frictionloss"),
    *("dof_armature", "geom_friction", "tendon_stiffness", "tendon_damping"),
)


def inspect_scene(path: Path) -> dict[str, Any]:
    """Compiles a scene, checks its numbers, takes one step and returns plain facts.

    Returns:
        timestep (s); sites: dicts of name, body, position (world, m, at the start) and whether the
        body can move; numerics: lists by name; texts and tuples (of site names) by name.

    Raises:
        InputError: a scene that MuJoCo refuses, a number out of range, a step that fails.
    """
    import mujoco

    file = shorten(path.name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what they say of numbers is checked below
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except (ValueError, mujoco.FatalError, mujoco.UnexpectedError) as error:
            why = " ".join(str(error).removeprefix("Error: ").split())[:300]
            valid = f"MJCF that MuJoCo {mujoco.__version__} compiles ({why})"
            raise InputError("file", file, valid) from error
    _check_counts(model, file)
    _check_numbers(model, file)
    data = mujoco.MjData(model)
    key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, START)
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    mujoco.mj_forward(model, data)
    sites = [
        {
            "name": model.site(i).name,
            "body": model.body(model.site_bodyid[i]).name,
            "position": data.site_xpos[i].tolist(),
            "moves": bool(model.body_weldid[model.site_bodyid[i]] != 0),
        }
        for i in range(model.nsite)
    ]
    _check_step(model, data, file)
    return {
        "timestep": float(model.opt.timestep),
        "sites": sites,
        "numerics": {n.name: n.data.tolist() for n in map(model.numeric, range(model.nnumeric))},
        "texts": dict(_read_text(model, i) for i in range(model.ntext)),
        "tuples": {model.tuple(i).name: _list_sites(model, i) for i in range(model.ntuple)},
    }


def _check_counts(model: Any, file: str) -> None:
    for name, most in MOST.items():
        if getattr(model, name) > most:
            raise InputError(f"{file}: {name}", getattr(model, name), f"at most {most}")


def _check_numbers(model: Any, file: str) -> None:
    step = float(model.opt.timestep)
    if not 0.0 < step <= LONGEST_STEP:  # also refuses what is not a number
        valid = f"a finite number above 0, at most {LONGEST_STEP:g} (s)"
        raise InputError(f"{file}: <option> timestep", step, valid)
    for owner, prefix in ((model.opt, "<option> "), (model, "")):
        for name in dir(owner):
            value = None if name.startswith("_") else getattr(owner, name, None)
            if not isinstance(value, (float, np.ndarray)):
                continue
            array = np.atleast_1d(value)
            if array.dtype.kind != "f":
                continue
            bad = ~np.isfinite(array)
            if bad.any():
                thing = f"{file}: {prefix}{_name_value(model, name, bad)}"
                raise InputError(thing, float(array[bad][0]), "a finite number")
    for name in _NOT_NEGATIVE:
        array = getattr(model, name)
        bad = array < 0.0
        if bad.any():
            thing = f"{file}: {_name_value(model, name, bad)}"
            raise InputError(thing, float(array[bad][0]), "a finite number at or above 0")


def _name_value(model: Any, name: str, bad: Any) -> str:
    """The element and the value that are wrong: "joint slide: stiffness"."""
    prefix, _, rest = name.partition("_")
    index = int(np.argwhere(bad)[0][0])
    if prefix == "dof":
        prefix, index = "jnt", int(model.dof_jntid[index])
    kind = _OBJECTS.get(prefix)
    if kind is None:
        return name
    named = getattr(model, kind)(index).name
    return f"{kind} {shorten(named) or index}: {rest}"


def _check_step(model: Any, data: Any, file: str) -> None:
    import mujoco

    mujoco.mj_step(model, data)
    names = ("BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")
    bad = [int(getattr(mujoco.mjtWarning, f"mjWARN_{name}")) for name in names]
    if any(data.warning[which].number for which in bad) or not np.isfinite(data.qpos).all():
        valid = "a scene whose first step stays finite; look at masses, overlaps and the time step"
        raise InputError(f"{file}: first step", "not finite", valid)


def _read_text(model: Any, index: int) -> tuple[str, str]:
    """Name and content of a text."""
    import mujoco

    start = model.text_adr[index]
    data = bytes(model.text_data)[start : start + model.text_size[index]]
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, index) or ""
    return name, data.rstrip(b"\0").decode("utf-8", "replace")


def _list_sites(model: Any, index: int) -> list[str]:
    """The names of the sites in a tuple; "" for an element of another kind."""
    import mujoco

    start = model.tuple_adr[index]
    elements = range(start, start + model.tuple_size[index])
    return [
        model.site(model.tuple_objid[k]).name
        if model.tuple_objtype[k] == mujoco.mjtObj.mjOBJ_SITE
        else ""
        for k in elements
    ]
