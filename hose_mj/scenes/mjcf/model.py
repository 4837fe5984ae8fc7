"""What MuJoCo makes of a scene: checks on its numbers, and the facts that a `Scene` needs.

A scene is a stranger's file, and MuJoCo is native code: a file may crash it, hang it or eat all
memory. `probe` has a child with limits (this module as a program) compile the scene, check the
compiled numbers and take one step (`inspect_scene`); what comes back is a record of plain values,
or one `InputError`.
"""

import json
import os
import subprocess
import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.errors import InputError
from hose_mj.scenes.mjcf.files import shorten

LONGEST = 20  # seconds that the child may take
LARGEST_MEMORY = 4 << 30  # bytes of address space that the child may take
_LARGEST_ANSWER = 4_000_000
MOST = {"nbody": 2000, "ngeom": 5000, "nsite": 5000, "nv": 3000, "nu": 1000, "nnumeric": 1000}
"""Largest counts of a compiled scene."""
LONGEST_STEP = 0.1  # largest time step (s)
START = "start"  # name of the keyframe, if a scene has one, in which it starts
_OBJECTS = {
    **{"body": "body", "jnt": "joint", "geom": "geom", "site": "site", "actuator": "actuator"},
    **{"tendon": "tendon", "eq": "equality", "key": "key", "numeric": "numeric", "cam": "camera"},
    **{"light": "light", "mat": "material", "sensor": "sensor", "pair": "pair"},
}
_NOT_NEGATIVE = (
    *("body_mass", "body_inertia", "jnt_stiffness", "dof_damping", "dof_frictionloss"),
    *("dof_armature", "geom_friction", "tendon_stiffness", "tendon_damping"),
)


def probe(path: Path) -> dict[str, Any]:
    """Returns what `inspect_scene` finds in a scene, asked in a child process.

    Raises:
        InputError: what it raised there; or a scene that crashed the child or exceeded its limits.
    """
    thing, name = "file", shorten(path.name)
    valid = f"a scene that MuJoCo compiles within {LONGEST} s and {LARGEST_MEMORY >> 30} GiB"
    package = str(Path(__file__).resolve().parents[2])
    known = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(known), "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo writes its log where it runs
        try:
            done = subprocess.run(
                [sys.executable, "-m", __spec__.name, str(path)],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                timeout=2 * LONGEST,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise InputError(thing, name, f"{valid} (it took longer)") from error
    lines = done.stdout[-_LARGEST_ANSWER:].splitlines()
    try:
        answer = json.loads(lines[-1])
    except (IndexError, ValueError) as error:
        why = f"its process ended with status {done.returncode}"
        raise InputError(thing, name, f"{valid} ({why})") from error
    if "error" in answer:
        raise InputError(*answer["error"])
    return dict(answer)


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
    for name, most in MOST.items():
        if getattr(model, name) > most:
            raise InputError(f"{file}: {name}", getattr(model, name), f"at most {most}")
    _check_numbers(model, file)
    data = mujoco.MjData(model)
    reset_to_start(model, data)
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


def reset_to_start(model: Any, data: Any) -> None:
    """Resets MuJoCo's data to the state in which a scene starts; poses do not follow yet."""
    import mujoco

    key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, START)
    if key >= 0:
        mujoco.mj_resetDataKeyframe(model, data, key)
    else:
        mujoco.mj_resetData(model, data)


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


def limit_resources() -> None:
    """Bounds the time, memory and files of this process, where the system can."""
    try:
        import resource
    except ImportError:
        return
    for which, most in (
        (resource.RLIMIT_CPU, LONGEST),
        (resource.RLIMIT_AS, LARGEST_MEMORY),
        (resource.RLIMIT_FSIZE, 1 << 20),
        (resource.RLIMIT_CORE, 0),
    ):
        with suppress(ValueError, OSError):
            resource.setrlimit(which, (most, most))


def _main(path: Path) -> None:
    """Prints what is found in a scene, or its error, as the last line: one JSON document."""
    limit_resources()
    try:
        answer = inspect_scene(path)
    except InputError as error:
        value = error.value
        plain = value if isinstance(value, (str, int, float, type(None))) else repr(value)
        answer = {"error": [error.thing, plain, error.valid]}
    except MemoryError:
        valid = f"a scene that takes at most {LARGEST_MEMORY >> 30} GiB"
        answer = {"error": ["file", shorten(path.name), valid]}
    sys.stdout.write("\n" + json.dumps(answer) + "\n")


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
