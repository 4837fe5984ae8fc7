"""How a hose becomes part of a scene's mjModel: options, names, ties to the robots."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.mujoco.chain_settings import IMPEDANCE_RATIO
from hose_mj.hoses.spec import check_number
from hose_mj.scenes.mjcf.scene import Scene

PREFIX = "hose/"
"""Of the names of all that is added to a scene."""
HARD = [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""MuJoCo's solimp of ties and edges."""


@dataclass(frozen=True)
class Numerics:
    """How MuJoCo steps a scene with a hose.

    Attributes:
        timestep: of the world (s).
        substeps: MuJoCo's steps in one of these.
        integrator, jacobian: MuJoCo's names.
    """

    timestep: float
    substeps: int
    integrator: str
    jacobian: str

    def __post_init__(self) -> None:
        check_number("timestep", self.timestep)
        check_count("substeps", self.substeps, 1)

    def tie_options(self) -> dict[str, list[float]]:
        """solref (two of MuJoCo's steps, critically damped) and solimp of ties and edges."""
        return {"solref": [2.0 * self.inner_step, 1.0], "solimp": HARD}

    @property
    def inner_step(self) -> float:
        """MuJoCo's own time step (s)."""
        return self.timestep / self.substeps

    def apply(self, option: mujoco.MjOption) -> None:
        """Writes the options of a scene that is being made.

        Raises:
            InputError: a scene that switches off what ties the hose to its robots.
        """
        for flag in ("CONSTRAINT", "EQUALITY"):
            if option.disableflags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"):
                raise InputError(f"<option> <flag> {flag.lower()}", "disable", "enable")
        option.timestep = self.inner_step
        option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{self.integrator.upper()}")
        option.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{self.jacobian.upper()}")
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, IMPEDANCE_RATIO


def join_hose(
    scene: Scene, maker: mujoco.MjSpec, hose: mujoco.MjSpec, ties: dict[str, list[float]]
) -> tuple[mujoco.MjModel, np.ndarray]:
    """Adds a hose to a scene, behind all that is there, and ties it to robots and source.

    Args:
        scene: checked.
        maker: its spec.
        hose: with sites hold0, hold1, ... for the robots and, last, the source.
        ties: solref and solimp of the ties, equality constraints of these names.

    Returns:
        the model and the ids of the hose's bodies in their order.

    Raises:
        InputError: MuJoCo refuses the two together, or the scene changes the hose's mass.
    """
    names = [body.name for body in hose.bodies if body.name != "world"]
    maker.attach(hose, prefix=PREFIX, frame=maker.worldbody.add_frame())
    for k, place in enumerate((*scene.robots, scene.source)):
        maker.add_equality(
            name=f"{PREFIX}hold{k}",
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=f"{PREFIX}hold{k}",
            name2=place.site,
            **ties,
        )
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "flex .* is not rigid")  # those that only collide
            model = maker.compile()
    except ValueError as error:
        valid = f"one that takes a hose (MuJoCo: {' '.join(str(error).split())})"
        raise InputError("scene", str(scene.path), valid) from error
    bodies = np.array([model.body(PREFIX + name).id for name in names])
    mass = float(model.body_mass[bodies].sum())
    if not np.isclose(mass, scene.spec.mass, rtol=1e-6):
        valid = f"{scene.spec.mass:g} kg, which settotalmass and the like in <compiler> change"
        raise InputError("mass of the hose", mass, valid)
    return model, bodies
