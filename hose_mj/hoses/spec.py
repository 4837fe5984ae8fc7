"""What a hose is made of: `HoseSpec`, one frozen record in SI units that every hose model reads."""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Mapping
from dataclasses import InitVar, dataclass, fields
from numbers import Real
from typing import Any

from hose_mj.errors import InputError, is_finite
from hose_mj.hoses import materials

POISSON_RATIO = 0.3
"""Where neither GJ nor a Poisson ratio is given, GJ = EI / (1 + this), as of a round section."""
_MAY_BE_ZERO = {"bending_stiffness", "torsional_stiffness", "damping_time", "drag"}
_MAY_BE_NEGATIVE = {"rest_strain", "rest_curvature", "rest_torsion"}


@dataclass(frozen=True, kw_only=True)
class Fitting:
    """A stretch of the hose that is made otherwise: a coupling, a sleeve, a thinner piece.

    Attributes:
        start, end: where it begins and ends, rest arc lengths (m).
        axial_stiffness, bending_stiffness, torsional_stiffness, linear_density: as in `HoseSpec`;
            None for the hose's own. An unequal second bending stiffness keeps its ratio.
    """

    start: float
    end: float
    axial_stiffness: float | None = None
    bending_stiffness: float | None = None
    torsional_stiffness: float | None = None
    linear_density: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            value, may_be_zero = getattr(self, field.name), field.name == "start"
            if value is not None or field.name in ("start", "end"):
                value = check_number(f"{field.name} of a fitting", value, may_be_zero=may_be_zero)
                object.__setattr__(self, field.name, value)
        if self.end <= self.start:
            raise InputError("end of a fitting", self.end, f"above its start ({self.start} m)")


