"""`SplineBody`: the matter and the state of one hose, and all that can be asked of them.

It knows nothing of loads or time steps; `GedsHose` adds those.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds import basis, energy, frames, integrators, material_frames, mechanics
from hose_mj.hoses.geds.constraints import ConstraintSet
from hose_mj.hoses.geds.span import make_span
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.inputs import (
    check_arc_lengths,
    check_rows,
    check_vector,
    sample_curve,
    sample_velocity,
)
from hose_mj.hoses.laying import even_out
from hose_mj.hoses.protocol import Array, Curve, Energies, Momentum
from hose_mj.hoses.spec import HoseSpec

FOLDED = 0.1
"""|r'| below which a hose is folded onto itself: its energy is then no longer its own (span.py)."""
_PLACES_PER_SPAN = 16


class SplineBody:
    """A hose as control points, their velocities and what holds them.

    Args:
        spec: the hose.
        spline: its knots and its plane.
        gravity: (3,) m/s^2.
        frenet: whether theta is measured from the Frenet normal (frenet.py).

    Attributes:
        spec, gravity: as given.

    Raises:
        InputError: gravity out of the plane.
    """

    def __init__(
        self, spec: HoseSpec, spline: Spline, gravity: ArrayLike, frenet: bool = False
    ) -> None:
        self.spec = spec
        self.gravity = check_vector("gravity", gravity).copy()
        spline.check_in_plane("gravity", self.gravity, 0.0)
        self._spline = spline
        self._axes = spline.axes
        self._hose = mechanics.make_constants(spec, spline.knots, frenet)
        uniform = spline.from_world(np.tile(self.gravity, (spline.n_control_points, 1)))
        self._weight = self._multiply_mass(uniform)
        self._state = integrators.make_state(spline.size)
        self._constraints = ConstraintSet(spline, self._hose, self._state.x)
        self._span = make_span()
        self._strains = np.zeros((spline.n_control_points - 3, 2))

    @property
    def control_points(self) -> Array:
        """Control points (n, 3) in the world frame (m), a copy."""
        return self._spline.to_world(self._state.x) + self._spline.offset

    @property
    def control_velocities(self) -> Array:
        """Velocities of the control points (n, 3) in the world frame (m/s), a copy."""
        return self._spline.to_world(self._state.v)

    def position(self, arc_length: ArrayLike) -> Array:
        """Centre line, shape (k, 3), m, world frame (thesis A.2)."""
        return self._evaluate(arc_length, self._state.x) + self._spline.offset

    def velocity(self, arc_length: ArrayLike) -> Array:
        """Velocity of the centre line, shape (k, 3), m/s, world frame."""
        return self._evaluate(arc_length, self._state.v)

    def tangent(self, arc_length: ArrayLike) -> Array:
        """Unit tangent, shape (k, 3), world frame."""
        slope = self._evaluate(arc_length, self._state.x, 1)
        return np.asarray(slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12))

    def frame(self, arc_length: ArrayLike) -> Array:
        """Rotation matrices (k, 3, 3) of the material; columns: tangent, m1, m2 = t x m1.

        In space m1 goes with what clamps hold and with the twist between them. Where no clamp is, a
        hose without theta does not know how its material is turned: m1 is then any direction
        without twist. In a plane m1 is the plane's normal.

        Raises:
            InputError: places off the hose; a hose with twist="frenet".
        """
        s = check_arc_lengths(arc_length, self.spec.length)
        tangents, x, rows = self.tangent(s), self._state.x, self._constraints.rows
        if self._hose.elasticity.frenet:
            raise InputError("twist", "frenet", "scalar or theta for a hose asked for its frame")
        if self._spline.dimension == 2:
            directors = np.tile(self._spline.normal, (len(s), 1))
        elif self._spline.has_theta:
            directors = material_frames.interpolate_directors(
                self._spline, self._hose, rows.twist, s, x, tangents
            )
        else:
            place, director = self._constraints.find_director()
            directors = material_frames.transport_along(self._spline, x, place, director, s)
            angles = self._constraints.measure_turns(place, s)
            directors = material_frames.turn_about(tangents, directors, angles)
        return material_frames.make_matrices(tangents, directors)

    def tension(self, arc_length: ArrayLike) -> Array:
        """Axial force, shape (k,), N: linear between the means of the spans' middles."""
        s = check_arc_lengths(arc_length, self.spec.length)
        stiffness = self._hose.elasticity.axial_stiffness[:, None]
        forces = stiffness * self._measure_strains()
        return mechanics.interpolate_tension(forces, self.spec.length, s)

    def curvature(self, arc_length: ArrayLike) -> Array:
        """Material curvature |r' x r''| / |r'|^2, shape (k,), 1/m."""
        a = self._evaluate(arc_length, self._state.x, 1)
        b = self._evaluate(arc_length, self._state.x, 2)
        squares = np.maximum(np.sum(a * a, axis=1), 1e-12)
        return np.asarray(np.linalg.norm(np.cross(a, b), axis=1) / squares)

    def twist(self, arc_length: ArrayLike) -> Array:
        """Turn of the material about the tangent per rest length (k,), rad/m, beyond its rest.

        What remains of it when the hose is bent without being turned is zero (thesis A.9's
        twisting strain, without its Frenet frame).
        """
        s = check_arc_lengths(arc_length, self.spec.length)
        if self._spline.has_theta and not self._hose.elasticity.frenet:
            frames.move_frames(
                *(self._axes, self._hose.tables, self._constraints.rows.twist),
                *(self._state.x, self._span),
            )
        rows = self._constraints.rows
        twist = mechanics.compute_twist(self._spline, self._hose, rows.twist, s, self._state.x)
        if len(rows.twist.load_starts) > 0:
            applied = self._constraints.tabulate_applied()
            twist += applied.evaluate(s) / mechanics.get_torsional_stiffness(self._hose, s)
        return twist

    def torque(self, arc_length: ArrayLike) -> Array:
        """Moment about the tangent (k,), N m, positive where the far side turns right-handed."""
        s = check_arc_lengths(arc_length, self.spec.length)
        stiffness = mechanics.get_torsional_stiffness(self._hose, s)
        return np.asarray(stiffness * self.twist(s))

    def measure_least_stretch(self) -> float:
        """Least |r'| along the hose: 1 where it is as long as at rest, near 0 in a fold."""
        n_places = _PLACES_PER_SPAN * (self._spline.n_control_points - basis.DEGREE) + 1
        slopes = self._evaluate(np.linspace(0.0, self.spec.length, n_places), self._state.x, 1)
        return float(np.linalg.norm(slopes, axis=1).min())

    def weigh_spans(self) -> tuple[Array, Array, Array]:
        """What the control points count for where the spline's spans meet; constant.

        Returns:
            arc lengths (S + 1,), m; weights (S + 1, n) of the points there, and of dr/ds, 1/m.
        """
        at = np.linspace(0.0, self.spec.length, self._spline.n_control_points - basis.DEGREE + 1)
        values, slopes = (self._spline.compute_jacobian(at, k).T for k in (0, 1))
        return at, values, slopes

    def energies(self) -> Energies:
        """Energies at the present state (thesis A.10, A.15)."""
        hose, twist = self._hose, self._constraints.rows.twist
        stretching, bending, twisting = energy.compute_energy(
            *(self._axes, hose.tables, hose.elasticity, twist.frames),
            *(self._state.x, self._span, self._strains),
        )
        twisting += 0.5 * float(np.sum(twist.angle**2 / twist.compliance))
        if len(twist.load_starts) > 0:
            applied = self._constraints.tabulate_applied()
            twisting += applied.compute_energy(self._spline, hose)
        kinetic = 0.5 * float(self._state.v @ self._multiply_mass(self._state.v))
        # The offset of a planar hose is normal to gravity.
        gravitational = -float(self._state.x @ self._weight)
        return Energies(kinetic, float(stretching), float(bending), float(twisting), gravitational)

    def momentum(self) -> Momentum:
        """Linear and angular momentum about the world's origin, the sections' own spin included.

        Only a hose with theta has any: the scalar form of twist knows no inertia about the tangent.
        """
        momenta = self._spline.to_world(self._multiply_mass(self._state.v))
        angular = np.cross(self.control_points, momenta).sum(axis=0)
        if self._spline.has_theta and not self._hose.elasticity.frenet:
            places, masses = self._mass_points
            spin = self._spline.evaluate_theta(places, self._state.v)
            angular += (self._hose.gyration * masses * spin) @ self.tangent(places)
        return Momentum(momenta.sum(axis=0), angular)

    def attachment_jacobian(self, arc_lengths: ArrayLike) -> Array:
        """J_pr of thesis A.24: N_i at each of l arc lengths, shape (n, l)."""
        return self._spline.compute_jacobian(check_arc_lengths(arc_lengths, self.spec.length))

    @cached_property
    def _mass_points(self) -> tuple[Array, Array]:
        """Arc lengths (k,), m, and masses (k,), kg, of the mass matrix's Gauss points."""
        return mechanics.list_mass_points(self.spec, len(self._hose.tables.first))

    # -- inside ------------------------------------------------------------------------------------

    def _set_shape(self, curve: Curve, velocity: Curve | None) -> None:
        """Makes the state anew from a curve and a velocity; changes nothing if one is refused."""
        # Thesis A.3 samples uniformly; at 256 control points that is off by 40 L, this by 1e-13 L.
        arc_lengths = basis.make_greville(self._spline.knots)
        even = even_out(curve, self.spec.length)
        points = sample_curve(even, self.spec.length, arc_lengths)
        offset = self._spline.compute_offset(points)
        state = integrators.make_state(self._spline.size)
        state.x[:] = self._spline.interpolate(arc_lengths, points)
        if self._spline.has_theta:
            state.x[3::4] = self.spec.rest_torsion * arc_lengths
        if velocity is not None:
            speeds = sample_velocity(velocity, self.spec.length, arc_lengths)
            for speed in speeds:
                self._spline.check_in_plane("velocity", speed, 1e-9)
            state.v[:] = self._spline.interpolate(arc_lengths, speeds)
        self._spline.offset = offset
        self._set_state(state)

    def _measure_strains(self) -> Array:
        """Mean strain beyond the rest strain, and its linear mode, of each span, (S, 2)."""
        hose = self._hose
        energy.compute_strains(
            *(self._axes, hose.tables, hose.elasticity),
            *(self._state.x, self._span, self._strains),
        )
        return self._strains

    def _set_points(self, points: ArrayLike) -> None:
        """Makes the state anew from control points (n, 3), at rest."""
        wanted = check_rows("the control points", points, self._spline.n_control_points)
        self._spline.offset = self._spline.compute_offset(wanted)
        state = integrators.make_state(self._spline.size)
        state.x[:] = self._spline.from_world(wanted)
        self._set_state(state)

    def _set_state(self, state: integrators.State) -> None:
        """Takes over a state; the arrays stay those that contacts and coupling read."""
        for part, wanted in zip(self._state, state, strict=True):
            part[:] = wanted

    def _evaluate(self, arc_length: ArrayLike, flat: Array, derivative: int = 0) -> Array:
        s = check_arc_lengths(arc_length, self.spec.length)
        return self._spline.evaluate(s, flat, derivative)

    def _multiply_mass(self, flat: Array) -> Array:
        return mechanics.multiply_mass(self._axes, self._hose, flat)
