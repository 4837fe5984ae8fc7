"""Obstacles that a hose may touch: MuJoCo's simple shapes, and the numbers of the contact law."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError, check_choice
from hose_mj.hoses.inputs import check_count, check_vector, read_numbers
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec, check_number

KINDS = {"plane": 0, "sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}
"""Shapes, and how many of the three sizes each reads; a plane is infinite."""
_ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Obstacle:
    """A rigid shape, placed as MuJoCo places a geom; everything in the world frame.

    Attributes:
        kind: plane (its z axis points out of the solid), sphere, capsule, cylinder (both along z)
            or box.
        position: of its centre (3,), m; a point of a plane.
        rotation: (3, 3), the columns are its axes; as geom_xmat.
        size: m: radius of a sphere; radius and half length of a capsule or cylinder; half lengths
            of a box. What a shape does not read may be left out.
        friction: Coulomb's coefficient against the hose.
        velocity: of its position (3,), m/s; friction follows the surface.
        angular_velocity: (3,), rad/s.
        skips: arc lengths between which the hose does not touch it, lowest first (m); by default
            none. The hose where a robot holds it does not touch that robot.
        stiffness_factor: of this contact over that of the law. Light bodies that move by what the
            hose did to them in the step before need less than 1.

    Raises:
        InputError: an unknown kind, a size that is missing or not above zero, a rotation that is
            not orthogonal and right-handed, or a number that is not finite.
    """

    kind: str
    position: ArrayLike = _ZERO
    rotation: ArrayLike = field(default_factory=lambda: np.eye(3))
    size: ArrayLike = ()
    friction: float = 0.5
    velocity: ArrayLike = _ZERO
    angular_velocity: ArrayLike = _ZERO
    skips: tuple[float, float] = (np.inf, -np.inf)
    stiffness_factor: float = 1.0

    def __post_init__(self) -> None:
        check_choice("kind of obstacle", self.kind, list(KINDS))
        friction = check_number("friction", self.friction, may_be_zero=True)
        object.__setattr__(self, "friction", friction)
        factor = check_number("stiffness_factor", self.stiffness_factor)
        object.__setattr__(self, "stiffness_factor", factor)
        ends = read_numbers("skips", self.skips, "two arc lengths (m)", np.inf)
        if ends.shape != (2,) or np.isnan(ends).any():
            raise InputError("skips", self.skips, "two arc lengths (m)")
        for name in ("position", "velocity", "angular_velocity"):
            object.__setattr__(self, name, _freeze(check_vector(name, getattr(self, name))))
        object.__setattr__(self, "rotation", _freeze(_check_rotation(self.rotation)))
        object.__setattr__(self, "size", _freeze(_check_size(self.kind, self.size)))

    def find_bound(self) -> float:
        """Radius of the ball about the position that holds the obstacle (m); inf for a plane."""
        radius, half, _ = np.asarray(self.size)
        if self.kind == "plane":
            return float(np.inf)
        if self.kind == "cylinder":
            return float(np.hypot(radius, half))
        return float(np.linalg.norm(self.size)) if self.kind == "box" else float(radius + half)


@dataclass(frozen=True, kw_only=True)
class ContactLaw:
    """How a hose and an obstacle push each other; None for a value chosen from the hose.

    With g the gap between the surfaces, w the width and k the stiffness, the normal force per
    length is 0 where g is above 0, k g^2 / (4 w) down to g = -2 w, and -k (g + w) below: its slope
    is continuous. The default law hardens from a tenth of the radius on. Friction holds what does
    not slide by a spring of `stick_stiffness` along the surface; from friction times the normal
    force on it slides, by Coulomb's law.

    Attributes:
        stiffness: k (N/m^2). By default that of the hose's own section, EA / (pi r^2).
        width: w (m); by default 0.02 of the radius.
        damping_time: the normal force grows by this times its slope times the closing speed (s),
            and never pulls; by default critical, 2 sqrt(linear density / k).
        stick_stiffness: kt (N/m^2); by default k / 10.
        points_per_span: contact is looked for at so many points in each span of the spline; None
            for as many as stand within a radius of each other.
        self_contact: whether the hose may touch itself, with a tenth of both stiffnesses.
        self_friction: Coulomb's coefficient of the hose on itself.
        friction_profile: stretches of the hose that rub otherwise, under a sleeve or greased: rest
            arc lengths from and to (m), and the factor on the coefficient of what they touch; 1
            elsewhere. Where stretches overlap the last one counts.
        slip_speed: of no effect since friction holds; goes on for one release.

    Raises:
        InputError: a value outside its range.
    """

    stiffness: float | None = None
    width: float | None = None
    damping_time: float | None = None
    stick_stiffness: float | None = None
    points_per_span: int | None = None
    self_contact: bool = False
    self_friction: float = 0.0
    friction_profile: tuple[tuple[float, float, float], ...] = ()
    slip_speed: float | None = None

    def __post_init__(self) -> None:
        for name in ("stiffness", "width", "stick_stiffness"):
            if getattr(self, name) is not None:
                check_number(f"contact {name}", getattr(self, name))
        if self.damping_time is not None:
            check_number("contact damping_time", self.damping_time, may_be_zero=True)
        check_number("self_friction", self.self_friction, may_be_zero=True)
        if self.slip_speed is not None:
            check_number("slip_speed", self.slip_speed)
            warnings.warn(
                "ContactLaw.slip_speed has no effect: friction holds; see stick_stiffness",
                DeprecationWarning,
                stacklevel=3,
            )
        if self.points_per_span is not None:
            check_count("points_per_span", self.points_per_span, 1, MOST_POINTS)
        profile = _check_profile(self.friction_profile)
        object.__setattr__(self, "friction_profile", profile)

    def find_friction_factors(self, arc_lengths: Array) -> Array:
        """Returns what the profile multiplies friction by at arc lengths (k,), m: (k,)."""
        factors = np.ones(len(arc_lengths))
        for begin, end, factor in self.friction_profile:
            factors[(begin <= arc_lengths) & (arc_lengths <= end)] = factor
        return factors

    def complete(self, spec: HoseSpec) -> ContactLaw:
        """Returns the law of a hose, with the numbers that were left to it."""
        k, width, damping = self.stiffness, self.width, self.damping_time
        if k is None:
            k = spec.axial_stiffness / (np.pi * spec.outer_radius**2)
        if width is None:
            width = _WIDTH * spec.outer_radius
        if damping is None:
            damping = 2.0 * np.sqrt(spec.linear_density / k)
        stick = _SOFTER * k if self.stick_stiffness is None else self.stick_stiffness
        full = replace(self, stiffness=k, width=width, damping_time=damping, slip_speed=None)
        return replace(full, stick_stiffness=stick)

    def find_gap(self, load: float) -> float:
        """The gap between the surfaces (m) at which a complete law carries a load (N/m).

        Of what its ramp carries: half of k times the width at most, far above a hose's weight.
        """
        assert self.stiffness is not None
        assert self.width is not None
        return -float(np.sqrt(4.0 * self.width * load / self.stiffness))


_WIDTH = 0.02
"""Of the radius: over twice this depth the default law stiffens. A tenth of it costs twice the
iterations."""
_SOFTER = 0.1
"""What sticks is softer along a surface than across it by this, by default: quieter at stops."""
MOST_POINTS = 1000
"""Contact points in a span at most."""


def _freeze(array: Array) -> Array:
    own = np.array(array, dtype=np.float64)
    own.flags.writeable = False
    return own


def _check_rotation(rotation: ArrayLike) -> Array:
    matrix = read_numbers("rotation", rotation, "an orthogonal, right-handed (3, 3) matrix")
    if matrix.shape == (9,):
        matrix = matrix.reshape(3, 3)
    right = matrix.shape == (3, 3) and bool(np.all(np.isfinite(matrix)))
    if not (
        right
        and np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6)
        and np.linalg.det(matrix) > 0.0
    ):
        raise InputError("rotation", rotation, "an orthogonal, right-handed (3, 3) matrix")
    return matrix


def _check_profile(profile: object) -> tuple[tuple[float, float, float], ...]:
    valid = "rows of from, to (m, 0 <= from < to) and a factor at or above 0"
    rows = read_numbers("friction_profile", profile, valid)
    if rows.size == 0:
        return ()
    is_right = rows.ndim == 2 and rows.shape[1] == 3 and np.isfinite(rows).all()
    if not is_right or (rows < 0.0).any() or (rows[:, 0] >= rows[:, 1]).any():
        raise InputError("friction_profile", profile, valid)
    return tuple((begin, end, factor) for begin, end, factor in rows.tolist())


def _check_size(kind: str, size: ArrayLike) -> Array:
    """Returns three sizes, those that the kind does not read set to 0."""
    count = KINDS[kind]
    valid = f"{count} finite numbers above 0 (m)"
    given = np.atleast_1d(read_numbers(f"size of a {kind}", size, valid))
    read = given[:count] if given.ndim == 1 else given[:0]
    if len(read) < count or not np.all((read > 0.0) & np.isfinite(read)):
        raise InputError(f"size of a {kind}", size, valid)
    return np.concatenate([given[:count], np.zeros(3 - count)])
