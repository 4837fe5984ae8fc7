"""Settings of a chain inside an mjModel, checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.inputs import check_choice, check_count, check_vector
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import check_number

INTEGRATORS = ("euler", "implicit", "implicitfast", "discrete", "rk4")
JACOBIANS = ("auto", "dense", "sparse")


@dataclass(frozen=True, kw_only=True)
class ChainSettings:
    """Settings that both chains share.

    Attributes:
        timestep: length of one step (s).
        gravity: (3,) m/s^2.
        segments: number of rigid segments, at least 2.
        integrator: one of `INTEGRATORS`, MuJoCo's names.
        clamp_correction: centre the segment of a clamped end on that end (see `ChainLayout`).
        iterations: most iterations of MuJoCo's constraint solver.
        tolerance: its termination tolerance.
        jacobian: one of `JACOBIANS`.
        hold_solref: MuJoCo's solref of clamps and attachments; None for a time constant of two
            steps, critically damped.
        hold_solimp: their solimp.
        obstacles: what the chain collides with.
    """

    timestep: float
    gravity: ArrayLike
    segments: int
    integrator: str
    clamp_correction: bool
    iterations: int
    tolerance: float
    jacobian: str
    hold_solref: Sequence[float] | None
    hold_solimp: Sequence[float]
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        check_number("timestep", self.timestep)
        check_number("tolerance", self.tolerance, may_be_zero=True)
        check_vector("gravity", self.gravity)
        check_count("segments", self.segments, 2)
        check_count("iterations", self.iterations, 1)
        check_choice("integrator", self.integrator, INTEGRATORS)
        check_choice("jacobian", self.jacobian, JACOBIANS)
        check_solref("hold_solref", self.hold_solref)
        check_numbers("hold_solimp", self.hold_solimp, 5)

    def apply(self, option: Any) -> None:
        """Writes the options of a model that is being made."""
        option.timestep, option.gravity = self.timestep, np.asarray(self.gravity, dtype=float)
        option.iterations, option.tolerance = self.iterations, self.tolerance
        option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{self.integrator.upper()}")
        option.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{self.jacobian.upper()}")

    def hold_options(self) -> dict[str, object]:
        """solref and solimp of holds."""
        return {"solref": list(self._solref), "solimp": list(self.hold_solimp)}

    @property
    def lead(self) -> float:
        """Steps by which a moving target must run ahead for a hold to be in time.

        The integrator "discrete" lets a hold see the position that the step ends with, but not
        where its target will be then: one step more.
        """
        first, second = self._solref
        damping, stiffness = -second, -first
        if first > 0:
            damping, stiffness = 2 / first, 1 / (first * second) ** 2
        return damping / (stiffness * self.timestep) - (self.integrator != "discrete")

    @property
    def _solref(self) -> tuple[float, float]:
        if self.hold_solref is None:
            return 2 * self.timestep, 1.0
        return float(self.hold_solref[0]), float(self.hold_solref[1])


def check_solref(name: str, value: Sequence[float] | None) -> None:
    """Raises `InputError` unless `value` is None, two positive or two negative numbers."""
    if value is not None:
        first, second = check_numbers(name, value, 2)
        if not (first > 0 and second > 0) and not (first < 0 and second < 0):
            raise InputError(name, value, "two positive or two negative")


def check_numbers(name: str, value: Sequence[float], count: int) -> Array:
    """Returns an array; raises `InputError` unless `value` has `count` finite numbers."""
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (count,) or not np.all(np.isfinite(array)):
        raise InputError(name, value, f"{count} finite numbers")
    return array
