"""Settings of a chain inside an mjModel, checked, and the obstacles that it collides with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError, check_choice
from hose_mj.hoses.inputs import check_count, check_records, check_vector, read_numbers
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import check_number

INTEGRATORS = ("euler", "implicit", "implicitfast", "discrete", "rk4")
JACOBIANS = ("auto", "dense", "sparse")


@dataclass(frozen=True, kw_only=True)
class ChainSettings:
    """Settings that all hoses inside an mjModel share; `CableHose` says what they are."""

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
        object.__setattr__(self, "timestep", check_number("timestep", self.timestep))
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
        option.integrator = find_integrator(self.integrator)
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


def find_integrator(name: str) -> mujoco.mjtIntegrator:
    """Returns one of `INTEGRATORS` by its name; raises `InputError` where this MuJoCo lacks it."""
    found = getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}", None)
    if found is None:
        here = [i for i in INTEGRATORS if hasattr(mujoco.mjtIntegrator, f"mjINT_{i.upper()}")]
        known = f"one of {', '.join(here)} (MuJoCo {mujoco.__version__}; discrete: 3.13 or later)"
        raise InputError("integrator", name, known)
    return found


def check_solref(name: str, value: Sequence[float] | None) -> None:
    """Raises `InputError` unless `value` is None, two positive or two negative numbers."""
    if value is not None:
        first, second = check_numbers(name, value, 2)
        if not (first > 0 and second > 0) and not (first < 0 and second < 0):
            raise InputError(name, value, "two positive or two negative")


def check_numbers(name: str, value: Sequence[float], count: int) -> Array:
    """Returns an array; raises `InputError` unless `value` has `count` finite numbers."""
    array = read_numbers(name, value, f"{count} finite numbers")
    if array.shape != (count,) or not np.all(np.isfinite(array)):
        raise InputError(name, value, f"{count} finite numbers")
    return array


IMPEDANCE_RATIO = 10.0
"""MuJoCo's impratio: how much harder friction is than the normal force; 1 lets contacts slip."""


def check_obstacles(obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """Returns the obstacles; raises `InputError` for what is none, or for one that moves."""
    for obstacle in check_records("obstacles", obstacles, Obstacle):
        if np.any(obstacle.velocity) or np.any(obstacle.angular_velocity):
            raise InputError("velocity of an obstacle", obstacle.velocity, "0 for a chain")
    return tuple(obstacles)


def add_obstacles(
    maker: mujoco.MjSpec, bodies: Sequence[Any], obstacles: Sequence[Obstacle], timestep: float
) -> None:
    """Adds obstacles to a chain that is being made, and lets its segments touch them alone.

    Friction is the obstacle's: MuJoCo takes the larger of two geoms', the segments' is zero.
    Contacts are as hard as the time step allows (solref of two steps, critically damped), friction
    cones are elliptic.
    """
    if not obstacles:
        return
    maker.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    maker.option.impratio = IMPEDANCE_RATIO
    solref = [2.0 * timestep, 1.0]
    for body in bodies:
        for geom in body.geoms:
            geom.contype, geom.conaffinity, geom.condim = 0, 1, 3
            geom.friction, geom.solref = [0.0, 0.0, 0.0], solref
    for obstacle in obstacles:
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.asarray(obstacle.rotation).ravel())
        size = np.asarray(obstacle.size)
        maker.worldbody.add_geom(
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{obstacle.kind.upper()}"),
            pos=np.asarray(obstacle.position),
            quat=quaternion,
            size=[0.0, 0.0, 1.0] if obstacle.kind == "plane" else size,
            friction=[obstacle.friction, 0.0, 0.0],
            contype=1,
            conaffinity=0,
            condim=3,
            solref=solref,
        )
