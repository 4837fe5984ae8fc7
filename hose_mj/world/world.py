"""`World`: the robots of a scene and the hose that links them, with one clock.

Robots, walls and obstacles are bodies of one mjModel. `geds` hoses are coupled to it
(geds_world.py); `cable` and `flex` hoses are part of it (mujoco_world.py). All of them start from
the same shape (initial_shape.py) and answer the same questions. Frame: the world's; SI units. Arc
length 0 is at the source, L at the tip.
"""

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager, nullcontext
from typing import Any
from warnings import warn

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.health import Health
from hose_mj.hoses.inputs import check_count, check_vector
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.snapshots import undo
from hose_mj.scenes.mjcf.model import reset_to_start
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.toml_table import LARGEST_NUMBER
from hose_mj.world.centre_line import CentreLine


class World(ABC):
    """What all worlds share: the scene's bodies, the robots, controls and forces of the user.

    Args:
        scene: checked.
        model: the scene's mjModel, compiled with or without a hose in it; the scene's actuators
            come in its own order.

    Attributes:
        scene: as given.
        model, data: MuJoCo's; `data` is at the state between steps, positions and velocities
            consistent.
        sites: ids of the robots' sites, the tip's robot first, then that of the source (N + 1,).
        arc_lengths: where these hold the hose (N + 1,), m; the source's is 0.
        robot_bodies: ids of each robot's bodies: those under the same child of the world as its
            site.
        control: inputs of the scene's actuators (nu,), kept from step to step; written to.
        robot_forces: what `apply_force` has set, (N, 3), N.
    """

    hose_model: str  # name of the hose's model

    def __init__(self, scene: Scene, model: mujoco.MjModel) -> None:
        self.scene, self.model, self.data = scene, model, mujoco.MjData(model)
        names = [*(robot.site for robot in scene.robots), scene.source.site]
        self.sites = np.array([model.site(name).id for name in names])
        self.arc_lengths = np.array([*(robot.arc_length for robot in scene.robots), 0.0])
        roots = model.body_rootid[model.site_bodyid[self.sites[:-1]]]
        self.robot_bodies = [np.flatnonzero(model.body_rootid == root) for root in roots]
        self.control = np.zeros(model.nu)
        self.robot_forces = np.zeros((len(scene.robots), 3))

    # -- what each kind of world says for itself ---------------------------------------------------

    @property
    @abstractmethod
    def timestep(self) -> float:
        """Length of one step (s)."""

    @property
    @abstractmethod
    def time(self) -> float:
        """Simulated time since the last reset (s)."""

    @abstractmethod
    def reset(self) -> None:
        """Puts robots and hose where the scene starts, at rest; controls and forces become 0."""

    @abstractmethod
    def step(self, n_steps: int = 1) -> None:
        """Advances the clock by n_steps steps under `control` and the forces applied.

        Raises:
            InputError: n_steps is not a whole number at or above 0.
            StepError: a step that cannot be finished; the state before it is kept.
        """

    @abstractmethod
    def hose_position(self, arc_length: ArrayLike) -> Array:
        """Points of the hose's centre line at arc lengths (k,), m: (k, 3), m."""

    @abstractmethod
    def hose_velocity(self, arc_length: ArrayLike) -> Array:
        """Velocities of these points, (k, 3), m/s."""

    @abstractmethod
    def tension(self, arc_length: ArrayLike) -> Array:
        """Axial force, positive in tension, shape (k,), N."""

    @abstractmethod
    def centre_line(self) -> CentreLine:
        """The whole centre line as pieces of polynomials: exact, not sampled."""

    @abstractmethod
    def attachment_forces(self) -> Array:
        """Forces on the hose at its attachments, in the order of `sites`, (N + 1, 3), N.

        Those of the last step; the robots feel the opposite.
        """

    @property
    def health(self) -> Health | None:
        """How well the hose's steps went since the last reset; None of MuJoCo's hoses."""
        return None

    def unwatched(self) -> AbstractContextManager[None]:
        """Leaves `health` as it is, without a word, while something is tried and taken back."""
        return nullcontext()

    @abstractmethod
    def hose_snapshot(self) -> dict[str, Any]:
        """Returns what the hose remembers beyond MuJoCo's state; arrays and plain numbers only."""

    @abstractmethod
    def restore_hose(self, state: dict[str, Any]) -> None:
        """The inverse of `hose_snapshot`."""

    # -- names of the release before ---------------------------------------------------------------

    def position(self, arc_length: ArrayLike) -> Array:
        """The name of `hose_position` before; gone with the next release."""
        warn("World.position is now World.hose_position", DeprecationWarning, stacklevel=2)
        return self.hose_position(arc_length)

    def velocity(self, arc_length: ArrayLike) -> Array:
        """The name of `hose_velocity` before; gone with the next release."""
        warn("World.velocity is now World.hose_velocity", DeprecationWarning, stacklevel=2)
        return self.hose_velocity(arc_length)

    # -- robots ------------------------------------------------------------------------------------

    @property
    def n_robots(self) -> int:
        """N."""
        return len(self.scene.robots)

    def site_positions(self) -> Array:
        """Returns where robots and source hold the hose, in the order of `sites`, (N + 1, 3), m."""
        return np.array(self.data.site_xpos[self.sites])

    def site_velocities(self) -> Array:
        """Returns how fast these move, (N + 1, 3), m/s."""
        rows = np.zeros((3, self.model.nv))
        found = np.zeros((len(self.sites), 3))
        for k, site in enumerate(self.sites):
            mujoco.mj_jacSite(self.model, self.data, rows, None, site)
            found[k] = rows @ self.data.qvel
        return found

    def goal_position(self) -> Array:
        """Returns where the tip is to go, (3,), m."""
        return np.array(self.data.site(self.scene.goal.site).xpos)

    def apply_force(self, robot: int, force: ArrayLike) -> None:
        """Sets a force (3,), N, on a robot at its site; it acts until it is set anew.

        `InputError` is raised for a robot that there is not, or what is not three finite numbers.
        """
        if check_count("robot", robot, 0) >= self.n_robots:
            raise InputError("robot", robot, f"0 (tip) to {self.n_robots - 1}")
        self.robot_forces[robot] = check_vector("force", force)

    def check_control(self) -> None:
        """Raises `InputError` for a control that is not finite, or absurdly large."""
        if not (np.abs(self.control) <= LARGEST_NUMBER).all():
            valid = f"finite numbers, each at most {LARGEST_NUMBER:g}"
            raise InputError("control", self.control.tolist(), valid)

    # -- state -------------------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """All that `restore` needs to continue bit by bit: arrays, numbers, containers of them."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return {
            "mujoco": state,
            "control": self.control.copy(),
            "forces": self.robot_forces.copy(),
            "hose": self.hose_snapshot(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot of this world; `InputError` for what is none."""
        before = self.snapshot()
        with undo(lambda: self._restore(before)):
            self._restore(state)

    def _restore(self, state: dict[str, Any]) -> None:
        size = mujoco.mj_stateSize(self.model, _STATE)
        if state["mujoco"].shape != (size,):
            raise InputError("size of the state", state["mujoco"].shape, "a snapshot of this world")
        mujoco.mj_setState(self.model, self.data, state["mujoco"], _STATE)
        self.control[:], self.robot_forces[:] = state["control"], state["forces"]
        self.restore_hose(state["hose"])
        self._update_poses()

    # -- inside ------------------------------------------------------------------------------------

    def _start_bodies(self) -> None:
        """Puts the scene's bodies where it starts."""
        reset_to_start(self.model, self.data)
        self.control[:], self.robot_forces[:] = 0.0, 0.0
        self._update_poses()

    def _update_poses(self) -> None:
        """Makes poses and Jacobians follow qpos and qvel."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def _write_inputs(self) -> None:
        """Hands controls and the user's forces to MuJoCo."""
        self.check_control()
        self.data.ctrl[:] = self.control
        self.data.qfrc_applied[:] = 0.0
        if np.any(self.robot_forces):
            for site, force in zip(self.sites, self.robot_forces, strict=False):
                body, point = self.model.site_bodyid[site], self.data.site_xpos[site]
                mujoco.mj_applyFT(
                    *(self.model, self.data, force, np.zeros(3), point),
                    *(body, self.data.qfrc_applied),
                )


def check_scene(scene: object) -> None:
    """Raises `InputError` for what is no `Scene`."""
    if not isinstance(scene, Scene):
        raise InputError("scene", scene, "a Scene, as read_scene returns it")


_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
