"""`Limits`: the numbers that a world's margins are measured against."""

from dataclasses import dataclass

from hose_mj.errors import InputError
from hose_mj.hoses.spec import HoseSpec, check_number

WEIGHTS = 2.0
"""A hose may always be pulled by so many times its own weight (`compute_tension_limit`)."""
TOUCHING = 0.1  # run-over distance by default, in radii of the hose
OWN_RADII = 3.0
"""Hose to either side of an attachment that is a robot's own by default, in its radii."""
SIGHT_RADII = 5.0  # how far distances are measured by default, in radii of the largest robot


@dataclass(frozen=True, kw_only=True)
class Limits:
    """When a constraint counts as broken.

    Attributes:
        max_tension: of a segment (N); None for the rule of `compute_tension_limit`.
        max_strain: what `compute_tension_limit` grants by the hose's axial stiffness.
        max_lengthening: a segment is also broken when it is longer than at rest by this fraction,
            whatever tension the model reports.
        own_arc: hose that never counts as run over, to either side of a robot's own attachment (m
            of arc); None for three times the robot's radius.
        run_over_distance: robot and hose count as met when their surfaces are nearer (m); None for
            a tenth of the hose's radius, because a hose that is pushed along may stay just clear.
        collision_distance, bounds_distance, obstacle_distance: the same for two robots, a robot's
            site and the edge, a robot and an obstacle (m).
        sight: farther than this (m) no distance between bodies is measured, and the margin is this
            less the clearance; None for five times the largest robot's radius.
        ground: names of geoms that robots may touch, beyond those they stand on.

    Raises:
        InputError: a value outside its range.
    """

    max_tension: float | None = None
    max_strain: float = 0.002
    max_lengthening: float = 0.1
    own_arc: float | None = None
    run_over_distance: float | None = None
    collision_distance: float = 0.0
    bounds_distance: float = 0.0
    obstacle_distance: float = 0.0
    sight: float | None = None
    ground: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("max_tension", "sight"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name))
        for name in ("own_arc", "run_over_distance"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), may_be_zero=True)
        for name in ("max_strain", "max_lengthening"):
            check_number(name, getattr(self, name))
        for name in ("collision_distance", "bounds_distance", "obstacle_distance"):
            check_number(name, getattr(self, name), may_be_zero=True)
        names = self.ground
        if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
            raise InputError("ground", names, "a tuple of names of geoms")

    def compute_tension_limit(self, spec: HoseSpec, gravity: float) -> float:
        """Returns the tension at which a segment breaks (N).

        `max_tension` where it is given. Otherwise the greater of `max_strain` EA and twice the
        weight of the whole hose, so that a soft hose may be dragged over a floor or hang.
        """
        if self.max_tension is not None:
            return self.max_tension
        weight = spec.linear_density * spec.length * gravity
        return max(self.max_strain * spec.axial_stiffness, WEIGHTS * weight)

    def compute_run_over_distance(self, radius: float) -> float:
        """Distance (m) at which a robot and a hose of a radius (m) count as met."""
        near = self.run_over_distance
        return TOUCHING * radius if near is None else near

    def compute_own_arc(self, radius: float) -> float:
        """Returns how much hose (m) beside the attachment of a robot of a radius (m) is its own."""
        return OWN_RADII * radius if self.own_arc is None else self.own_arc

    def compute_sight(self, radius: float) -> float:
        """Returns how far (m) distances are measured where `radius` (m) is the largest robot's."""
        return SIGHT_RADII * radius if self.sight is None else self.sight
