"""`ContactSet`: the obstacles of one hose and the contact law, as the kernels read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds import basis, contact, contact_law, shapes
from hose_mj.hoses.geds.capsules import Capsules
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.obstacles import MOST_POINTS, SINK, ContactLaw, Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec
from hose_mj.jit import run_kernel

_CODES = {
    "plane": shapes.PLANE,
    "sphere": shapes.SPHERE,
    "capsule": shapes.CAPSULE,
    "cylinder": shapes.CYLINDER,
    "box": shapes.BOX,
}
TIGHTER = 0.1
"""While something touches, Newton goes on until moves are below this part of the law's width, and
of the way that the slip speed goes in a step."""


class ContactSet:
    """What one hose may touch.

    Args:
        spline: the hose's geometry.
        spec: the hose.
        gravity: (3,) m/s^2, for the default stiffness.
        timestep: s, for the tolerance.

    Attributes:
        contact: what the kernels read; made anew by every change.
        obstacles: the shapes, in the order of their numbers.
        law: as given.
        arc_lengths: where contact is looked for, (Q,), m.
        order: the world axes in the order of the hose's coordinates.
    """

    def __init__(self, spline: Spline, spec: HoseSpec, gravity: Array, timestep: float) -> None:
        self._spline, self._spec, self._timestep = spline, spec, timestep
        self._pull = max(9.81, float(np.linalg.norm(gravity)))
        self._is_closed = False
        # The hose's coordinates first: a reflection where that is an odd permutation.
        rest = [c for c in range(3) if c not in spline.dims]
        self.order = [*spline.dims, *rest]
        self._parity = float(np.linalg.det(np.eye(3)[self.order]))
        self.set((), ContactLaw())

    def set(self, obstacles: Sequence[Obstacle], law: ContactLaw) -> None:
        """Replaces obstacles and law; drops distances handed in."""
        for obstacle in obstacles:
            if not isinstance(obstacle, Obstacle):
                raise InputError("obstacles", obstacle, "records of the class Obstacle")
        self.obstacles, self.law = tuple(obstacles), law
        self._given = np.zeros((0, contact_law.GIVEN))
        self._capsules = np.zeros((0, shapes.ROW))
        self._numbers = self._make_law()
        self.arc_lengths, self._points = self._make_points()
        self.rebuild()

    def move(self, number: int, changes: dict[str, Any]) -> None:
        """Replaces placement or velocities of one obstacle; None leaves a thing as it is."""
        check_count("obstacle", number, 0, len(self.obstacles) - 1)
        wanted = {name: value for name, value in changes.items() if value is not None}
        moved = replace(self.obstacles[number], **wanted)
        self.obstacles = (*self.obstacles[:number], moved, *self.obstacles[number + 1 :])
        self.contact.geoms[number] = self._make_row(moved)

    def set_distances(
        self,
        distances: ArrayLike,
        normals: ArrayLike,
        friction: ArrayLike,
        velocity: ArrayLike,
        x: Array,
    ) -> None:
        """Hands in the nearest surface at each contact point, see `Touching.set_distances`."""
        q = len(self.arc_lengths)
        given = np.zeros((q, contact_law.GIVEN))
        turned = np.asarray(normals, dtype=np.float64)
        speeds = np.asarray(velocity, dtype=np.float64)
        try:
            given[:, 0] = distances
            given[:, 1:4] = turned[..., self.order]
            given[:, 4] = friction
            given[:, 5:8] = speeds[..., self.order]
        except (TypeError, ValueError, IndexError):
            valid = f"distances ({q},), normals and velocities ({q}, 3), friction ({q},)"
            raise InputError("shapes of the distances", np.shape(distances), valid) from None
        if not np.all(np.isfinite(given)) or np.any(given[:, 4] < 0.0):
            raise InputError("distances", distances, "finite numbers, friction at or above 0")
        place = self._spline.evaluate(self.arc_lengths, x)
        given[:, 8:11] = place[:, self.order]
        self._given = given
        self.rebuild()

    def set_closed(self, is_closed: bool) -> None:
        """Says whether the hose is a closed loop, whose ends do not touch each other."""
        self._is_closed = is_closed
        self._numbers = self._make_law()
        self.rebuild()

    def drop_distances(self) -> None:
        """Forgets distances handed in."""
        self._given = np.zeros((0, contact_law.GIVEN))
        self.rebuild()

    def set_capsules(self, capsules: Capsules | None) -> None:
        """Replaces the capsules that stand for another hose; None for none."""
        order, offset = self.order, self._spline.offset
        if capsules is None:
            self._capsules = np.zeros((0, shapes.ROW))
        else:
            scale = capsules.stiffness / self._numbers[contact_law.STIFFNESS]
            self._capsules = capsules.make_rows(order, offset, scale)
        self.rebuild()

    def rebuild(self) -> None:
        """Makes what the kernels read; to be called where the plane of the hose has moved."""
        geoms = np.concatenate([self.make_shapes(self.obstacles), self._capsules])
        room = np.zeros((len(self._points) + self._spline.n_control_points - basis.DEGREE, 4))
        self.contact = contact_law.Contact(
            self._points, geoms, self._given, self._numbers, self.arc_lengths, room
        )

    def find_stiffness(self) -> float:
        """Stiffness of the law with its damping over a step, N/m^2."""
        damping = 2.0 * self._numbers[contact_law.DAMPING] / self._timestep
        return float(self._numbers[contact_law.STIFFNESS] * (1.0 + damping))

    def make_shapes(self, obstacles: Sequence[Obstacle]) -> Array:
        """Returns obstacles as kernels read them, rows of shapes.py, (G, ROW)."""
        rows = np.zeros((len(obstacles), shapes.ROW))
        for row, obstacle in zip(rows, obstacles, strict=True):
            row[:] = self._make_row(obstacle)
        return rows

    def measure(self, points: Array) -> Array:
        """Signed distances of points (k, 3), m, world frame, from the obstacles, (G, k), m."""
        local = np.ascontiguousarray((points - self._spline.offset)[:, self.order])
        found = np.zeros((len(self.obstacles), len(points)))
        normals = np.zeros_like(local)
        for g, row in enumerate(found):
            shapes.measure_points(self.contact.geoms, g, local, row, normals)
        return found

    def place(self, numbers: np.ndarray, positions: Array, rotations: Array, twists: Array) -> None:
        """Moves some obstacles (k,) at once, without checks; `obstacles` keeps what was set.

        Args:
            numbers: of the obstacles.
            positions: (k, 3), m.
            rotations: (k, 3, 3).
            twists: velocities and angular velocities, (k, 6), m/s, rad/s.
        """
        rows, order, k = self.contact.geoms, self.order, len(numbers)
        at = shapes.POSITION
        rows[numbers, at : at + 3] = (positions - self._spline.offset)[:, order]
        at = shapes.ROTATION
        rows[numbers, at : at + 9] = rotations[:, order].reshape(k, 9)
        at = shapes.VELOCITY
        rows[numbers, at : at + 3] = twists[:, order]
        at = shapes.SPIN
        rows[numbers, at : at + 3] = self._parity * twists[:, 3:][:, order]

    # -- forces ----------------------------------------------------------------------------------

    def compute_forces(self, x: Array, v: Array) -> tuple[Array, Array]:
        """Returns forces on the hose (Q, 3) and on the geoms (G, 6) in the hose's coordinates."""
        forces = np.zeros((len(self._points), 3))
        reactions = np.zeros((len(self.contact.geoms), 6))
        run_kernel(
            *(contact.compute_forces, self._spline.axes, self.contact, x, v, forces, reactions)
        )
        return forces, reactions

    def compute_world_forces(self, x: Array, v: Array) -> Array:
        """Returns the forces on the hose at the contact points (Q, 3), N, world frame."""
        return self._to_world(self.compute_forces(x, v)[0])

    def compute_given_forces(self, x: Array, v: Array) -> Array:
        """Returns the forces on the hose of the distances handed in (Q, 3), N, world frame."""
        forces = np.zeros((len(self._points), 3))
        alone = self.contact._replace(geoms=np.zeros((0, shapes.ROW)))
        run_kernel(
            *(contact.compute_forces, self._spline.axes, alone, x, v, forces, np.zeros((0, 6)))
        )
        return self._to_world(forces)

    def compute_reactions(self, x: Array, v: Array) -> Array:
        """Returns what the hose does to each obstacle, (G, 6): force (N), moment (N m) about it."""
        found = self.compute_forces(x, v)[1][: len(self.obstacles)]
        forces = self._to_world(found[:, :3])
        moments = self._parity * self._to_world(found[:, 3:])
        return np.concatenate([forces, moments], axis=1)

    def compute_capsule_forces(self, x: Array, v: Array) -> Array:
        """Returns what the hose does to the ends of the capsules, (m + 1, 3), N, world frame.

        A moment about a capsule's middle becomes a couple of forces at its ends; what lies along
        its axis is lost.
        """
        found = self.compute_forces(x, v)[1][len(self.obstacles) :]
        forces = self._to_world(found[:, :3])
        moments = self._parity * self._to_world(found[:, 3:])
        turned = self._capsules[:, shapes.ROTATION + 2 : shapes.ROTATION + 9 : 3]
        axes = self._to_world(turned) * (2.0 * self._capsules[:, [shapes.SIZE + 1]])
        couple = np.cross(moments, axes) / np.sum(axes**2, axis=1, keepdims=True)
        ends = np.zeros((len(found) + 1, 3))
        ends[:-1] += 0.5 * forces - couple
        ends[1:] += 0.5 * forces + couple
        return ends

    # -- state -----------------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """All of it as arrays, plain numbers and containers of them."""
        return {
            "obstacles": [
                {f.name: _copy(getattr(one, f.name)) for f in fields(one)} for one in self.obstacles
            ],
            "law": asdict(self.law),
            "given": self._given.copy(),
            "capsules": self._capsules.copy(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot."""
        self.set([Obstacle(**one) for one in state["obstacles"]], ContactLaw(**state["law"]))
        self._given = state["given"].copy()
        self._capsules = state["capsules"].copy()
        self.rebuild()

    # -- inside ----------------------------------------------------------------------------------

    def _make_law(self) -> Array:
        law, spec = self.law, self._spec
        weight = spec.linear_density * self._pull
        k = weight / (SINK * spec.outer_radius) if law.stiffness is None else law.stiffness
        width = weight / k if law.width is None else law.width
        damping = law.damping_time
        if damping is None:
            damping = 2.0 * np.sqrt(spec.linear_density / k)
        numbers = np.zeros(9)
        numbers[contact_law.ROUND] = self._spline.length if self._is_closed else np.inf
        numbers[contact_law.STIFFNESS] = k
        numbers[contact_law.WIDTH] = width
        numbers[contact_law.DAMPING] = damping
        numbers[contact_law.SLIP] = law.slip_speed
        numbers[contact_law.RADIUS] = spec.outer_radius
        numbers[contact_law.TOLERANCE] = TIGHTER * min(width, law.slip_speed * self._timestep)
        if law.self_contact:
            numbers[contact_law.SELF_STIFFNESS] = 2.0 * spec.linear_density / self._timestep**2
            numbers[contact_law.SELF_DAMPING] = 0.25 * self._timestep
        return numbers

    def _make_points(self) -> tuple[Array, Array]:
        """Gauss points of every span: arc lengths (Q,) and basis values with weights (Q, 5)."""
        n_spans = self._spline.n_control_points - basis.DEGREE
        span = self._spline.length / n_spans
        count = self.law.points_per_span
        if count is None:
            wanted = int(np.ceil(span / self._spec.outer_radius)) if self.law.self_contact else 0
            count = min(max(wanted, 3), MOST_POINTS)
        nodes, weights = np.polynomial.legendre.leggauss(count)
        at = ((np.arange(n_spans)[:, None] + 0.5 + 0.5 * nodes) * span).ravel()
        _, values = basis.compute_basis(self._spline.knots, at)
        share = np.tile(0.5 * span * weights, n_spans)
        return at, np.column_stack([values[:, 0], share])

    def _make_row(self, obstacle: Obstacle) -> Array:
        order, row = self.order, np.zeros(shapes.ROW)
        row[shapes.KIND] = _CODES[obstacle.kind]
        row[shapes.FRICTION] = obstacle.friction
        row[shapes.BOUND] = obstacle.find_bound()
        row[shapes.SIZE : shapes.SIZE + 3] = obstacle.size
        place = np.asarray(obstacle.position) - self._spline.offset
        row[shapes.POSITION : shapes.POSITION + 3] = place[order]
        row[shapes.ROTATION : shapes.ROTATION + 9] = np.asarray(obstacle.rotation)[order].ravel()
        row[shapes.VELOCITY : shapes.VELOCITY + 3] = np.asarray(obstacle.velocity)[order]
        spin = self._parity * np.asarray(obstacle.angular_velocity)[order]
        row[shapes.SPIN : shapes.SPIN + 3] = spin
        row[shapes.SCALE] = obstacle.stiffness_factor
        row[shapes.SKIP_FROM], row[shapes.SKIP_TO] = obstacle.skips
        return row

    def _to_world(self, rows: Array) -> Array:
        world = np.zeros_like(rows)
        world[:, self.order] = rows
        return world


def _copy(value: Any) -> Any:
    return value.copy() if isinstance(value, np.ndarray) else value
