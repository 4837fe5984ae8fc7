"""What must run after any installation; tools/test_matrix.py runs it in fresh environments.

    python tools/smoke.py

It needs nothing but the package: a hose, the models of MuJoCo's that this version has, a world, an
episode to the goal, and an environment where the extra `rl` is there. One line for each part.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import mujoco
import numpy as np

from hose_mj import HoseSpec, make_hose
from hose_mj.errors import HoseError
from hose_mj.extras import is_installed
from hose_mj.hoses.registry import find_model

SPEC = HoseSpec.from_material(
    length=1.0,
    youngs_modulus=1e6,
    poisson_ratio=0.45,
    density=600.0,
    outer_radius=0.005,
    damping_time=0.02,
)


def hang(model: str, **options: int | float) -> str:
    """Lets a hose fall from level, held at one end; says where its tip is."""
    hose = make_hose(model, SPEC, **options)
    hose.reset([[0, 0, 1], [1, 0, 1]])
    hose.clamp(0.0)
    hose.step(100)
    tip = hose.position(1.0)[0]
    if not (np.isfinite(tip).all() and tip[2] < 1.0):
        raise SystemExit(f"{model}: the tip is at {tip}, not below 1 m")
    return f"tip {np.round(tip, 3)}"


def try_model(model: str, run: Callable[[], str]) -> str:
    """Runs a model of MuJoCo's; of versions that lack it one clear line must come."""
    lacking = find_model(model).find_obstacle()
    try:
        found = run()
    except HoseError as error:
        if lacking and "\n" not in str(error):
            return f"refused, as it must be: {error}"
        raise
    if lacking:
        raise SystemExit(f"{model}: it ran, though {lacking}")
    return found


def roll_out(model: str) -> str:
    """Drives one robot to the goal."""
    from hose_mj.constraints.monitor import Monitor
    from hose_mj.rollout.episode import run_episode
    from hose_mj.rollout.policies import make_policy
    from hose_mj.world.registry import make_world

    world = make_world("floor_1", model)
    ended = run_episode(
        *(world, Monitor(world), make_policy("to-goal")),
        duration=10.0,
        generator=np.random.default_rng(0),
    )
    if ended.ended_by != "goal":
        raise SystemExit(f"rollout with {model}: ended by {ended.ended_by}, not at the goal")
    return f"{ended.steps} steps"


def play() -> str:
    """Plays a random episode of the line task."""
    if not is_installed("rl"):
        return "left out (no extra rl)"
    import gymnasium

    import hose_mj.envs  # noqa: F401 - registers the ids

    env = gymnasium.make("hose_mj/Line-v0", n_robots=2)
    env.reset(seed=0)
    env.action_space.seed(0)
    moves, over = 0, False
    while not over:
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        moves, over = moves + 1, terminated or truncated
    return f"{moves} moves"


def list_parts() -> dict[str, Callable[[], str]]:
    """The parts by name."""
    return {
        "geds": lambda: hang("geds", timestep=0.01, control_points=16),
        "flex": lambda: try_model("flex", lambda: hang("flex", timestep=0.002, segments=20)),
        "cable": lambda: try_model("cable", lambda: hang("cable", timestep=0.001, segments=10)),
        "rollout, geds": lambda: roll_out("geds"),
        "rollout, flex": lambda: try_model("flex", lambda: roll_out("flex")),
        "environment": play,
    }


def main() -> int:
    """Runs all parts; a part that fails ends it with what it says."""
    versions = f"Python {sys.version.split()[0]}, MuJoCo {mujoco.__version__}"
    print(f"{versions}, numpy {np.__version__}", flush=True)
    for name, run in list_parts().items():
        begun = time.perf_counter()
        said = run()
        print(f"{name}: {said}, {time.perf_counter() - begun:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
