"""`LoadSet`: gravity, fluid, point forces and point moments on a hose, as the kernels read them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.hoses.geds import records
from hose_mj.hoses.geds.contacts import ContactSet
from hose_mj.hoses.geds.fluid_load import FluidLoad
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.inputs import check_arc_lengths, check_rows, check_vector
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.snapshots import take_array, take_list


class LoadSet:
    """All loads of one hose; gravity and a fluid never leave.

    Args:
        spline: the hose's geometry.
        weight: generalised force of gravity and buoyancy on the control points, flat (n d,), N.
        contacts: what may be touched; kept.
        fluid: kept.
    """

    _loads: records.Loads

    def __init__(
        self, spline: Spline, weight: Array, contacts: ContactSet, fluid: FluidLoad
    ) -> None:
        self._spline = spline
        self._weight = weight
        self.contacts = contacts
        self.fluid = fluid
        self._held = np.zeros_like(weight)
        self.clear()

    @property
    def loads(self) -> records.Loads:
        """What the kernels read; made anew by every change."""
        if self._loads.contact is not self.contacts.contact:
            self._loads = self._loads._replace(contact=self.contacts.contact)
        return self._loads

    def clear(self) -> None:
        """Drops all point forces and moments, those of a neighbour too."""
        self._forces: list[tuple[float, Array]] = []
        self._moments: list[tuple[float, Array]] = []
        self._push = np.zeros_like(self._weight)
        self._rebuild()

    def set_push(self, arc_lengths: ArrayLike, forces: ArrayLike) -> None:
        """Replaces the forces (k, 3) of a neighbour at arc lengths (k,); see `GedsHose.set_push`.

        Raises:
            InputError: places off the hose, forces that are not finite or of another shape.
        """
        places = check_arc_lengths(arc_lengths, self._spline.length)
        vectors = check_rows("forces", forces, len(places))
        self._push = self._spline.from_world(self._spline.compute_jacobian(places) @ vectors)
        self._rebuild()

    def hold_drag(self, force: Array) -> None:
        """Sets the drag (n d,), N, that statics take for a dead load; zero outside them."""
        self._held = force
        self._rebuild()

    def add_force(self, arc_length: float, force: ArrayLike) -> None:
        """Adds a point force (3,) N, world frame: f N_i(s) on control point i (thesis A.27).

        Raises:
            InputError: a place off the hose, a vector that is not finite or leaves its plane.
        """
        place = self._spline.check_place(arc_length)
        vector = check_vector("force", force).copy()
        self._spline.check_in_plane("force", vector, 0.0)
        self._forces.append((place, vector))
        self._rebuild()

    def add_moment(self, arc_length: float, moment: ArrayLike) -> None:
        """Adds a point moment (3,) N m, world frame.

        What lies along the tangent acts on theta where there is one; in the scalar form of twist
        `ConstraintSet.set_moments` sees to it.

        Raises:
            InputError: a place off the hose, a vector that is not finite, or one that would turn a
                planar hose out of its plane.
        """
        place = self._spline.check_place(arc_length)
        vector = check_vector("moment", moment).copy()
        self._spline.check_along_normal("moment", vector)
        self._moments.append((place, vector))
        self._rebuild()

    def list_moments(self) -> list[tuple[float, Array]]:
        """Returns all point moments (3,), N m, with the arc length of each."""
        return list(self._moments)

    def snapshot(self) -> dict[str, Any]:
        """All point forces and moments as (arc length, vector) pairs."""
        return {
            "forces": [(place, vector.copy()) for place, vector in self._forces],
            "moments": [(place, vector.copy()) for place, vector in self._moments],
            "push": self._push.copy(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot; raises `InputError` for what is none."""
        self._forces = self._read_loads(state, "forces")
        self._moments = self._read_loads(state, "moments")
        self._push = take_array(state, "push", self._weight.shape)
        self._rebuild()

    def _read_loads(self, state: dict[str, Any], key: str) -> list[tuple[float, Array]]:
        loads = []
        for place, vector in take_list(state, key):
            at = self._spline.check_place(place)
            loads.append((at, check_vector(key, vector).copy()))
        return loads

    def _rebuild(self) -> None:
        d, n_dof = self._spline.dimension, self._spline.n_dof
        force = self._weight + self._push + self._held
        for place, vector in self._forces:
            starts, values = self._spline.compute_basis(np.array([place]))
            window = force[starts[0] : starts[0] + 4 * n_dof].reshape(4, n_dof)
            window[:, :d] += np.outer(values[0, 0], vector[self._spline.dims])
        places = np.array([place for place, _ in self._moments])
        starts, values = self._spline.compute_basis(places)
        moments = np.zeros((len(places), 3))
        for k, (_, vector) in enumerate(self._moments):
            if d == 3:
                moments[k] = vector
            else:
                moments[k, 0] = vector @ self._spline.normal
        values = np.ascontiguousarray(values[:, :2])
        acting = self.contacts.contact, self.fluid.morison
        self._loads = records.Loads(force, starts, values, moments, *acting)
