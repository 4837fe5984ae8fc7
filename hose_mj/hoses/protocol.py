"""The protocol that every hose model follows, whether it owns its state or lives in an mjModel.

Arc lengths are rest arc lengths in [0, L] (m); positions, forces and moments are in the world
frame (m, N, N m). Every query takes a float or an array of arc lengths of shape (k,) and always
answers with a leading axis k.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hose_mj.errors import HoseWarning
from hose_mj.hoses.spec import HoseSpec

Array = NDArray[np.float64]
Curve = ArrayLike | Callable[[Array], ArrayLike]
"""Points along the hose from s = 0 to s = L, shape (k, 3), spaced as they like; or a function of
arc lengths (k,) that returns positions (k, 3), at whatever pace. The hose is laid along either at
an even pace."""


@dataclass(frozen=True)
class Hold:
    """A handle on one clamp or attachment.

    Attributes:
        number: counts up from 0 over the life of a hose; never used twice.
        arc_length: where along the hose (m).
        fixes_tangent: True for a clamp, False for an attachment.
    """

    number: int
    arc_length: float
    fixes_tangent: bool


@dataclass(frozen=True)
class Reaction:
    """What a hold does to the hose at the end of the last step: force (3,) N, moment (3,) N m."""

    force: Array
    moment: Array


@dataclass(frozen=True)
class Energies:
    """Energies of the whole hose (J); `gravitational` is zero at the world's origin."""

    kinetic: float
    stretching: float
    bending: float
    twisting: float
    gravitational: float

    @property
    def total(self) -> float:
        """Sum of all five (J)."""
        return self.kinetic + self.stretching + self.bending + self.twisting + self.gravitational


@dataclass(frozen=True)
class Momentum:
    """Linear (3,) kg m/s and angular (3,) kg m^2/s momentum about the world's origin."""

    linear: Array
    angular: Array


@dataclass(frozen=True)
class Equilibrium:
    """What `solve_static` has found.

    Attributes:
        is_stable: whether it comes back after any small disturbance; neutral counts as stable.
        is_folded: whether the hose is folded onto itself somewhere, |r'| near 0: no shape of a real
            hose.
        least_stretch: least |r'| along the hose; 1 where it is as long as at rest.
    """

    is_stable: bool
    is_folded: bool
    least_stretch: float

    def warn(self, stacklevel: int) -> None:
        """Says by a `HoseWarning` what is wrong with it, if anything."""
        if self.is_folded:
            text = (
                f"the equilibrium found is folded: |r'| falls to {self.least_stretch:.2g} (1 is as "
                "long as at rest); start from another shape, or divide the hose more finely"
            )
            warnings.warn(text, HoseWarning, stacklevel=stacklevel)
        elif not self.is_stable:
            text = (
                "the equilibrium found is unstable: a real hose leaves it at the slightest touch; "
                "start from a shape that is a little bent to find where it goes"
            )
            warnings.warn(text, HoseWarning, stacklevel=stacklevel)


def warn_of_lost_moment(moment: Array, tangent: Array, place: float, stacklevel: int) -> None:
    """Says by a `HoseWarning` what part of a point moment (3,) nothing carries, if it is one."""
    along = abs(float(moment @ tangent))
    if along > 1e-6 * float(np.linalg.norm(moment)):
        text = (
            f"a moment of {along:.3g} N m about the tangent at s = {place:g} m is lost: this hose "
            "has no twist, or no torsional stiffness"
        )
        warnings.warn(text, HoseWarning, stacklevel=stacklevel)


@dataclass(frozen=True)
class Linearization:
    """Small motions about the present state, in the model's own coordinates z (m of them).

    mass z'' + stiffness z = 0 on the null space of `constraints`, loads and gravity included in
    the stiffness. Shapes (m, m), (m, m), (c, m).
    """

    mass: Array
    stiffness: Array
    constraints: Array


