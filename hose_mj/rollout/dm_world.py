"""A world as a dm_control environment, physics and task apart; dm_control's viewer opens it.

from dm_control import viewer
from hose_mj.rollout.dm_world import load

viewer.launch(load("floor_2"))
"""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hose_mj.constraints.monitor import Break, Monitor
from hose_mj.errors import InputError
from hose_mj.extras import MissingExtra
from hose_mj.hoses.protocol import Array
from hose_mj.rollout.episode import is_at_goal
from hose_mj.rollout.video import color_pieces
from hose_mj.scenes.mjcf.scene import Scene, find_scene, read_scene
from hose_mj.world.registry import make_world
from hose_mj.world.world import World

try:
    from dm_control import mujoco as dm_mujoco
    from dm_control.mujoco.wrapper import MjData
    from dm_control.rl import control
    from dm_env import specs
except ImportError as error:
    raise MissingExtra("cable", "a world as a dm_control environment") from error

HOSE = "shown_hose/"  # prefix of the bodies that show a hose that is not part of MuJoCo's model
N_PIECES = 60
N_POINTS = 33  # points along the hose in an observation


class WorldPhysics(dm_mujoco.Physics):
    """A world behind dm_control's `Physics`: rendering, named access, `step`.

    `model` and `data` are copies for the eye: a scene's bodies and, where the hose is a spline, a
    row of capsules that follow it. They are brought up to date after every step, and nothing that
    is written to them reaches the world; `set_control` does. `broken` is the first break that the
    monitor has found since the reset; steps end there.
    """

    def __init__(self, world: World, monitor: Monitor) -> None:
        self.world, self.monitor = world, monitor
        self.broken: Break | None = None
        self._shows_hose = world.hose_model not in ("cable", "flex")
        self._arcs = np.linspace(0.0, world.scene.spec.length, N_PIECES + 1)
        self._limit = monitor.limits.compute_tension_limit(
            world.scene.spec, float(np.linalg.norm(world.model.opt.gravity))
        )
        model = _compile_shown(world.scene) if self._shows_hose else world.model
        pieces = [i for i in range(model.nbody) if model.body(i).name.startswith(HOSE)]
        self._mocaps = model.body_mocapid[pieces]
        self._geoms = model.body_geomadr[pieces]
        super().__init__(MjData(mujoco.MjData(model)))
        self._show()

    def step(self, nstep: int = 1) -> None:
        """Advances the world, up to its first break."""
        for _ in range(nstep):
            if self.broken is None:
                self.world.step()
                self.broken = self.monitor.check()
        self._show()

    def reset(self, keyframe_id: int | None = None) -> None:
        """Returns to the start of the scene, the only one; `InputError` for a keyframe."""
        if keyframe_id is not None:
            valid = "None: a world starts where its scene does"
            raise InputError("keyframe_id", keyframe_id, valid)
        self.world.reset()
        self.monitor.reset()
        self.broken = None
        self._show()

    def after_reset(self) -> None:
        """Brings what is shown up to date."""
        self._show()

    def set_control(self, control: Any) -> None:
        """Sets the inputs of the scene's actuators."""
        self.world.control[:] = control

    def control(self) -> Array:
        """A copy of these inputs."""
        return self.world.control.copy()

    def time(self) -> float:
        """Simulated time (s)."""
        return self.world.time

    def timestep(self) -> float:
        """Length of a step (s)."""
        return self.world.timestep

    def get_state(self, sig: int | None = None) -> Any:
        """A snapshot of the world, the hose included; see `World.snapshot`."""
        if sig is not None:
            raise InputError("sig", sig, "None: the state is a snapshot of the whole world")
        return self.world.snapshot()

    def set_state(self, physics_state: Any, sig: int | None = None) -> None:
        """Returns to a snapshot."""
        if sig is not None:
            raise InputError("sig", sig, "None: the state is a snapshot of the whole world")
        self.world.restore(physics_state)
        self.monitor.reset()
        self.broken = None
        self._show()

    def _show(self) -> None:
        """Makes `data` and the hose's colours follow the world."""
        world, model, data = self.world, self.model.ptr, self.data.ptr
        data.qpos[:], data.qvel[:] = world.data.qpos, world.data.qvel
        data.ctrl[:], data.time = world.control, world.time
        if self._shows_hose:
            points = world.hose_position(self._arcs)
            steps = np.diff(points, axis=0)
            data.mocap_pos[self._mocaps] = 0.5 * (points[1:] + points[:-1])
            for mocap, step in zip(self._mocaps, steps, strict=True):
                mujoco.mju_quatZ2Vec(data.mocap_quat[mocap], step / np.linalg.norm(step))
            model.geom_rgba[self._geoms] = color_pieces(world, self._arcs, self._limit)
        mujoco.mj_forward(model, data)


