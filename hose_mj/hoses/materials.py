"""Materials and ready hoses of assets/materials.toml, each number with its source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from hose_mj.assets import find_asset
from hose_mj.errors import InputError
from hose_mj.toml_table import TomlTable, read_toml

MATERIAL_KEYS = ("youngs_modulus", "poisson_ratio", "density", "damping_time")
HOSE_KEYS = (
    *("outer_diameter", "inner_diameter", "contents_density", "outer_radius"),
    *("axial_stiffness", "bending_stiffness", "second_bending_stiffness", "torsional_stiffness"),
    *("linear_density", "rest_strain", "rest_curvature", "rest_torsion", "damping_time", "drag"),
)


@dataclass(frozen=True)
class Sourced:
    """A number (SI) and where it comes from."""

    value: float
    source: str


@dataclass(frozen=True)
class Entry:
    """A material, or a ready hose with what its material gives.

    Attributes:
        title: one line.
        values: numbers by key, `MATERIAL_KEYS` and for a hose `HOSE_KEYS`.
    """

    title: str
    values: Mapping[str, Sourced]

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers without their sources."""
        return {key: sourced.value for key, sourced in self.values.items()}


@dataclass(frozen=True)
class Catalogue:
    """All entries by name."""

    materials: Mapping[str, Entry]
    hoses: Mapping[str, Entry]


@cache
def read_catalogue(path: Path | None = None) -> Catalogue:
    """Reads the materials that ship with hose_mj, or another file of that form.

    Raises:
        InputError: an unknown key, a number out of range or without a source.
    """
    file = read_toml(find_asset("materials.toml") if path is None else path)
    materials = _read_entries(file, "materials", MATERIAL_KEYS, {})
    hoses = _read_entries(file, "hoses", HOSE_KEYS, materials)
    file.finish()
    return Catalogue(materials, hoses)


def find_entry(entries: Mapping[str, Entry], name: str, thing: str) -> Entry:
    """Returns an entry by its name; raises `InputError`, which lists the names, for any other."""
    if name not in entries:
        raise InputError(thing, name, "one of " + ", ".join(entries))
    return entries[name]


def _read_entries(
    file: TomlTable, kind: str, keys: tuple[str, ...], materials: Mapping[str, Entry]
) -> dict[str, Entry]:
    entries = {}
    group = file.table(kind)
    for name in group.keys if group is not None else ():
        table = group.table(name)  # type: ignore[union-attr]
        assert table is not None
        values: dict[str, Sourced] = {}
        material = table.text("material") if materials else ""
        if material:
            values |= find_entry(materials, material, table.name("material")).values
        for key in keys:
            sourced = table.table(key)
            if sourced is not None:
                sourced.require("source", "where the number comes from")
                values[key] = Sourced(sourced.number("value"), sourced.text("source"))
                sourced.finish()
        entries[name] = Entry(table.text("title"), values)
        table.finish()
    return entries
