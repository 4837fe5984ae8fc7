"""MuJoCo's 1-D flex as a hose, its modulus chosen such that physical EI comes out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.hoses.mujoco.chain import check_plain
from hose_mj.hoses.mujoco.chain_holds import Held
from hose_mj.hoses.mujoco.flex_layout import FlexLayout
from hose_mj.hoses.mujoco.flex_model import FlexModel
from hose_mj.hoses.mujoco.flex_rod import FlexSettings
from hose_mj.hoses.mujoco.hose import MujocoHose
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec


class FlexHose(MujocoHose):
    """A `<flex dim="1">` with bending elasticity, under MuJoCo 3.17's integrator "discrete".

    Point masses joined by edges that keep their length, with MuJoCo's bending of discrete elastic
    rods between them, taken implicitly: large time steps are stable. There is no twist. Edges are
    soft constraints as all of MuJoCo's equalities are; `stretch` says by how much they give.
    Kelvin-Voigt damping is MuJoCo's own for flexes, and acts on bending. Not mapped: stretching
    stiffness (edges are as hard as their settings), torsional stiffness, drag, rest strain,
    curvature and torsion (the last four are errors unless 0). A hold has a vertex of its own, a
    clamp two; where a new one moves the vertices, the shape between them is cut off anew. In
    statics and in `linearize`, whose coordinates are the vertices, edges and holds are rigid.

    Args:
        spec: what the hose is made of.
        timestep: length of one step (s).
        gravity: (3,) m/s^2.
        segments: number of edges, at least 2; holds that are no vertex may change it by a few.
        clamp_correction: False for a clamp at an end that holds the first two vertices; True
            centres them on the end.
        iterations: most iterations of MuJoCo's constraint solver.
        tolerance: its termination tolerance.
        jacobian: dense, sparse or auto; sparse took a tenth less time for a held rod of 20 edges
            and two thirds less for one of 80.
        edge_solref: MuJoCo's solref of the edges; None for that of holds.
        edge_solimp: their solimp.
        hold_solref: solref of holds; None for twice the time step, critically damped.
        hold_solimp: their solimp.

    Raises:
        InputError: a value outside its valid set.
    """

    _model: FlexModel

    def __init__(
        self,
        spec: HoseSpec,
        *,
        timestep: float,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        segments: int = 40,
        clamp_correction: bool = False,
        iterations: int = 100,
        tolerance: float = 1e-8,
        jacobian: str = "sparse",
        edge_solref: Sequence[float] | None = None,
        edge_solimp: Sequence[float] = (0.9999, 0.9999, 0.001, 0.5, 2.0),
        hold_solref: Sequence[float] | None = None,
        hold_solimp: Sequence[float] = (0.9999, 0.9999, 0.001, 0.5, 2.0),
    ) -> None:
        check_plain(type(self).__name__, spec)
        self.settings = FlexSettings(
            timestep=timestep,
            gravity=gravity,
            segments=segments,
            integrator="discrete",
            clamp_correction=clamp_correction,
            iterations=iterations,
            tolerance=tolerance,
            jacobian=jacobian,
            hold_solref=hold_solref,
            hold_solimp=hold_solimp,
            edge_solref=edge_solref,
            edge_solimp=edge_solimp,
        )
        super().__init__(spec, np.array([1.0, 0.0, 0.0]))

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        return self.settings.timestep

    @property
    def layout(self) -> FlexLayout:
        """Arc lengths of the vertices; another one after each change of holds."""
        return self._model.layout

    def stretch(self) -> Array:
        """Strain of the edges (N,); 0 if MuJoCo's constraints were rigid."""
        return self._model.motion().stretch()

    def _make_model(self, held: Sequence[Held]) -> FlexModel:
        return FlexModel(self.spec, self.settings, held)
