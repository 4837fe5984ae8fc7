"""The table [hose] of a user's file: what the hose is made of."""

from __future__ import annotations

import math
from dataclasses import fields

from hose_mj.errors import InputError
from hose_mj.hoses.spec import Fitting, HoseSpec
from hose_mj.scenes.hose_file.toml_table import TomlTable
from hose_mj.scenes.materials import HOSE_KEYS, MATERIAL_KEYS, find_entry, read_catalogue

LENGTHS = (1e-3, 1e4)
"""A hose is at least and at most so long (m)."""
_MAY_BE_NEGATIVE = ("rest_strain", "rest_curvature", "rest_torsion")
_MAY_BE_ZERO = ("poisson_ratio", "inner_diameter", "contents_density", "damping_time", "drag")
_SPEC_KEYS = tuple(field.name for field in fields(HoseSpec) if field.name not in ("radius",))
_FITTING_KEYS = ("axial_stiffness", "bending_stiffness", "torsional_stiffness", "linear_density")
_ROUND = 1.3
"""EI / GJ of a round section where nothing else is known: 1 + nu for nu = 0.3."""
_SLENDER = 0.25
"""The radius is at most this fraction of the length."""


def read_spec(table: TomlTable) -> HoseSpec:
    """Returns the hose of a table [hose].

    A ready hose (`like`) and a material (`material`) give numbers first; the numbers that stand in
    the table replace them. Diameters and a material make the stiffnesses and the linear density;
    those that are stated replace what was made.

    Raises:
        InputError: an unknown key or name, a number out of range, or too few of them.
    """
    length = table.number("length", least=LENGTHS[0], most=LENGTHS[1])
    given = _gather(table)
    fittings = tuple(_read_fitting(part, length) for part in table.tables("fittings"))
    mass = table.find_number("mass", above=0.0)
    table.finish()
    if mass is not None:
        if "linear_density" in table:
            raise table.fail("mass", mass, "left out where linear_density is given")
        given["linear_density"] = mass / length
    made = _make_from_section(table, given, length)
    for key, why in (
        ("axial_stiffness", "EA in N, or a material and outer_diameter"),
        ("bending_stiffness", "EI in N m^2, or a material and outer_diameter"),
        ("linear_density", "kg/m, or mass, or a material and outer_diameter"),
        ("outer_radius", "m, or outer_diameter"),
    ):
        if key not in made:
            raise table.fail(key, None, why)
    made.setdefault("torsional_stiffness", made["bending_stiffness"] / _ROUND)
    radius = made.pop("outer_radius")
    if not radius <= _SLENDER * length:
        valid = f"at most {_SLENDER:g} of the length, {_SLENDER * length:g} m"
        raise table.fail("outer_radius", radius, valid)
    try:
        return HoseSpec(length=length, radius=radius, fittings=fittings, **made)
    except InputError as error:
        raise table.fail(error.thing, error.value, error.valid) from error


def _gather(table: TomlTable) -> dict[str, float]:
    """Numbers of the ready hose, of the material, then of the table itself."""
    given: dict[str, float] = {}
    like, material = table.text("like"), table.text("material")
    if like:
        given |= find_entry(read_catalogue().hoses, like, table.name("like")).numbers
    if material:
        given |= find_entry(read_catalogue().materials, material, table.name("material")).numbers
    for key in dict.fromkeys((*MATERIAL_KEYS, *HOSE_KEYS)):
        least = -1e15 if key in _MAY_BE_NEGATIVE else 0.0
        above = None if key in _MAY_BE_NEGATIVE or key in _MAY_BE_ZERO else 0.0
        value = table.find_number(key, least=least, above=above)
        if value is not None:
            given[key] = value
    return given


def _make_from_section(
    table: TomlTable, given: dict[str, float], length: float
) -> dict[str, float]:
    """Makes the keys of `HoseSpec`, and outer_radius, of a section; stated ones win."""
    stated = {key: value for key, value in given.items() if key in (*_SPEC_KEYS, "outer_radius")}
    if "outer_diameter" not in given:
        return stated
    outer, inner = given["outer_diameter"], given.get("inner_diameter", 0.0)
    if inner >= outer:
        raise table.fail("inner_diameter", inner, f"below outer_diameter, {outer:g} m")
    made = {"outer_radius": outer / 2.0}
    if {"youngs_modulus", "poisson_ratio", "density"} <= given.keys():
        try:
            tube = HoseSpec.from_material(
                length=length,
                youngs_modulus=given["youngs_modulus"],
                poisson_ratio=given["poisson_ratio"],
                density=given["density"],
                outer_radius=outer / 2.0,
                inner_radius=inner / 2.0,
            )
        except InputError as error:
            raise table.fail(error.thing, error.value, error.valid) from error
        contents = given.get("contents_density", 0.0) * math.pi * inner**2 / 4.0
        made |= {
            "axial_stiffness": tube.axial_stiffness,
            "bending_stiffness": tube.bending_stiffness,
            "torsional_stiffness": tube.torsional_stiffness,
            "linear_density": tube.linear_density + contents,
        }
    return made | stated


def _read_fitting(table: TomlTable, length: float) -> Fitting:
    start = table.number("start", least=0.0, most=length)
    end = table.number("end", above=start, most=length)
    values = {key: table.find_number(key, above=0.0) for key in _FITTING_KEYS}
    table.finish()
    return Fitting(
        start=start,
        end=end,
        axial_stiffness=values["axial_stiffness"],
        bending_stiffness=values["bending_stiffness"],
        torsional_stiffness=values["torsional_stiffness"],
        linear_density=values["linear_density"],
    )
