"""A world without a hose: the scene's bodies alone, for what does not depend on the hose."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from hose_mj.scenes.mjcf import Scene, find_scene, read_scene
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.world import World


class BareWorld(World):
    """Straight lines between the sites stand where the hose would be; they weigh nothing."""

    hose_model = "none"

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, scene.make_spec().compile())
        self.reset()

    @property
    def timestep(self) -> float:
        return float(self.model.opt.timestep)

    @property
    def time(self) -> float:
        return float(self.data.time)

    def reset(self) -> None:
        self._start_bodies()

    def step(self, n_steps: int = 1) -> None:
        for _ in range(n_steps):
            self._write_inputs()
            mujoco.mj_step(self.model, self.data)
        self._update_poses()

    def position(self, arc_length):
        return self.centre_line().position(np.atleast_1d(arc_length))

    def velocity(self, arc_length):
        return np.zeros((len(np.atleast_1d(arc_length)), 3))

    def tension(self, arc_length):
        return np.zeros(len(np.atleast_1d(arc_length)))

    def centre_line(self) -> CentreLine:
        return CentreLine.of_chain(self.arc_lengths[::-1], self.site_positions()[::-1])

    def attachment_forces(self):
        return np.zeros((len(self.sites), 3))

    def hose_snapshot(self) -> dict[str, Any]:
        return {}

    def restore_hose(self, state: dict[str, Any]) -> None:
        pass


def make_bare_world(name: str) -> BareWorld:
    return BareWorld(read_scene(find_scene(name)))
