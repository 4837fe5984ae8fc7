"""`Fluid`: still or moving water or air about a hose, with Morison's coefficients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.inputs import check_rows, check_vector
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import check_number

Field = Callable[[Array], ArrayLike]
"""Velocities (k, 3), m/s, of a fluid at places (k, 3), m, world frame."""


@dataclass(frozen=True, kw_only=True)
class Fluid:
    """A fluid that fills all space, and how it acts on a hose (Morison, O'Brien et al. 1950).

    With d the hose's outer diameter, A = pi d^2 / 4 and u the hose's velocity less the fluid's, the
    force per rest length is

        -density d / 2 (normal_drag |un| un + pi tangential_drag |ut| ut)
        - added_mass density A an - density A gravity,

    un and ut the parts of u across and along the hose, an that of the hose's acceleration across
    it. What fills the hose counts to its own linear density. The default coefficients are usual
    ones of a smooth round line; the current's own acceleration and lift are left out.

    Attributes:
        density: kg/m^3.
        velocity: of the fluid, (3,), m/s, world frame, or a function of places (k, 3), m, that
            returns (k, 3); it is asked once a step, where the step begins.
        normal_drag: Cn, of flow across the hose.
        tangential_drag: Ct, of flow along it, over its skin.
        added_mass: Ca, of a hose that moves across itself; 1 for a round one in an ideal fluid.

    Raises:
        InputError: a number that is not finite or below 0, a velocity of another shape.
    """

    density: float
    velocity: ArrayLike | Field = (0.0, 0.0, 0.0)
    normal_drag: float = 1.2
    tangential_drag: float = 0.01
    added_mass: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "density", check_number("density of the fluid", self.density))
        for name in ("normal_drag", "tangential_drag", "added_mass"):
            number = check_number(name, getattr(self, name), may_be_zero=True)
            object.__setattr__(self, name, number)
        if not callable(self.velocity):
            velocity = check_vector("velocity of the fluid", self.velocity).copy()
            velocity.flags.writeable = False
            object.__setattr__(self, "velocity", velocity)

    def compute_velocities(self, places: Array) -> Array:
        """Velocities (k, 3), m/s, at places (k, 3), m.

        Raises:
            InputError: the function of places returns another shape or a number that is not finite.
        """
        if callable(self.velocity):
            found = self.velocity(places)
            return check_rows("velocity(places) of the fluid", found, len(places))
        return np.tile(np.asarray(self.velocity), (len(places), 1))


def check_fluid(fluid: object) -> Fluid | None:
    """Returns a fluid or None; raises `InputError` for anything else."""
    if fluid is not None and not isinstance(fluid, Fluid):
        raise InputError("fluid", fluid, "a Fluid or None")
    return fluid
