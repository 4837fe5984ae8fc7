"""`Touching`: what a hose may touch, and what it feels there; the part of `GedsHose` for users."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds.capsules import check_capsules
from hose_mj.hoses.geds.contacts import ContactSet
from hose_mj.hoses.geds.integrators import State
from hose_mj.hoses.geds.loads import LoadSet
from hose_mj.hoses.inputs import check_arc_lengths
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.protocol import Array, Reaction
from hose_mj.hoses.spec import HoseSpec


class Touching:
    """The part of a hose that knows obstacles; see contact.py for the forces.

    Attributes:
        scheme: the hose's integrator.
    """

    scheme: str
    spec: HoseSpec
    _contacts: ContactSet
    _loads: LoadSet
    _state: State

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What the hose may touch; their places here are the numbers that `move_obstacle` takes."""
        return self._contacts.obstacles

    @property
    def contact_arc_lengths(self) -> Array:
        """Where along the hose contact is looked for, (Q,), m."""
        return self._contacts.arc_lengths

    def set_obstacles(self, obstacles: Sequence[Obstacle], law: ContactLaw | None = None) -> None:
        """Replaces what the hose may touch; it stays through `reset`. An empty list costs nothing.

        Args:
            obstacles: rigid shapes.
            law: numbers of the contact law; None for the defaults.

        Raises:
            InputError: something that is not an obstacle; the explicit scheme, for which contact is
                too stiff.
        """
        self._check_implicit()
        self._contacts.set(obstacles, law or ContactLaw())
        self._loads.set_contact(self._contacts.contact)

    def add_floor(self, height: float = 0.0, friction: float = 0.5) -> int:
        """Adds a horizontal floor below the hose at z = height (m); returns its number."""
        floor = Obstacle(kind="plane", position=(0.0, 0.0, height), friction=friction)
        self.set_obstacles([*self.obstacles, floor], self._contacts.law)
        return len(self.obstacles) - 1

    def move_obstacle(
        self,
        number: int,
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
    ) -> None:
        """Sets where an obstacle is at the end of the next step, and how fast; see `Obstacle`.

        Only the velocities that are given rub: they are not derived from the places.

        Raises:
            InputError: a number that no obstacle has, a value outside its range.
        """
        changes = {"position": position, "rotation": rotation}
        changes |= {"velocity": velocity, "angular_velocity": angular_velocity}
        self._contacts.move(number, changes)

    def contact_stiffness(self) -> float:
        """What a contact's force per length grows by with the depth within one step, N/m^2.

        Its damping counts as what it adds to that in an implicit step.
        """
        return self._contacts.find_stiffness()

    def place_obstacles(
        self, numbers: np.ndarray, positions: Array, rotations: Array, twists: Array
    ) -> None:
        """Moves obstacles at once and unchecked, for worlds that do so every step.

        Args:
            numbers: of the obstacles, (k,).
            positions: of each at the end of the next step, (k, 3), m.
            rotations: (k, 3, 3).
            twists: velocity and angular velocity, (k, 6), m/s, rad/s.
        """
        self._contacts.place(numbers, positions, rotations, twists)

    def measure_obstacles(self, points: ArrayLike) -> Array:
        """Signed distances of points (k, 3), m, from each obstacle, (G, k), m.

        Raises:
            InputError: points that are not finite or of another shape.
        """
        places = np.asarray(points, dtype=np.float64)
        if places.ndim != 2 or places.shape[1] != 3 or not np.all(np.isfinite(places)):
            raise InputError("points", places.shape, "finite numbers, shape (k, 3)")
        return self._contacts.measure(places)

    def set_distances(
        self,
        distances: ArrayLike | None,
        normals: ArrayLike = (0.0, 0.0, 1.0),
        friction: ArrayLike = 0.5,
        velocities: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Hands in signed distances for the steps to come, for shapes that are no `Obstacle`.

        They are kept fixed until the next call: hand in fresh ones before each step.

        Args:
            distances: from the centre line at `contact_arc_lengths` to the surface, (Q,), m; above
                a radius for no contact. None for none.
            normals: outward unit normals there, (Q, 3) or one for all.
            friction: coefficients, (Q,) or one.
            velocities: of the surface, (Q, 3) or one, m/s.

        Raises:
            InputError: a wrong shape, a number that is not finite; the explicit scheme.
        """
        self._check_implicit()
        if distances is None:
            self._contacts.drop_distances()
        else:
            self._contacts.set_distances(distances, normals, friction, velocities, self._state.x)
        self._loads.set_contact(self._contacts.contact)

    def measured_forces(self) -> Array:
        """The part of `contact_forces` that comes from distances handed in, (Q, 3), N."""
        return self._contacts.compute_given_forces(self._state.x, self._state.v)

    def make_shapes(self, obstacles: Sequence[Obstacle]) -> Array:
        """Returns obstacles as kernels read them (geds/shapes.py), in the hose's coordinates."""
        return self._contacts.make_shapes(obstacles)

    def contact_forces(self) -> Array:
        """Contact forces on the hose at `contact_arc_lengths`, (Q, 3), N, world frame."""
        return self._contacts.compute_world_forces(self._state.x, self._state.v)

    def contact_reactions(self) -> list[Reaction]:
        """What the hose does to each obstacle: force (N), moment about its position (N m)."""
        return [Reaction(row[:3], row[3:]) for row in self.push_on_obstacles()]

    def push_on_obstacles(self) -> Array:
        """`contact_reactions` as one array (G, 6): forces, moments."""
        return self._contacts.compute_reactions(self._state.x, self._state.v)

    def set_neighbour(
        self,
        points: ArrayLike,
        velocities: ArrayLike,
        radius: float,
        friction: float,
        stiffness: float,
    ) -> None:
        """Hands in another hose as moving capsules, for the steps to come; see `HosePair`.

        Args:
            points: ends of the capsules (m + 1, 3), m.
            velocities: of these ends (m + 1, 3), m/s.
            radius: m.
            friction: Coulomb's coefficient.
            stiffness: of this contact (N/m^2); the rest of the law is the hose's.

        Raises:
            InputError: a wrong shape or a value outside its range; the explicit scheme.
        """
        self._check_implicit()
        made = check_capsules(points, velocities, radius, friction, stiffness)
        self._contacts.set_capsules(made)
        self._loads.set_contact(self._contacts.contact)

    def neighbour_forces(self) -> Array:
        """What the hose does to the ends of the neighbour's capsules, (m + 1, 3), N, world."""
        return self._contacts.compute_capsule_forces(self._state.x, self._state.v)

    def set_push(self, arc_lengths: ArrayLike, forces: ArrayLike) -> None:
        """Replaces the forces (k, 3), N, by which a neighbour pushes at arc lengths (k,), m.

        They act beside those of `apply_force` until the next call or a reset.
        """
        places = check_arc_lengths(arc_lengths, self.spec.length)
        vectors = np.asarray(forces, dtype=np.float64)
        if vectors.shape != (len(places), 3) or not np.all(np.isfinite(vectors)):
            raise InputError("forces", vectors.shape, f"finite numbers, shape ({len(places)}, 3)")
        self._loads.set_push(places, vectors)

    def _check_implicit(self) -> None:
        if self.scheme == "verlet":
            raise InputError("scheme", self.scheme, "an implicit scheme for a hose with obstacles")
