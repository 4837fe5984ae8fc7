"""What can be asked of a hose inside an mjModel, by arc length."""

from __future__ import annotations

from abc import ABC

import mujoco
from numpy.typing import ArrayLike

from hose_mj.hoses.inputs import check_arc_lengths
from hose_mj.hoses.mujoco.chain_holds import Load
from hose_mj.hoses.mujoco.model import MujocoModel
from hose_mj.hoses.protocol import Array, Energies, Momentum
from hose_mj.hoses.spec import HoseSpec


class MujocoQueries(ABC):
    """The queries of `HoseModel`, on a compiled model and the loads that act on it."""

    spec: HoseSpec
    _model: MujocoModel
    _loads: list[Load]

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return float(self.data.time)

    @property
    def model(self) -> mujoco.MjModel:
        """The mjModel; another one after each change of holds."""
        return self._model.model

    @property
    def data(self) -> mujoco.MjData:
        """The mjData; another one after each change of holds."""
        return self._model.data

    def position(self, arc_length: ArrayLike) -> Array:
        """Centre line, shape (k, 3), m: straight between the nodes."""
        return self._model.motion().position(self._arc_lengths(arc_length))

    def velocity(self, arc_length: ArrayLike) -> Array:
        """Velocity of the centre line, shape (k, 3), m/s."""
        return self._model.motion().velocity(self._arc_lengths(arc_length))

    def tangent(self, arc_length: ArrayLike) -> Array:
        """Unit tangent, shape (k, 3): the segment's, at a node the mean of its neighbours'."""
        return self._model.motion().tangent(self._arc_lengths(arc_length))

    def curvature(self, arc_length: ArrayLike) -> Array:
        """Bending per length at the nodes (k,), 1/m: straight lines between and beyond them."""
        return self._model.motion().curvature(self._arc_lengths(arc_length))

    def twist(self, arc_length: ArrayLike) -> Array:
        """Turn about the tangent per length (k,), rad/m; between and beyond the nodes as above."""
        return self._model.motion().twist(self._arc_lengths(arc_length))

    def tension(self, arc_length: ArrayLike) -> Array:
        """Axial force (k,), N, positive in tension; between where it is known as above."""
        s = self._arc_lengths(arc_length)
        self._model.update_forces(self._loads)
        return self._model.tension(s)

    def torque(self, arc_length: ArrayLike) -> Array:
        """Moment about the tangent at the nodes (k,), N m; between and beyond as above."""
        s = self._arc_lengths(arc_length)
        self._model.update_forces(self._loads)
        return self._model.torque(s)

    def energies(self) -> Energies:
        """Energies at the present state."""
        return self._model.energies()

    def momentum(self) -> Momentum:
        """Linear and angular momentum at the present state."""
        return self._model.momentum()

    def _arc_lengths(self, arc_length: ArrayLike) -> Array:
        return check_arc_lengths(arc_length, self.spec.length)
