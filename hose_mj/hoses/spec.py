"""What a hose is made of: `HoseSpec`, one frozen record in SI units that every hose model reads."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from hose_mj.errors import InputError

_MAY_BE_ZERO = {"torsional_stiffness", "damping_time", "drag"}
_MAY_BE_NEGATIVE = {"rest_strain", "rest_curvature"}


@dataclass(frozen=True, kw_only=True)
class HoseSpec:
    """A uniform hose, cable or rope at rest.

    The three stiffnesses are the diagonal of the Hooke matrix of thesis eq. A.9, the two rest
    strains the epsilon_0 of eq. A.11.

    Attributes:
        length: rest length L (m).
        axial_stiffness: EA (N).
        bending_stiffness: EI (N m^2).
        torsional_stiffness: GJ (N m^2).
        linear_density: mass per rest length (kg/m); the thesis's mu times A.
        radius: outer radius (m), for drawing, contact and the section that MuJoCo implies.
        rest_strain: stretch strain at which the hose is free of tension.
        rest_curvature: curvature at which the hose is free of moment (1/m); signed, and therefore
            for a hose that moves in one plane.
        damping_time: Kelvin-Voigt relaxation time tau (s): stress = E (strain + tau d strain/dt).
        drag: viscous force per rest length and velocity (N s/m^2).

    Raises:
        InputError: a value that is not finite, or not above zero where it must be.
    """

    length: float
    axial_stiffness: float
    bending_stiffness: float
    torsional_stiffness: float = 0.0
    linear_density: float
    radius: float = 0.01
    rest_strain: float = 0.0
    rest_curvature: float = 0.0
    damping_time: float = 0.0
    drag: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            check_number(
                field.name,
                getattr(self, field.name),
                may_be_zero=field.name in _MAY_BE_ZERO,
                may_be_negative=field.name in _MAY_BE_NEGATIVE,
            )
        if self.rest_strain <= -1.0:
            raise InputError("rest_strain", self.rest_strain, "a number above -1")

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
        return self.linear_density * self.length


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
