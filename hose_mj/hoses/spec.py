"""What a hose is made of: `HoseSpec`, one frozen record in SI units that every hose model reads."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from hose_mj.errors import InputError

_MAY_BE_ZERO = {"torsional_stiffness", "damping_time", "drag"}
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
        check_number("start of a fitting", self.start, may_be_zero=True)
        check_number("end of a fitting", self.end)
        if self.end <= self.start:
            raise InputError("end of a fitting", self.end, f"above its start ({self.start} m)")
        for field in fields(self)[2:]:
            if getattr(self, field.name) is not None:
                check_number(f"{field.name} of a fitting", getattr(self, field.name))


@dataclass(frozen=True, kw_only=True)
class HoseSpec:
    """A hose, cable or rope at rest.

    The stiffnesses are the diagonal of the Hooke matrix of thesis eq. A.9, the rest strains the
    epsilon_0 of eq. A.11. Material directors m1, m2 and the tangent t make a right-handed frame
    that turns with the hose; curvature K1 bends it about m1, K2 about m2.

    Attributes:
        length: rest length L (m).
        axial_stiffness: EA (N).
        bending_stiffness: EI (N m^2), about m1.
        second_bending_stiffness: EI about m2 (N m^2), for ribbons and flat cables; None for a hose
            that bends alike in every direction.
        torsional_stiffness: GJ (N m^2).
        linear_density: mass per rest length (kg/m); the thesis's mu times A.
        radius: outer radius (m), for drawing, contact and the section that MuJoCo implies.
        rest_strain: stretch strain at which the hose is free of tension.
        rest_curvature: K1 at which the hose is free of moment (1/m), signed.
        rest_torsion: twist per length at which it is free of torque (1/m); with a rest curvature
            the rest shape is a coil.
        fittings: stretches made otherwise; they may not overlap.
        damping_time: Kelvin-Voigt relaxation time tau (s): stress = E (strain + tau d strain/dt).
        drag: viscous force per rest length and velocity (N s/m^2).

    Raises:
        InputError: a value that is not finite, or not above zero where it must be.
    """

    length: float
    axial_stiffness: float
    bending_stiffness: float
    second_bending_stiffness: float | None = None
    torsional_stiffness: float = 0.0
    linear_density: float
    radius: float = 0.01
    rest_strain: float = 0.0
    rest_curvature: float = 0.0
    rest_torsion: float = 0.0
    damping_time: float = 0.0
    drag: float = 0.0
    fittings: tuple[Fitting, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.name == "fittings":
                continue
            if field.name == "second_bending_stiffness" and self.second_bending_stiffness is None:
                continue
            check_number(
                field.name,
                getattr(self, field.name),
                may_be_zero=field.name in _MAY_BE_ZERO,
                may_be_negative=field.name in _MAY_BE_NEGATIVE,
            )
        if self.rest_strain <= -1.0:
            raise InputError("rest_strain", self.rest_strain, "a number above -1")
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
        check_number("youngs_modulus", youngs_modulus)
        check_number("density", density)
        check_number("outer_radius", outer_radius)
        check_number("inner_radius", inner_radius, may_be_zero=True)
        check_number("poisson_ratio", poisson_ratio, may_be_zero=True, may_be_negative=True)
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
            radius=outer_radius,
            damping_time=damping_time,
            drag=drag,
        )

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


def check_number(
    name: str, value: object, *, may_be_zero: bool = False, may_be_negative: bool = False
) -> None:
    """Raises `InputError` unless `value` is a finite number of the wanted sign."""
    sign = "" if may_be_negative else (" at or above 0" if may_be_zero else " above 0")
    valid = f"a finite number{sign}"
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(name, value, valid)
    if (value < 0 and not may_be_negative) or (value == 0 and not (may_be_zero or may_be_negative)):
        raise InputError(name, value, valid)
