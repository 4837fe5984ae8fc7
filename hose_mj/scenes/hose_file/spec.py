"""The table [hose] of a user's file: what the hose is made of."""

from hose_mj.errors import InputError
from hose_mj.hoses.materials import HOSE_KEYS, MATERIAL_KEYS, find_entry, read_catalogue
from hose_mj.hoses.spec import Fitting, HoseSpec, complete_section
from hose_mj.toml_table import TomlTable

LENGTHS = (1e-3, 1e4)  # a hose is at least and at most so long (m)
_MAY_BE_NEGATIVE = ("rest_strain", "rest_curvature", "rest_torsion")
_MAY_BE_ZERO = (
    *("poisson_ratio", "inner_diameter", "contents_density", "damping_time", "drag"),
    "torsional_stiffness",
)
_FITTING_KEYS = ("axial_stiffness", "bending_stiffness", "torsional_stiffness", "linear_density")
_NEEDED = (
    ("axial_stiffness", "EA in N, or a material and outer_diameter"),
    ("bending_stiffness", "EI in N m^2, or a material and outer_diameter"),
    ("linear_density", "kg/m, or mass, or a material and outer_diameter"),
    ("outer_radius", "m, or outer_diameter"),
)
"""What a hose must have in the end, and how a user gives it."""
_SLENDER = 0.25  # the radius is at most this fraction of the length


def read_spec(table: TomlTable) -> HoseSpec:
    """Returns the hose of a table [hose].

    A ready hose (`like`) and a material (`material`) give numbers first; the numbers that stand in
    the table replace them. Diameters and a material make the stiffnesses and the linear density;
    those that are stated replace what was made. `InputError` is raised for an unknown key or name,
    a number out of range, or too few of them.
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
    try:
        made = complete_section(given)
        for key, why in _NEEDED:
            if key not in made:
                raise InputError(key, None, why)
        if not made["outer_radius"] <= _SLENDER * length:
            valid = f"at most {_SLENDER:g} of the length, {_SLENDER * length:g} m"
            raise InputError("outer_radius", made["outer_radius"], valid)
        return HoseSpec(length=length, fittings=fittings, **made)
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


def _read_fitting(table: TomlTable, length: float) -> Fitting:
    start = table.number("start", least=0.0, most=length)
    end = table.number("end", above=start, most=length)
    values = {key: table.find_number(key, above=0.0) for key in _FITTING_KEYS}
    table.finish()
    return Fitting(start=start, end=end, **values)
