"""The group `world`: robots on a hose, each hose model with the time step of the scene.

The cable divides it into as many parts as keep robots and hose together (docs/mujoco_cable.md);
without parts they part by millimetres when driven hard. `geds` also runs at 5 ms.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hose_mj.checks import Check
from hose_mj.scenes.mjcf import find_scene, read_scene
from hose_mj.world.driving import Driver
from hose_mj.world.registry import make_world
from hose_mj.world.world import World
from tools.bench_records import Bench, Record, measure_rate

PEER = "cable, 40 segments"
LEAST_RATIO = 20.0
"""Limit: how many times as many simulated seconds a second as the cable."""
_TOW = 0.2
"""Speed at which the robots tow the hose (m/s)."""


def measure(quick: bool, seed: int) -> Bench:
    """Times two pucks that tow a hose to and fro over the thesis's floor.

    Args:
        quick: fewer and shorter rounds.
        seed: of the start of their path.
    """
    rounds, seconds = (3, 0.3) if quick else (5, 1.0)
    scene = read_scene(find_scene("floor_2"))
    phase = float(np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi))
    worlds: dict[str, Callable[[], World]] = {
        PEER: lambda: make_world(scene, "cable", segments=40),
        "cable, 40 segments, no parts": lambda: make_world(scene, "cable", segments=40, substeps=1),
        "cable, 20 segments": lambda: make_world(scene, "cable", segments=20),
        "flex, 40 segments": lambda: make_world(scene, "flex", segments=40),
        "geds": lambda: make_world(scene),
        "geds, 5 ms": lambda: make_world(scene, timestep=0.005),
        "geds, 5 ms, bodies by MuJoCo": lambda: make_world(
            scene, timestep=0.005, compiled_pucks=False
        ),
    }
    bench = Bench()
    rates: dict[str, float] = {}
    for name, make in worlds.items():
        world = make()
        rates[name] = 0.01 * measure_rate(_tow(world, phase), rounds, seconds)
        ratio = rates[name] / rates[PEER]
        setting = f"{name}, steps of {1e3 * world.timestep:g} ms"
        substeps = getattr(world, "substeps", 1)
        if substeps > 1:
            setting += f" in {substeps} parts"
        bench.records.append(Record("world", setting, rates[name], "simulated s/s", PEER, ratio))
    for name in ("geds", "geds, 5 ms"):
        check = f"{name}: simulated seconds a second, times {PEER}"
        bench.checks.append(Check(check, rates[name] / rates[PEER], LEAST_RATIO, ">="))
    return bench


def _tow(world: World, phase: float) -> Callable[[], int]:
    """Returns what tows a hose for 10 ms and counts hundredths of a simulated second."""
    start = world.site_positions()[:-1]
    driver = Driver(world)
    radius = 0.04
    n_steps = round(0.01 / world.timestep)

    def work() -> int:
        angle = phase + _TOW / radius * world.time
        turn = radius * np.array([np.cos(angle) - np.cos(phase), np.sin(angle) - np.sin(phase), 0])
        driver.drive_to(start + turn)
        for _ in range(n_steps):
            driver.update()
            world.step()
        return 1

    return work
