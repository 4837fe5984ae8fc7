"""`HosePair`: two hoses that touch each other, stepped in turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.geds import basis
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.obstacles import MOST_POINTS
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import check_number


class HosePair:
    """Two hoses and the contact between them.

    In each step the first hose meets the second as a row of moving capsules, frozen where they are
    at the step's beginning, implicitly; what it does to them then acts on the second hose through
    its step, as a dead load. Linear momentum is exact where both use the same scheme, were reset
    together and needed no fallback; angular momentum to first order in the step. Because the second
    hose's share is explicit the contact is soft: its stiffness is the lighter hose's density over
    dt^2. Hoses sink into each other by the load per length over that, and pass through each other
    when they meet faster than about a radius a step.

    The first hose's contact points come to stand half the lesser radius apart, unless its law says
    how many there are: hoses touch each other along less than a radius.

    Args:
        first, second: hoses in space with one time step.
        friction: Coulomb's coefficient between them.
        capsules: how many stand for the second hose; by default as many as keep a capsule no longer
            than two radii, at most 200. The cost of the first hose's step is linear in it.

    Raises:
        InputError: unequal time steps, planar hoses, values outside their range.
    """

    def __init__(
        self,
        first: GedsHose,
        second: GedsHose,
        *,
        friction: float = 0.0,
        capsules: int | None = None,
    ) -> None:
        check_number("friction", friction, may_be_zero=True)
        if first.timestep != second.timestep:
            raise InputError("timestep", second.timestep, f"that of the other, {first.timestep} s")
        if first is second:
            raise InputError("second", second, "another hose (self-contact is in ContactLaw)")
        if capsules is None:
            capsules = min(int(np.ceil(second.spec.length / (2.0 * second.spec.outer_radius))), 200)
        check_count("capsules", capsules, 1, 1000)
        _look_closer(first, min(first.spec.outer_radius, second.spec.outer_radius))
        self.first, self.second, self.friction = first, second, float(friction)
        self._places = np.linspace(0.0, second.spec.length, capsules + 1)
        density = min(first.spec.linear_density, second.spec.linear_density)
        self._stiffness = density / first.timestep**2

    def step(self, n_steps: int = 1) -> None:
        """Advances both hoses; raises what their `step` raises."""
        check_count("n_steps", n_steps, 0)
        for _ in range(n_steps):
            points = self.second.position(self._places)
            speeds = self.second.velocity(self._places)
            self.first.contacts.set_neighbour(
                points, speeds, self.second.spec.outer_radius, self.friction, self._stiffness
            )
            self.first.step()
            self.second.set_push(self._places, self.first.contacts.compute_neighbour_forces())
            self.second.step()

    @property
    def force(self) -> Array:
        """Force of the first hose on the second at the end of the last step (3,), N."""
        return np.asarray(self.first.contacts.compute_neighbour_forces().sum(axis=0))


def _look_closer(hose: GedsHose, radius: float) -> None:
    """Puts the contact points of a hose half a radius (m) apart, unless its law has a number."""
    contacts = hose.contacts
    if contacts.law.points_per_span is None:
        span = hose.spec.length / (len(hose.control_points) - basis.DEGREE)
        points = min(int(np.ceil(2.0 * span / radius)), MOST_POINTS)
        contacts.set_obstacles(contacts.obstacles, replace(contacts.law, points_per_span=points))