@dataclass(frozen=True, kw_only=True)
class HoseSpec:
    """A hose, cable or rope at rest.

    The stiffnesses are the diagonal of the Hooke matrix of thesis eq. A.9, the rest strains the
    epsilon_0 of eq. A.11. Material directors m1, m2 and the tangent t make a right-handed frame
    that turns with the hose; curvature K1 bends it about m1, K2 about m2.

    Attributes:
        length: rest length L (m).
        axial_stiffness: EA (N).
        bending_stiffness: EI (N m^2), about m1; 0 for a chain.
        second_bending_stiffness: EI about m2 (N m^2), for ribbons and flat cables; None for a hose
            that bends alike in every direction.
        torsional_stiffness: GJ (N m^2); left out (None) that of a round section of a material with
            `POISSON_RATIO`, EI / 1.3, also after `dataclasses.replace` of EI; 0 for a hose that
            twists freely.
        linear_density: mass per rest length (kg/m); the thesis's mu times A.
        outer_radius: (m), for drawing, contact and the section that MuJoCo implies. `radius`, its
            old name, goes on for one release with a DeprecationWarning.
        rest_strain: stretch strain at which the hose is free of tension.
        rest_curvature: K1 at which the hose is free of moment (1/m), signed.
        rest_torsion: twist per length at which it is free of torque (1/m); with a rest curvature
            the rest shape is a coil.
        fittings: stretches made otherwise; they may not overlap.
        damping_time: Kelvin-Voigt relaxation time tau (s): stress = E (strain + tau d strain/dt).
        drag: viscous force per rest length and velocity (N s/m^2).
        default_torsion: for `dataclasses.replace` alone: the GJ that was filled in, None where it
            was given.

    Raises:
        InputError: a value that is not finite, or not above zero where it must be.
    """

    length: float
    axial_stiffness: float
    bending_stiffness: float
    second_bending_stiffness: float | None = None
    torsional_stiffness: float = None  # type: ignore[assignment]  # a number once made
    linear_density: float
    outer_radius: float = 0.01
    rest_strain: float = 0.0
    rest_curvature: float = 0.0
    rest_torsion: float = 0.0
    damping_time: float = 0.0
    drag: float = 0.0
    fittings: tuple[Fitting, ...] = ()
    default_torsion: InitVar[float | None] = None

    def __post_init__(self, default_torsion: float | None) -> None:
        given = self.torsional_stiffness
        if given is None or (isinstance(given, float) and given == default_torsion):
            stiffness = check_number("bending_stiffness", self.bending_stiffness, may_be_zero=True)
            default_torsion = stiffness / (1.0 + POISSON_RATIO)
            object.__setattr__(self, "torsional_stiffness", default_torsion)
            object.__setattr__(self, "default_torsion", default_torsion)
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "fittings":
                continue
            if field.name == "second_bending_stiffness" and value is None:
                continue
            number = check_number(
                field.name,
                value,
                may_be_zero=field.name in _MAY_BE_ZERO,
                may_be_negative=field.name in _MAY_BE_NEGATIVE,
            )
            object.__setattr__(self, field.name, number)
        if self.rest_strain <= -1.0:
            raise InputError("rest_strain", self.rest_strain, "a number above -1")
        parts = self.fittings
        if not isinstance(parts, tuple) or not all(isinstance(one, Fitting) for one in parts):
            raise InputError("fittings", parts, "a tuple of Fitting")
        end = 0.0
        for fitting in sorted(self.fittings, key=lambda fitting: fitting.start):
            if fitting.start < end or fitting.end > self.length:
                valid = f"stretches within 0 to {self.length} m that do not overlap"
                raise InputError("fittings", (fitting.start, fitting.end), valid)
            end = fitting.end

    @classmethod
    def from_material(
        cls,
        *,
        length: float,
        youngs_modulus: float,
        poisson_ratio: float,
        density: float,
        outer_radius: float,
        inner_radius: float = 0.0,
        damping_time: float = 0.0,
        drag: float = 0.0,
    ) -> HoseSpec:
        """Returns the spec of a tube (or rod) of an isotropic elastic material.

        EA = E pi (ro^2 - ri^2), EI = E pi/4 (ro^4 - ri^4), GJ = G pi/2 (ro^4 - ri^4) with
        G = E / (2 (1 + nu)).

        Args:
            length: rest length (m).
            youngs_modulus: E (Pa).
            poisson_ratio: nu, in (-1, 0.5].
            density: of the material (kg/m^3); the bore is empty.
            outer_radius: ro (m).
            inner_radius: ri (m), 0 for a solid rod.
            damping_time: Kelvin-Voigt relaxation time (s).
            drag: viscous force per length and velocity (N s/m^2).

        Raises:
            InputError: a value outside its range.
        """
        youngs_modulus = check_number("youngs_modulus", youngs_modulus)
        density = check_number("density", density)
        outer_radius = check_number("outer_radius", outer_radius)
        inner_radius = check_number("inner_radius", inner_radius, may_be_zero=True)
        poisson_ratio = check_number("poisson_ratio", poisson_ratio, may_be_negative=True)
        if not -1.0 < poisson_ratio <= 0.5:
            raise InputError("poisson_ratio", poisson_ratio, "a number in (-1, 0.5]")
        if inner_radius >= outer_radius:
            raise InputError("inner_radius", inner_radius, f"below outer_radius ({outer_radius} m)")
        area = math.pi * (outer_radius**2 - inner_radius**2)
        second_moment = math.pi / 4 * (outer_radius**4 - inner_radius**4)
        shear_modulus = youngs_modulus / (2 * (1 + poisson_ratio))
        return cls(
            length=length,
            axial_stiffness=youngs_modulus * area,
            bending_stiffness=youngs_modulus * second_moment,
            torsional_stiffness=shear_modulus * 2 * second_moment,
            linear_density=density * area,
            outer_radius=outer_radius,
            damping_time=damping_time,
            drag=drag,
        )

    @classmethod
    def ready(cls, name: str, *, length: float) -> HoseSpec:
        """Returns a ready hose of assets/materials.toml, where each number has its source.

        Args:
            name: a key of `list_ready`, such as "garden-hose-19mm".
            length: rest length (m).

        Raises:
            InputError: an unknown name, which lists the known ones, or a length out of range.
        """
        check_number("length", length)
        hose = materials.find_entry(materials.read_catalogue().hoses, name, "ready hose")
        return cls(length=length, **complete_section(hose.numbers))  # type: ignore[arg-type]

    @staticmethod
    def list_ready() -> dict[str, str]:
        """Returns the names of the ready hoses and a line about each."""
        return {name: hose.title for name, hose in materials.read_catalogue().hoses.items()}

    @property
    def radius(self) -> float:
        """Deprecated: `outer_radius`."""
        _warn_of_radius("HoseSpec.radius", stacklevel=3)
        return self.outer_radius

    @property
    def mass(self) -> float:
        """Mass of the whole hose (kg)."""
        own = self.linear_density
        return own * self.length + sum(
            (fitting.linear_density - own) * (fitting.end - fitting.start)
            for fitting in self.fittings
            if fitting.linear_density is not None
        )

    @property
    def is_isotropic(self) -> bool:
        """True for a hose that bends alike in every direction and is straight at rest."""
        return (
            self.second_bending_stiffness in (None, self.bending_stiffness)
            and self.rest_curvature == 0.0
        )


