"""The group `world`: robots on a hose, each hose model with the time step of the scene; recording.

The cable divides it into as many parts as keep robots and hose together (docs/mujoco_cable.md);
without parts they part by millimetres when driven hard. `geds` also runs at 5 ms.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.checks import Check
from hose_mj.cli.bench import Bench, Record, measure_rate
from hose_mj.constraints.monitor import Monitor
from hose_mj.recording.rerun import open_sinks
from hose_mj.rollout.capture import Capture
from hose_mj.rollout.episode import run_episode
from hose_mj.scenes.mjcf.scene import Scene, find_scene, read_scene
from hose_mj.world.driving import Driver
from hose_mj.world.registry import make_world
from hose_mj.world.world import World

PEER = "cable, 40 segments"
LEAST_RATIO = 20.0  # limit: how many times as many simulated seconds a second as the cable
MOST_RECORDING = 0.05  # limit: what recording adds to the processor time of a rollout's thread
_DURATION = 20.0  # simulated seconds of a rollout
_TOW = 0.2  # speed at which the robots tow the hose (m/s), round a circle
_RADIUS = 0.04  # of the circle (m)


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
    own, every = _measure_recording(scene, phase, 3 if quick else 7)
    bench.records += [
        Record("world", "recording over the rollout, on its own thread", own, "1"),
        Record("world", "recording over the rollout, all threads", every, "1"),
    ]
    name = "recording to a file: processor time on the rollout's thread, over that without"
    bench.checks.append(Check(name, own, MOST_RECORDING, "<="))
    return bench


class _Tow:
    """The policy of `_tow`."""

    ends_at_goal = False

    def __init__(self, phase: float) -> None:
        self._phase = phase

    def start(self, world: World, monitor: Monitor, generator: np.random.Generator) -> None:
        """Begins the path where the robots are."""
        self._world, self._driver = world, Driver(world)
        self._start = world.site_positions()[:-1]

    def update(self) -> None:
        """Drives on."""
        self._driver.drive_to(self._start + _find_turn(self._phase, self._world.time))
        self._driver.update()

    def describe(self) -> dict[str, Any]:
        """Nothing to say."""
        return {}


def _measure_recording(scene: Scene, phase: float, rounds: int) -> tuple[float, float]:
    """What recording to a file adds to a rollout, over that: on its own thread, on all threads.

    Processor time, opening and closing the file included; the least of several rounds.
    """
    world = make_world(scene)
    monitor = Monitor(world)

    def play(duration: float, save: Path | None) -> tuple[float, float]:
        world.reset()
        begun = time.thread_time(), time.process_time()
        with Capture(open_sinks(save=save)) as capture:
            observers = [capture] if save else []
            run_episode(world, monitor, _Tow(phase), duration=duration, observers=observers)
        return time.thread_time() - begun[0], time.process_time() - begun[1]

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rollout.rrd"
        play(1.0, file)  # compiles
        times = np.array(
            [[play(_DURATION, None), play(_DURATION, file)] for _ in range(rounds)]
        ).min(axis=0)
    own, every = times[1] / times[0] - 1.0
    return float(own), float(every)


def _find_turn(phase: float, now: float) -> np.ndarray:
    """Where robots that go round a circle are, seen from where they began (3,), m."""
    angle = phase + _TOW / _RADIUS * now
    return _RADIUS * np.array([np.cos(angle) - np.cos(phase), np.sin(angle) - np.sin(phase), 0.0])


def _tow(world: World, phase: float) -> Callable[[], int]:
    """Returns what tows a hose for 10 ms and counts hundredths of a simulated second."""
    start = world.site_positions()[:-1]
    driver = Driver(world)
    n_steps = round(0.01 / world.timestep)

    def work() -> int:
        driver.drive_to(start + _find_turn(phase, world.time))
        for _ in range(n_steps):
            driver.update()
            world.step()
        return 1

    return work
