"""A hose that is a chain of rigid segments inside an mjModel of its own.

`CableHose` and `HingeChainHose` say what the joints are.
"""

from __future__ import annotations

from collections.abc import Sequence

from hose_mj.errors import InputError
from hose_mj.hoses.mujoco.chain_holds import Held
from hose_mj.hoses.mujoco.chain_kind import ChainKind
from hose_mj.hoses.mujoco.chain_layout import ChainLayout, rotation_matrix
from hose_mj.hoses.mujoco.chain_model import ChainModel
from hose_mj.hoses.mujoco.chain_settings import ChainSettings
from hose_mj.hoses.mujoco.hose import MujocoHose
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec


class MujocoChainHose(MujocoHose):
    """The `HoseModel` protocol for a chain of rigid segments; inextensible, axial_stiffness unused.

    A clamp holds a whole segment, see `ChainLayout`: at s = 0 the first one becomes part of the
    world until the clamp is moved, elsewhere a weld holds it. One segment carries one hold. Moving
    holds follow within some 1e-4 of the way per step for a hose with little damping. All of
    MuJoCo's integrators but "discrete" leave implicit damping out of their constraint forces, so
    where timestep times joint damping exceeds a segment's moment of inertia clamps turn late.

    Static holds are exact. Unstable equilibria are left, but not by a shape exactly in one, and not
    where a moment acts. `linearize` has the first node and the rotation vectors of the segments, in
    the world frame, without those of a first segment that is part of the world.

    Attributes:
        settings: numerics.
        segments: number of rigid segments.
        layout: arc lengths of the nodes; another one after each change of holds.
    """

    _model: ChainModel

    def __init__(self, spec: HoseSpec, kind: ChainKind, settings: ChainSettings) -> None:
        check_plain(type(self).__name__, spec)
        self.settings, self._kind = settings, kind
        super().__init__(spec, rotation_matrix(kind.base_frame)[:, 0])

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        return self.settings.timestep

    @property
    def segments(self) -> int:
        """Number of rigid segments."""
        return self.settings.segments

    @property
    def layout(self) -> ChainLayout:
        """Arc lengths of the nodes; another one after each change of holds."""
        return self._model.layout

    @property
    def twists(self) -> bool:
        """Whether the joints let segments turn about their tangents."""
        return self._kind.twists

    def _make_model(self, held: Sequence[Held]) -> ChainModel:
        return ChainModel(self._kind, self.spec, self.settings, held)

    def _check_points(self, name: str, points: Array) -> Array:
        self._kind.check_points(name, points)
        return points

    def _check_direction(self, tangent: Array) -> Array:
        self._kind.check_tangent(tangent)
        return tangent

    def _is_root(self, arc_length: float) -> bool:
        return arc_length == 0.0

    def solve_static(self) -> None:
        """Moves the hose to static equilibrium; see `MujocoHose.solve_static`.

        Raises:
            InputError: a chain with obstacles, which must come to rest by itself.
            StepError: no equilibrium was found; the state before is kept.
        """
        if self.settings.obstacles:
            raise InputError("obstacles", len(self.settings.obstacles), "none in a chain's statics")
        super().solve_static()


def check_plain(name: str, spec: HoseSpec) -> None:
    """Raises `InputError` for what no hose inside an mjModel has, `name` being its class."""
    for what in ("rest_strain", "rest_curvature", "rest_torsion", "drag"):
        if getattr(spec, what) != 0.0:
            raise InputError(what, getattr(spec, what), f"0 for a {name}")
    if spec.fittings or not spec.is_isotropic:
        what = "fittings" if spec.fittings else "second_bending_stiffness"
        raise InputError(what, getattr(spec, what), f"none for a {name}")