def _warn_of_radius(old: str, stacklevel: int) -> None:
    text = f"{old} is deprecated and goes with the next release: write outer_radius"
    warnings.warn(text, DeprecationWarning, stacklevel=stacklevel)


def _accept_radius(make: Any) -> Any:
    """HoseSpec's __init__ with the old name of outer_radius, which wins: `replace` gives both."""

    @functools.wraps(make)
    def make_with_radius(self: HoseSpec, **values: Any) -> None:
        if "radius" in values:
            _warn_of_radius("HoseSpec(radius=...)", stacklevel=3)
            values["outer_radius"] = values.pop("radius")
        make(self, **values)

    return make_with_radius


HoseSpec.__init__ = _accept_radius(HoseSpec.__init__)  # type: ignore[method-assign]


def complete_section(numbers: Mapping[str, float]) -> dict[str, float]:
    """Returns what diameters and a material make, each number replaced by the one stated.

    Args:
        numbers: SI, by key of `materials.MATERIAL_KEYS` and `HOSE_KEYS`.

    Returns:
        arguments of `HoseSpec` but for the length; some may be missing, GJ only without EI.

    Raises:
        InputError: a number out of range; its `thing` is the key.
    """
    stated = {
        field.name: numbers[field.name] for field in fields(HoseSpec) if field.name in numbers
    }
    made = {}
    if "outer_diameter" in numbers:
        outer, inner = numbers["outer_diameter"], numbers.get("inner_diameter", 0.0)
        if inner >= outer:
            raise InputError("inner_diameter", inner, f"below outer_diameter, {outer:g} m")
        made["outer_radius"] = outer / 2.0
        if {"youngs_modulus", "poisson_ratio", "density"} <= numbers.keys():
            tube = HoseSpec.from_material(
                length=1.0,
                youngs_modulus=numbers["youngs_modulus"],
                poisson_ratio=numbers["poisson_ratio"],
                density=numbers["density"],
                outer_radius=outer / 2.0,
                inner_radius=inner / 2.0,
            )
            contents = numbers.get("contents_density", 0.0) * math.pi * inner**2 / 4.0
            made |= {
                "axial_stiffness": tube.axial_stiffness,
                "bending_stiffness": tube.bending_stiffness,
                "torsional_stiffness": tube.torsional_stiffness,
                "linear_density": tube.linear_density + contents,
            }
    made |= stated
    if "bending_stiffness" in made:
        ratio = numbers.get("poisson_ratio", POISSON_RATIO)
        made.setdefault("torsional_stiffness", made["bending_stiffness"] / (1.0 + ratio))
    return made


def check_spec(spec: object) -> None:
    """Raises `InputError` for what is no `HoseSpec`."""
    if not isinstance(spec, HoseSpec):
        raise InputError("spec", spec, "a HoseSpec")


def check_number(
    name: str, value: object, *, may_be_zero: bool = False, may_be_negative: bool = False
) -> float:
    """Returns a number, one of numpy's as a float.

    Raises:
        InputError: anything but a finite number of the wanted sign.
    """
    sign = "" if may_be_negative else (" at or above 0" if may_be_zero else " above 0")
    # A whole number may be one that no float holds.
    if isinstance(value, bool) or not isinstance(value, Real) or not is_finite(value):
        raise InputError(name, value, f"a finite number{sign}")
    number = value if isinstance(value, int) else float(value)
    if not may_be_negative and (number < 0 or (number == 0 and not may_be_zero)):
        raise InputError(name, value, f"a finite number{sign}")
    return number
