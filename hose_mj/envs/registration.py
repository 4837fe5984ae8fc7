"""The ids under which Gymnasium and PettingZoo know the tasks."""

from __future__ import annotations

import gymnasium
import pettingzoo

IDS = {
    "hose_mj/Line-v0": "line",
    "hose_mj/LineSingleAgent-v0": "line-single-agent",
    "hose_mj/LineNonCooperative-v0": "line-non-cooperative",
    "hose_mj/Line2015-v0": "line-2015",
    "hose_mj/Taxi-v0": "taxi",
    "hose_mj/TaxiSingleAgent-v0": "taxi-single-agent",
    "hose_mj/Corridor-v0": "corridor",
    "hose_mj/Maze-v0": "maze",
}
"""Task ids by environment id."""
ALONE = {"hose_mj/LineSingleAgent-v0", "hose_mj/TaxiSingleAgent-v0", "hose_mj/Maze-v0"}
"""Those of one agent, which PettingZoo does not get."""


def register_all() -> None:
    """Registers every id that is not registered yet."""
    for id, task in IDS.items():
        if id not in gymnasium.registry:
            gymnasium.register(
                id,
                entry_point="hose_mj.envs.gym:TaskEnv",
                vector_entry_point="hose_mj.envs.vector:VectorTaskEnv",
                kwargs={"task": task},
            )
        if id in ALONE:
            continue
        if id not in pettingzoo.aec_registry:
            entry_point = "hose_mj.envs.turns:TurnsEnv"
            pettingzoo.register("aec", id, entry_point=entry_point, kwargs={"task": task})
        if id not in pettingzoo.parallel_registry:
            entry_point = "hose_mj.envs.parallel:JointEnv"
            pettingzoo.register("parallel", id, entry_point=entry_point, kwargs={"task": task})
