"""Holds that give way: `Spring`, what a clamp or an attachment is held by instead of rigidly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.spec import check_number


@dataclass(frozen=True)
class Spring:
    """A spring and a damper between a point of the hose and the place where a hold wants it.

    The force on the hose is k y + c y', y the target less the point, world frame. The moment of a
    clamp on it is half its stiffness times the sine of twice the angle between its tangent and the
    wanted one, without damping: that of a spring up to some 15 degrees, most at 45. A clamp holds
    the material's angle about the tangent rigidly.

    Attributes:
        stiffness: k (N/m); infinite for a place that is held rigidly.
        damping: c (N s/m), above 0 only with a stiffness that is finite.
        limit: the largest force (N): beyond it the hold slips, and pulls as hard as that towards
            its target. Finite only with a stiffness that is.
        turn_stiffness: of a clamp against turns of its tangent (N m/rad); infinite for rigid.

    Raises:
        InputError: a value outside its range.
    """

    stiffness: float = np.inf
    damping: float = 0.0
    limit: float = np.inf
    turn_stiffness: float = np.inf

    def __post_init__(self) -> None:
        for name in ("stiffness", "limit", "turn_stiffness"):
            value = getattr(self, name)
            if not (isinstance(value, float) and value == np.inf):
                value = float(check_number(f"{name} of a spring", value))
            object.__setattr__(self, name, value)
        damping = float(check_number("damping of a spring", self.damping, may_be_zero=True))
        object.__setattr__(self, "damping", damping)
        if self.stiffness == np.inf and (damping > 0.0 or self.limit < np.inf):
            valid = "a finite number above 0 (N/m) for a hold with damping or a limit"
            raise InputError("stiffness of a spring", self.stiffness, valid)