class WorldTask(control.Task):
    """Brings the tip to the goal with raw controls of the motors, without a break.

    Observed are `positions` and `velocities` of the robots' sites and the source (N + 1, 3),
    `goal` (3,), `hose` (33, 3), m and m/s, and the monitor's `margins`, N or m. The reward is 1 at
    the goal, -1 at a break, else 0; both end the episode.
    """

    def initialize_episode(self, physics: WorldPhysics) -> None:
        """Nothing is left to do after the physics's reset."""

    def before_step(self, action: Any, physics: WorldPhysics) -> None:
        """Sets the controls."""
        physics.set_control(action)

    def action_spec(self, physics: WorldPhysics) -> specs.BoundedArray:
        """The controls of all actuators (nu,), within their ranges."""
        return dm_mujoco.action_spec(physics)

    def get_observation(self, physics: WorldPhysics) -> dict[str, Array]:
        """Fresh arrays."""
        world = physics.world
        arcs = np.linspace(0.0, world.scene.spec.length, N_POINTS)
        return {
            "positions": world.site_positions(),
            "velocities": world.site_velocities(),
            "goal": world.goal_position(),
            "hose": world.hose_position(arcs),
            "margins": physics.monitor.measure(),
        }

    def get_reward(self, physics: WorldPhysics) -> float:
        """1 at the goal, -1 at a break."""
        return -1.0 if physics.broken else float(is_at_goal(physics.world))

    def get_termination(self, physics: WorldPhysics) -> float | None:
        """A discount of 0 at the goal and at a break."""
        return 0.0 if physics.broken or is_at_goal(physics.world) else None


def load(
    scene: Scene | str | Path,
    model: str = "geds",
    *,
    time_limit: float = 30.0,
    control_timestep: float | None = None,
    **options: Any,
) -> control.Environment:
    """Makes a dm_control environment of a scene.

    Args:
        scene: checked, or the name of a shipped one, or an MJCF file.
        model: of the hose.
        time_limit: simulated time after which an episode is cut off (s).
        control_timestep: between two actions (s), a multiple of the world's step; one by default.
        **options: of the world's class.

    Raises:
        InputError: an unknown scene or model, a time that is not above 0, or what reading the
            scene finds wrong.
    """
    if not time_limit > 0.0:
        raise InputError("time_limit", time_limit, "a number above 0 (s)")
    checked = scene if isinstance(scene, Scene) else read_scene(find_scene(scene))
    world = make_world(checked, model, **options)
    between = world.timestep if control_timestep is None else control_timestep
    n_steps = round(between / world.timestep) if np.isfinite(between) else 0
    if n_steps < 1 or abs(n_steps * world.timestep - between) > 1e-9:
        valid = f"a multiple of the world's step, {world.timestep:g} s"
        raise InputError("control_timestep", control_timestep, valid)
    physics = WorldPhysics(world, Monitor(world))
    return control.Environment(physics, WorldTask(), time_limit=time_limit, n_sub_steps=n_steps)


def _compile_shown(scene: Scene) -> mujoco.MjModel:
    """The scene with a row of capsules that do nothing but be seen."""
    spec = scene.make_spec()
    half = 0.5 * scene.spec.length / N_PIECES
    for k in range(N_PIECES):
        body = spec.worldbody.add_body(name=f"{HOSE}{k}", mocap=True)
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[scene.spec.outer_radius, half, 0.0],
            contype=0,
            conaffinity=0,
        )
    return spec.compile()