@runtime_checkable
class HoseModel(Protocol):
    """One hose, its clock and what holds it."""

    spec: HoseSpec

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        ...

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        ...

    def reset(self, curve: Curve, velocity: Curve | None = None) -> None:
        """Lays the hose along a curve, at rest or with a velocity (m/s); drops holds and loads.

        Raises:
            InputError: a curve that is not finite, repeats a point or is far from the length.
        """
        ...

    def clamp(
        self,
        arc_length: float,
        position: ArrayLike | None = None,
        tangent: ArrayLike | None = None,
    ) -> Hold:
        """Holds a point, the tangent and the twist there; by default as they are now.

        The material keeps the angle about the tangent that it has, but for what the least rotation
        to another tangent carries along. Models without twist hold the tangent alone.
        """
        ...

    def attach(self, arc_length: float, position: ArrayLike | None = None) -> Hold:
        """Holds a point and leaves the tangent free; by default where it is now."""
        ...

    def move(
        self,
        hold: Hold,
        position: ArrayLike | None = None,
        tangent: ArrayLike | None = None,
        spin: float = 0.0,
    ) -> None:
        """Sets where a hold is to be at the end of the next step.

        A clamp's frame goes to a new tangent by the least rotation, and then turns about it by
        `spin` (rad, right-handed), which each call adds.

        Raises:
            InputError: a tangent or a spin for an attachment; a spin for a model without twist, or
                more of it in one step than the model can tell from a smaller one (a chain: pi).
        """
        ...

    def release(self, hold: Hold) -> None:
        """Lets go."""
        ...

    def reaction(self, hold: Hold) -> Reaction:
        """Force and moment of a hold on the hose at the end of the last step."""
        ...

    def apply_force(self, arc_length: float, force: ArrayLike) -> None:
        """Adds a point force (3,) N that acts until `clear_loads`."""
        ...

    def apply_moment(self, arc_length: float, moment: ArrayLike) -> None:
        """Adds a point moment (3,) N m until `clear_loads`; its part along the tangent twists.

        A model without twist, or a hose without torsional stiffness, says by a `HoseWarning` that
        this part is lost.
        """
        ...

    def clear_loads(self) -> None:
        """Drops all point forces and moments; gravity stays."""
        ...

    def step(self, n_steps: int = 1) -> None:
        """Advances the clock by n_steps time steps.

        Raises:
            StepError: a step that cannot be finished; the state before it is kept.
        """
        ...

    def follow(
        self,
        positions: Mapping[Hold, ArrayLike],
        tangents: Mapping[Hold, ArrayLike] | None = None,
    ) -> None:
        """Takes as many steps as paths have rows: `move` to row k and `step`, for each k.

        Args:
            positions: of holds at the end of each of n steps, (n, 3), m, world frame.
            tangents: of clamps, likewise.

        Raises:
            InputError: paths of unequal lengths, what is not finite, or what `move` refuses.
            StepError: as `step`; the steps before count.
        """
        ...

    def solve_static(self) -> Equilibrium:
        """Moves the hose to static equilibrium under its holds and loads, velocity zero.

        Returns whether it is stable, and whether it is folded; a `HoseWarning` says so if not.

        Raises:
            StepError: no equilibrium was found; the state before is kept.
        """
        ...

    def linearize(self) -> Linearization:
        """Mass, tangent stiffness and constraints at the present state."""
        ...

    def position(self, arc_length: ArrayLike) -> Array:
        """Centre line, shape (k, 3), m."""
        ...

    def velocity(self, arc_length: ArrayLike) -> Array:
        """Velocity of the centre line, shape (k, 3), m/s."""
        ...

    def tangent(self, arc_length: ArrayLike) -> Array:
        """Unit tangent, shape (k, 3)."""
        ...

    def frame(self, arc_length: ArrayLike) -> Array:
        """Rotation matrices (k, 3, 3) of the material: columns t, m1 and m2 = t x m1.

        The directors go with the material where clamps hold it; in a model without twist they are
        any across the tangent.
        """
        ...

    def tension(self, arc_length: ArrayLike) -> Array:
        """Axial force, positive in tension, shape (k,), N."""
        ...

    def curvature(self, arc_length: ArrayLike) -> Array:
        """Material curvature (rotation of the tangent per rest length), shape (k,), 1/m."""
        ...

    def twist(self, arc_length: ArrayLike) -> Array:
        """Turn of the material about the tangent per rest length (k,), rad/m.

        What bending carries along, the least rotation from tangent to tangent, does not count. Zero
        in a model without twist.
        """
        ...

    def torque(self, arc_length: ArrayLike) -> Array:
        """Moment of the part beyond s on the part before it, about the tangent (k,), N m."""
        ...

    def energies(self) -> Energies:
        """Energies at the present state."""
        ...

    def momentum(self) -> Momentum:
        """Linear and angular momentum at the present state."""
        ...

    def snapshot(self) -> dict[str, Any]:
        """What `restore` needs to continue bit by bit: arrays and plain numbers only."""
        ...

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot of this hose.

        Raises:
            InputError: what is no snapshot of this hose: keys, shapes, numbers that are not finite;
                nothing has changed then.
        """
        ...
