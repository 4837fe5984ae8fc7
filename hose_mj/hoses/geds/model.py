"""`GedsHose`: the spline hose behind the HoseModel protocol; a thin class over the kernels."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.geds import basis, schemes, solver
from hose_mj.hoses.geds.compiled import compile_notice
from hose_mj.hoses.geds.energy import Elasticity, assemble, compute_energy, compute_strains
from hose_mj.hoses.model import (
    Array,
    Curve,
    Energies,
    Hold,
    Linearization,
    Momentum,
    Reaction,
    check_arc_lengths,
    check_vector,
    sample_curve,
)
from hose_mj.hoses.spec import HoseSpec, check_number

PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
FEWEST_CONTROL_POINTS = 5
MOST_CONTROL_POINTS = 4096
"""Sanity bound of the constructor; cost is linear, so nothing breaks above it but patience."""


@dataclass
class _Held:
    """One hold: where it is wanted at the beginning and at the end of the next step."""

    hold: Hold
    position: Array
    tangent: Array | None


class GedsHose:
    """Geometrically Exact Dynamic Splines (thesis appendix A) with an implicit integrator.

    Args:
        spec: the hose.
        timestep: length of a step (s).
        gravity: (3,) m/s^2.
        control_points: n; the cost of a step is linear in it.
        plane: None for space; "xy", "xz" or "yz" for a hose that stays in that plane, at a fraction
            of the cost.
        scheme: "bdf2" (default), "backward-euler", "sdirk2", "midpoint" or "verlet".
        tolerance: Newton goes on while it moves a control point by more than this fraction of L.
        max_iterations: Newton iterations in a stage before the careful fallback.

    Attributes:
        fallbacks: how often a solve needed the Gauss-Newton matrix or the careful iteration.
        iterations: Newton iterations so far.

    Raises:
        InputError: a value outside its valid set, named.
    """

    def __init__(
        self,
        spec: HoseSpec,
        *,
        timestep: float = 0.005,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        control_points: int = 16,
        plane: str | None = None,
        scheme: str = "bdf2",
        tolerance: float = 1e-3,
        max_iterations: int = 20,
    ) -> None:
        check_number("timestep", timestep)
        check_number("tolerance", tolerance)
        if scheme not in schemes.SCHEMES:
            raise InputError("scheme", scheme, ", ".join(schemes.SCHEMES))
        if plane is not None and plane not in PLANES:
            raise InputError("plane", plane, f"None, {', '.join(PLANES)}")
        n = control_points
        if not isinstance(n, int) or not FEWEST_CONTROL_POINTS <= n <= MOST_CONTROL_POINTS:
            raise InputError(
                "control_points", n, f"a whole number, {FEWEST_CONTROL_POINTS} to {MOST_CONTROL_POINTS}"
            )
        if not isinstance(max_iterations, int) or max_iterations < 1:
            raise InputError("max_iterations", max_iterations, "a whole number above 0")
        if plane is None and spec.rest_curvature != 0.0:
            raise InputError(
                "rest_curvature",
                spec.rest_curvature,
                "0 for a hose in space (a signed rest curvature needs plane='xy', 'xz' or 'yz')",
            )
        if scheme == "verlet" and (spec.damping_time > 0.0 or spec.drag > 0.0):
            raise InputError("scheme", scheme, "an implicit scheme for a hose with damping or drag")
        self.spec = spec
        self.gravity = check_vector("gravity", gravity)
        self.scheme = scheme
        self.fallbacks = 0
        self.iterations = 0
        self._timestep = float(timestep)
        self._dims = PLANES[plane] if plane else (0, 1, 2)
        self._axes = (0.0,) * len(self._dims)
        self._check_in_plane("gravity", self.gravity, 0.0)
        self._n = n
        self._knots = basis.make_knots(n, spec.length)
        with compile_notice("GEDS kernels"):
            tables = basis.make_tables(self._knots)
        n_spans = n - basis.DEGREE
        self._hose = solver.Hose(
            tables,
            Elasticity(
                np.full(n_spans, spec.axial_stiffness),
                np.full((n_spans, 3), spec.bending_stiffness),
                np.full(n_spans, spec.rest_strain),
                np.full((n_spans, 3), spec.rest_curvature),
                float(spec.damping_time),
            ),
            basis.make_mass(self._knots, spec.linear_density),
            spec.drag / spec.linear_density,
        )
        self._limits = solver.Limits(tolerance * spec.length, max_iterations, np.inf, 0.0)
        self._strains = np.zeros((n_spans, 2))
        self.reset(lambda s: np.outer(s, np.eye(3)[self._dims[0]]))

    # -- state -----------------------------------------------------------------------------------

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        return self._timestep

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return self._steps * self._timestep

    @property
    def control_points(self) -> Array:
        """Control points (n, 3) in the world frame (m), a copy."""
        return self._to_world(self._state.x, self._offset)

    def reset(self, curve: Curve, velocity: Curve | None = None) -> None:
        """Lays the hose along a curve (thesis A.3), at rest or with a velocity; drops holds and loads."""
        arc_lengths = np.linspace(0.0, self.spec.length, self._n)
        points = sample_curve(curve, self.spec.length, arc_lengths)
        out = [c for c in range(3) if c not in self._dims]
        offset = np.zeros(3)
        offset[out] = points[0, out]
        for point in points:
            self._check_in_plane("curve", point - offset, 1e-9 * self.spec.length)
        state = schemes.make_state(self._n * len(self._dims))
        state.x[:] = basis.interpolate(self._knots, arc_lengths, points[:, self._dims]).ravel()
        if velocity is not None:
            values = velocity(arc_lengths) if callable(velocity) else velocity
            speeds = np.broadcast_to(np.asarray(values, dtype=np.float64), (self._n, 3))
            if not np.all(np.isfinite(speeds)):
                raise InputError("velocity", velocity, "finite numbers (m/s), shape (3,) or (n, 3)")
            state.v[:] = basis.interpolate(self._knots, arc_lengths, speeds[:, self._dims]).ravel()
        self._state, self._offset = state, offset
        self._steps = 0
        self._held: list[_Held] = []
        self._n_holds = 0
        self._forces: list[tuple[float, Array]] = []
        self._moments: list[tuple[float, Array]] = []
        self._rebuild_holds()
        self._rebuild_loads()

    def snapshot(self) -> dict[str, Any]:
        """All that `restore` needs to continue bit by bit."""
        return {
            "state": schemes.State(*(part.copy() for part in self._state)),
            "offset": self._offset.copy(),
            "steps": self._steps,
            "held": copy.deepcopy(self._held),
            "n_holds": self._n_holds,
            "before": self._holds.before.copy(),
            "multipliers": self._holds.multipliers.copy(),
            "forces": copy.deepcopy(self._forces),
            "moments": copy.deepcopy(self._moments),
            "counts": (self.iterations, self.fallbacks),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Returns to a snapshot of this hose."""
        self._state = schemes.State(*(part.copy() for part in state["state"]))
        self._offset = state["offset"].copy()
        self._steps = state["steps"]
        self._held = copy.deepcopy(state["held"])
        self._n_holds = state["n_holds"]
        self._forces = copy.deepcopy(state["forces"])
        self._moments = copy.deepcopy(state["moments"])
        self.iterations, self.fallbacks = state["counts"]
        self._rebuild_holds()
        self._rebuild_loads()
        self._holds.before[:] = state["before"]
        self._holds.multipliers[:] = state["multipliers"]

    # -- holds and loads ---------------------------------------------------------------------------

    def clamp(
        self,
        arc_length: float,
        position: ArrayLike | None = None,
        tangent: ArrayLike | None = None,
    ) -> Hold:
        """Holds a point and the direction of the tangent there; by default where they are now."""
        aim = self.tangent(arc_length)[0] if tangent is None else _check_direction(tangent)
        self._check_in_plane("tangent", aim, 1e-9)
        return self._add_hold(arc_length, position, aim)

    def attach(self, arc_length: float, position: ArrayLike | None = None) -> Hold:
        """Holds a point and leaves the tangent free; by default where it is now."""
        return self._add_hold(arc_length, position, None)

    def move(
        self, hold: Hold, position: ArrayLike | None = None, tangent: ArrayLike | None = None
    ) -> None:
        """Sets where a hold is to be at the end of the next step."""
        held = self._find(hold)
        if position is not None:
            held.position = self._check_position(position)
        if tangent is not None:
            if not hold.fixes_tangent:
                raise InputError("tangent", tangent, "None for an attachment (use clamp)")
            held.tangent = _check_direction(tangent)
            self._check_in_plane("tangent", held.tangent, 1e-9)
        before, multipliers = self._holds.before.copy(), self._holds.multipliers.copy()
        self._rebuild_holds()
        self._holds.before[:] = before
        self._holds.multipliers[:] = multipliers

    def release(self, hold: Hold) -> None:
        """Lets go."""
        self._held.remove(self._find(hold))
        self._rebuild_holds()

    def reaction(self, hold: Hold) -> Reaction:
        """Force and moment of a hold on the hose at the end of the last step."""
        d = len(self._dims)
        held = self._find(hold)
        first = 0
        for other in self._held:
            if other is held:
                break
            first += self._n_rows(other)
        multipliers = self._holds.multipliers[first : first + self._n_rows(held)]
        force = np.zeros(3)
        force[list(self._dims)] = multipliers[:d]
        moment = np.zeros(3)
        if held.tangent is not None:
            directions = self._across(held.tangent)
            slope = self._evaluate(np.array([hold.arc_length]), 1, self._state.x)[0]
            moment = np.cross(slope, multipliers[d:] @ directions)
        return Reaction(force, moment)

    def apply_force(self, arc_length: float, force: ArrayLike) -> None:
        """Adds a point force (3,) N that acts until `clear_loads` (thesis A.27)."""
        s = float(check_arc_lengths(arc_length, self.spec.length)[0])
        vector = check_vector("force", force)
        self._check_in_plane("force", vector, 0.0)
        self._forces.append((s, vector))
        self._rebuild_loads()

    def apply_moment(self, arc_length: float, moment: ArrayLike) -> None:
        """Adds a point moment (3,) N m until `clear_loads`; what lies along the tangent is lost."""
        s = float(check_arc_lengths(arc_length, self.spec.length)[0])
        vector = check_vector("moment", moment)
        if len(self._dims) == 2:
            normal = self._normal()
            if np.linalg.norm(vector - (vector @ normal) * normal) > 0.0:
                raise InputError("moment", moment, f"a vector along the plane's normal {normal.tolist()}")
        self._moments.append((s, vector))
        self._rebuild_loads()

    def clear_loads(self) -> None:
        """Drops all point forces and moments; gravity stays."""
        self._forces.clear()
        self._moments.clear()
        self._rebuild_loads()

    # -- motion ------------------------------------------------------------------------------------

    def step(self, n_steps: int = 1) -> None:
        """Advances the clock by n_steps steps; a StepError keeps the last step that worked."""
        count = schemes.Count(*(np.zeros(1, dtype=np.int64) for _ in range(3)))
        with compile_notice("GEDS kernels"):
            verdict = schemes.advance(
                self._axes,
                self._hose,
                self._holds,
                self._loads,
                self._limits,
                schemes.SCHEMES[self.scheme],
                self._timestep,
                n_steps,
                self._state,
                self._work,
                count,
            )
        self._steps += int(count.steps[0])
        self.iterations += int(count.iterations[0])
        self.fallbacks += int(count.fallbacks[0])
        if verdict != solver.DONE:
            raise StepError(
                f"the step at t = {self.time:.6g} s failed: {solver.VERDICTS[verdict]}; "
                f"try a time step below {self._timestep:g} s or check holds and loads"
            )

    def solve_static(self, load_steps: int = 1) -> None:
        """Moves the hose to static equilibrium under its holds and loads; velocity becomes zero.

        Newton's iteration, capped by the turn of the tangents; loads grow in `load_steps` steps, in
        two, four, ... times as many if that fails.
        """
        limits = solver.Limits(1e-10 * self.spec.length, 400, 0.5, 1.0)
        stage = (np.inf, self._state.x.copy(), np.zeros_like(self._state.x))
        verdict = solver.NOT_CONVERGED
        while verdict != solver.DONE and load_steps <= 64:
            x = self._state.x.copy()
            for scale in np.linspace(0.0, 1.0, load_steps + 1)[1:]:
                with compile_notice("GEDS kernels"):
                    verdict, iterations, fallbacks = solver.newton(
                        self._axes,
                        self._hose,
                        stage,
                        self._holds,
                        1.0,
                        self._loads,
                        scale,
                        limits,
                        x,
                        self._work,
                    )
                self.iterations += iterations
                self.fallbacks += fallbacks
                if verdict != solver.DONE:
                    break
            load_steps *= 2
        if verdict != solver.DONE:
            raise StepError(f"no static equilibrium was found: {solver.VERDICTS[verdict]}")
        state = schemes.make_state(len(x))
        state.x[:] = x
        self._state = state
        self._holds.multipliers[:] = self._work.multipliers
        self._holds.before[:] = self._holds.after

    def linearize(self) -> Linearization:
        """Mass, tangent stiffness and hold rows in the control points' own coordinates (n d of them)."""
        size = len(self._state.x)
        self._build_band(moments=True)
        stiffness = _to_dense(self._work.band, size, 4 * len(self._dims))
        self._work.band[:] = 0.0
        solver.add_mass(self._axes, self._hose.mass, 1.0, self._work.band)
        mass = _to_dense(self._work.band, size, 4 * len(self._dims))
        constraints = np.zeros((len(self._holds.start), size))
        for row, start in enumerate(self._holds.start):
            constraints[row, start : start + 4 * len(self._dims)] = self._holds.rows[row]
        return Linearization(mass, stiffness, constraints)

    # -- queries -----------------------------------------------------------------------------------

    def position(self, arc_length: ArrayLike) -> Array:
        """Centre line, shape (k, 3), m (thesis A.2)."""
        s = check_arc_lengths(arc_length, self.spec.length)
        return self._evaluate(s, 0, self._state.x) + self._offset

    def velocity(self, arc_length: ArrayLike) -> Array:
        """Velocity of the centre line, shape (k, 3), m/s."""
        s = check_arc_lengths(arc_length, self.spec.length)
        return self._evaluate(s, 0, self._state.v)

    def tangent(self, arc_length: ArrayLike) -> Array:
        """Unit tangent, shape (k, 3)."""
        slope = self._evaluate(check_arc_lengths(arc_length, self.spec.length), 1, self._state.x)
        return slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)

    def tension(self, arc_length: ArrayLike) -> Array:
        """Axial force, shape (k,), N: linear between the means of the spans' middles."""
        s = check_arc_lengths(arc_length, self.spec.length)
        compute_strains(
            self._axes, self._hose.tables, self._hose.elasticity, self._state.x, self._strains
        )
        mean, linear = self._strains.T * self.spec.axial_stiffness
        h = self._hose.tables.span_length
        middles = (np.arange(len(mean)) + 0.5) * h
        # The end spans know their own slope: sqrt(3) xi times the linear mode, xi = -1 .. 1.
        nodes = np.concatenate([[0.0], middles, [self.spec.length]])
        ends = mean[0] - np.sqrt(3.0) * linear[0], mean[-1] + np.sqrt(3.0) * linear[-1]
        return np.interp(s, nodes, np.concatenate([[ends[0]], mean, [ends[1]]]))

    def curvature(self, arc_length: ArrayLike) -> Array:
        """Material curvature |r' x r''| / |r'|^2, shape (k,), 1/m."""
        s = check_arc_lengths(arc_length, self.spec.length)
        a = self._evaluate(s, 1, self._state.x)
        b = self._evaluate(s, 2, self._state.x)
        return np.linalg.norm(np.cross(a, b), axis=1) / np.maximum(np.sum(a * a, axis=1), 1e-12)

    def energies(self) -> Energies:
        """Energies at the present state (thesis A.10, A.15)."""
        stretching, bending = compute_energy(
            self._axes, self._hose.tables, self._hose.elasticity, self._state.x, self._strains
        )
        kinetic = 0.5 * float(self._state.v @ self._multiply_mass(self._state.v))
        gravitational = -float(self._state.x @ self._gravity_force())
        gravitational -= self.spec.mass * float(self._offset @ self.gravity)
        return Energies(kinetic, float(stretching), float(bending), 0.0, gravitational)

    def momentum(self) -> Momentum:
        """Linear and angular momentum about the world's origin."""
        momenta = self._to_world(self._multiply_mass(self._state.v), np.zeros(3))
        angular = np.cross(self.control_points, momenta).sum(axis=0)
        return Momentum(momenta.sum(axis=0), angular)

    def attachment_jacobian(self, arc_lengths: ArrayLike) -> Array:
        """J_pr of thesis A.24: N_i at each of l arc lengths, shape (n, l)."""
        s = check_arc_lengths(arc_lengths, self.spec.length)
        spans, values = basis.compute_basis(self._knots, s)
        jacobian = np.zeros((self._n, len(s)))
        for column, (span, row) in enumerate(zip(spans, values[:, 0], strict=True)):
            jacobian[span : span + 4, column] = row
        return jacobian

    def compute_required_forces(self, acceleration: ArrayLike) -> Array:
        """Forces on the control points for wanted accelerations of theirs (inverse dynamics).

        Thesis A.25 with the sign of its P derived from the energy: F_p = M A + dU/dp + C v - F_e.

        Args:
            acceleration: of the control points, (n, 3), m/s^2.

        Returns:
            (n, 3) N; for robots at arc lengths s it is J_pr(s) F_r where that can be met exactly.
        """
        wanted = np.asarray(acceleration, dtype=np.float64)
        if wanted.shape != (self._n, 3) or not np.all(np.isfinite(wanted)):
            raise InputError("acceleration", wanted.shape, f"finite numbers, shape ({self._n}, 3)")
        self._build_band(moments=True)
        size = len(self._state.x)
        drag = self._hose.drag_rate * self._state.v
        inertia = self._multiply_mass(wanted[:, self._dims].ravel() + drag)
        total = inertia + self._work.gradient[:size] - self._loads.force
        return self._to_world(total, np.zeros(3))

    # -- inside ------------------------------------------------------------------------------------

    def _to_world(self, flat: Array, offset: Array) -> Array:
        world = np.tile(offset, (len(flat) // len(self._dims), 1))
        world[:, self._dims] += flat.reshape(-1, len(self._dims))
        return world

    def _evaluate(self, s: Array, derivative: int, flat: Array) -> Array:
        spans, values = basis.compute_basis(self._knots, s)
        points = flat.reshape(self._n, -1)[spans[:, None] + np.arange(4)]
        world = np.zeros((len(s), 3))
        world[:, self._dims] = np.einsum("ki,kid->kd", values[:, derivative], points)
        return world

    def _multiply_mass(self, flat: Array) -> Array:
        out = np.zeros(len(flat))
        solver.multiply_mass(self._axes, self._hose.mass, 1.0, flat, out)
        return out

    def _gravity_force(self) -> Array:
        uniform = np.tile(self.gravity[list(self._dims)], self._n)
        return self._multiply_mass(uniform)

    def _build_band(self, *, moments: bool) -> None:
        """dU + C v - moments into work.gradient, tangent stiffness into work.band."""
        work, x = self._work, self._state.x
        work.gradient[:] = 0.0
        work.band[:] = 0.0
        work.rate[: len(x)] = self._state.v
        assemble(
            self._axes,
            self._hose.tables,
            self._hose.elasticity,
            x,
            work.rate,
            np.inf,
            True,
            work.span,
            work.gradient,
            work.band,
        )
        if moments:
            solver.add_moments(self._axes, self._loads, True, x, work.gradient, work.band)

    def _normal(self) -> Array:
        unit = np.eye(3)
        return np.cross(unit[self._dims[0]], unit[self._dims[1]])

    def _check_in_plane(self, name: str, vector: Array, slack: float) -> None:
        if len(self._dims) == 2 and abs(float(vector @ self._normal())) > slack:
            raise InputError(name, vector.tolist(), "a vector in the plane of a planar hose")

    def _check_position(self, position: ArrayLike) -> Array:
        point = check_vector("position", position)
        self._check_in_plane("position", point - self._offset, 1e-9 * self.spec.length)
        return point

    def _add_hold(self, arc_length: float, position: ArrayLike | None, tangent: Array | None) -> Hold:
        s = float(check_arc_lengths(arc_length, self.spec.length)[0])
        for held in self._held:
            if abs(held.hold.arc_length - s) < 1e-9 * self.spec.length:
                raise InputError("arc_length", s, "a place that no other hold is at")
        point = self.position(s)[0] if position is None else self._check_position(position)
        hold = Hold(self._n_holds, s, tangent is not None)
        self._n_holds += 1
        self._held.append(_Held(hold, point, tangent))
        self._rebuild_holds()
        return hold

    def _find(self, hold: Hold) -> _Held:
        for held in self._held:
            if held.hold == hold:
                return held
        raise InputError("hold", hold, "a hold of this hose that was not released")

    def _n_rows(self, held: _Held) -> int:
        d = len(self._dims)
        return d if held.tangent is None else 2 * d - 1

    def _across(self, tangent: Array) -> Array:
        """Unit vectors of the hose's space that are normal to a tangent, (d - 1, 3)."""
        if len(self._dims) == 2:
            return np.cross(self._normal(), tangent)[None]
        away = np.eye(3)[int(np.argmin(np.abs(tangent)))]
        first = np.cross(tangent, away)
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(tangent, first)])

    def _rebuild_holds(self) -> None:
        """Makes the rows of G x = g from the list of holds: positions first, then transverse slopes."""
        d = len(self._dims)
        m = sum(self._n_rows(held) for held in self._held)
        start = np.zeros(m, dtype=np.int64)
        rows, after = np.zeros((m, 4 * d)), np.zeros(m)
        row = 0
        for held in self._held:
            spans, values = basis.compute_basis(self._knots, np.array([held.hold.arc_length]))
            count = self._n_rows(held)
            start[row : row + count] = spans[0] * d
            for c in range(d):
                rows[row + c, c::d] = values[0, 0]
            after[row : row + d] = (held.position - self._offset)[list(self._dims)]
            if held.tangent is not None:
                for k, direction in enumerate(self._across(held.tangent)):
                    rows[row + d + k] = np.outer(values[0, 1], direction[list(self._dims)]).ravel()
            row += count
        self._holds = solver.Holds(start, rows, after.copy(), after, np.zeros(m))
        self._work = solver.make_work(self._n, d, m)

    def _rebuild_loads(self) -> None:
        d = len(self._dims)
        force = self._gravity_force()
        for s, vector in self._forces:
            spans, values = basis.compute_basis(self._knots, np.array([s]))
            window = slice(spans[0] * d, spans[0] * d + 4 * d)
            force[window] += np.outer(values[0, 0], vector[list(self._dims)]).ravel()
        places = np.array([s for s, _ in self._moments])
        spans, values = basis.compute_basis(self._knots, places)
        moment = np.zeros((len(places), 3))
        for k, (_, vector) in enumerate(self._moments):
            moment[k] = vector if d == 3 else [vector @ self._normal(), 0.0, 0.0]
        self._loads = solver.Loads(force, spans * d, np.ascontiguousarray(values[:, 1]), moment)


def _check_direction(tangent: ArrayLike) -> Array:
    vector = check_vector("tangent", tangent)
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise InputError("tangent", vector.tolist(), "a vector that is not zero")
    return vector / length


def _to_dense(band: Array, size: int, width: int) -> Array:
    dense = np.zeros((size, size))
    for k in range(width):
        rows = np.arange(k, size)
        dense[rows, rows - k] = band[: size - k, k]
        dense[rows - k, rows] = band[: size - k, k]
    return dense
