"""The hose of an MJCF scene: `<custom>` numerics named hose_* and a named material."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence

from hose_mj.errors import InputError
from hose_mj.hoses.materials import HOSE_KEYS, MATERIAL_KEYS, read_catalogue
from hose_mj.hoses.spec import HoseSpec
from hose_mj.scenes.hose_file.spec import LENGTHS, read_spec
from hose_mj.toml_table import LARGEST_NUMBER, TomlTable

_OUTER, _OLD_OUTER = "hose_outer_radius", "hose_radius"
_RADII = {_OUTER: "outer_diameter", "hose_inner_radius": "inner_diameter"}
_KEYS = tuple(
    key
    for key in dict.fromkeys((*MATERIAL_KEYS, *HOSE_KEYS))
    if key not in ("outer_radius", *_RADII.values())
)
_MAY_BE_NEGATIVE = ("hose_rest_strain", "hose_rest_curvature", "hose_rest_torsion")
_MAY_BE_ZERO = (
    *("hose_poisson_ratio", "hose_inner_radius", "hose_contents_density"),
    *("hose_damping_time", "hose_drag", "hose_torsional_stiffness"),
)
HOSE_NUMERICS = ("hose_length", *_RADII, *(f"hose_{key}" for key in _KEYS), _OLD_OUTER)
"""Names of the numerics that describe the hose itself, one number each, in SI units; the last one
is deprecated."""
HOSE_TEXT = "hose_material"
"""Name of the text that names a material or a ready hose of materials.toml."""


def read_hose(
    numerics: Mapping[str, Sequence[float]], texts: Mapping[str, str], file: str
) -> HoseSpec:
    """Returns the hose that a scene describes.

    A named material or ready hose gives numbers first, and the scene's numerics replace them.

    Args:
        numerics: the scene's numerics of `HOSE_NUMERICS` by name.
        texts: the scene's texts by name.
        file: name of the scene's file, for messages.

    Raises:
        InputError: a number out of range, too few of them, or an unknown material.
    """
    given = {name: _check(name, numerics[name], file) for name in HOSE_NUMERICS if name in numerics}
    if _OLD_OUTER in given:
        _warn_of_radius(given, file)
    if "hose_length" not in given:
        valid = f"<custom><numeric name='hose_length' data='...'/>, {_RANGE}"
        raise InputError(f"{file}: numeric hose_length", None, valid)
    radius, inner = given.get(_OUTER), given.get("hose_inner_radius")
    if inner is not None and radius is not None and inner >= radius:
        valid = f"below {_OUTER}, {radius:g} m"
        raise InputError(f"{file}: numeric hose_inner_radius", inner, valid)
    values: dict[str, object] = {"length": given["hose_length"]}
    values |= {key: given[f"hose_{key}"] for key in _KEYS if f"hose_{key}" in given}
    values |= {key: 2.0 * given[name] for name, key in _RADII.items() if name in given}
    values |= _find_material(texts, file)
    try:
        return read_spec(TomlTable(values, file))
    except InputError as error:
        raise _rename(error, given, file) from error


def _warn_of_radius(given: dict[str, float], file: str) -> None:
    """Takes the old name of the outer radius, for one release."""
    if _OUTER in given:
        valid = f"left out where {_OUTER} is given"
        raise InputError(f"{file}: numeric {_OLD_OUTER}", given[_OLD_OUTER], valid)
    text = f"{file}: numeric {_OLD_OUTER} is deprecated: write {_OUTER}"
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    given[_OUTER] = given.pop(_OLD_OUTER)


_RANGE = f"a number from {LENGTHS[0]:g} to {LENGTHS[1]:g} (m)"


def _check(name: str, data: Sequence[float], file: str) -> float:
    thing = f"{file}: numeric {name}"
    if len(data) != 1:
        raise InputError(thing, tuple(data[:4]), "one number")
    value = float(data[0])
    if name == "hose_length":
        valid, is_valid = _RANGE, LENGTHS[0] <= value <= LENGTHS[1]
    elif name in _MAY_BE_NEGATIVE:
        valid, is_valid = "a finite number", True
    elif name in _MAY_BE_ZERO:
        valid, is_valid = "a finite number at or above 0", value >= 0.0
    else:
        valid, is_valid = "a finite number above 0", value > 0.0
    if not (is_valid and math.isfinite(value) and abs(value) <= LARGEST_NUMBER):
        raise InputError(thing, value, valid)
    return value


def _find_material(texts: Mapping[str, str], file: str) -> dict[str, str]:
    name = texts.get(HOSE_TEXT)
    if name is None:
        return {}
    catalogue = read_catalogue()
    if name in catalogue.hoses:
        return {"like": name}
    if name in catalogue.materials:
        return {"material": name}
    valid = "one of " + ", ".join((*catalogue.hoses, *catalogue.materials))
    raise InputError(f"{file}: text {HOSE_TEXT}", name[:80], valid)


def _rename(error: InputError, given: Mapping[str, float], file: str) -> InputError:
    """The same error in the words of a scene: numerics for TOML's keys, radii for diameters."""
    key = error.thing.rsplit(" ", 1)[-1].rsplit(".", 1)[-1]
    names = {key: name for name, key in _RADII.items()}
    name = names.get(key, f"hose_{key}")
    valid = error.valid.replace("outer_diameter", _OUTER)
    return InputError(f"{file}: numeric {name}", given.get(name, error.value), valid)
