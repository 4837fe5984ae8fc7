"""`Dynamics`: the motion of one hose, its time steps and its static equilibrium."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types

from hose_mj.errors import StepError
from hose_mj.hoses.geds import (
    energy,
    frames,
    integrators,
    mechanics,
    newton,
    packing,
    point_masses,
    records,
    stepping,
)
from hose_mj.hoses.geds.constraints import ConstraintSet
from hose_mj.hoses.geds.contact import add_contact
from hose_mj.hoses.geds.contact_law import Motion
from hose_mj.hoses.geds.integrators import RETRIES, STEPS
from hose_mj.hoses.geds.loads import LoadSet
from hose_mj.hoses.geds.morison import add_fluid
from hose_mj.hoses.geds.self_contact import accept_self_contact, add_self_contact
from hose_mj.hoses.geds.twist import accept_twist
from hose_mj.hoses.health import HealthWatch
from hose_mj.hoses.paths import HoldPath
from hose_mj.hoses.protocol import Array, Hold, Linearization

_ENDLESS = float(np.finfo(np.float64).max)
"""A step that changes no velocity (s), yet is finite: contact takes an infinite one for statics."""
MOST_LOAD_STEPS = 64
"""Into so many the loads are divided at most: six halvings of what has failed."""
_STATIC_TOLERANCE = 1e-10
"""Of the last move of a control point, in lengths of the hose."""
_STATIC_ITERATIONS = 400
"""At half a radian an iteration a tangent may turn thirty times round in so many."""
_STATIC_TURN = 0.5
"""Largest turn of a tangent in one static iteration (rad): beats an energy line search near
inextensibility."""
_RESET_ITERATIONS = 8
"""A hose with theta resets its frames after so many iterations; with frames that have gathered
much of the hose's own turns the iteration crawls."""
_NO_MASSES = point_masses.make_none()
_NO_ROWS = np.zeros(0, dtype=np.int64)
_NO_PATH = stepping.Path(
    _NO_ROWS, np.zeros((0, 0)), _NO_ROWS, np.zeros((0, 0, 0)), np.zeros(0, dtype=np.float64)
)


_ROUNDING = 1e-12
"""Of the largest stiffness over mass (1/s^2): what is below is no sign of anything."""
_SLOW = 1e-2
"""Of EI / (rho L^4): the square of a rate below which growth counts as none (1/s^2); the slowest
bending motion of a clamped hose is 35 times as fast."""
_MOST_BALANCES = 30
"""Of a current's drag with the hose's shape, at half a radian a span each."""
_BALANCED = 1e-9
"""Of the move of a control point, in lengths, that drag and shape still ask of each other: dead
loads are met to a tenth of it."""
_AIDS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
"""Bending stiffness lent to a chain in statics, in loads times length squared."""


@dataclass
class Dynamics:
    """One hose as the integrators take it, and its clock.

    Attributes:
        axes: a zero for each unknown of a control point.
        hose: constants.
        constraints, loads: what acts on it.
        limits: when Newton's iteration stops.
        scheme: the integrator's name.
        timestep: length of a step (s).
        state: what a step changes.
        counts: see `integrators.STEPS`; the steps are those since the last reset, (4,).
        watch: what says that a step leaves its healthy range.
        trial: the state after a step that was tried; see body_coupling.py.
        first_energy: kinetic and elastic energy where the count of work begins (J); infinite
            where work is not known any more.
    """

    axes: tuple[float, ...]
    hose: records.Hose
    constraints: ConstraintSet
    loads: LoadSet
    limits: records.Limits
    scheme: str
    timestep: float
    state: integrators.State
    counts: np.ndarray
    watch: HealthWatch
    first_energy: float = np.inf

    def __post_init__(self) -> None:
        self.trial = integrators.make_state(len(self.state.x))
        self._path, self._packed_of = _NO_PATH, (None,) * 5

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return int(self.counts[STEPS]) * self.timestep

    def advance(self, n_steps: int) -> None:
        """Takes n_steps steps; raises `StepError` for one that no fallback finished."""
        if self.constraints.is_moved:
            self.watch.check_jump(self.constraints.measure_jump())
            self.constraints.is_moved = False
        self.check(self.run(stepping.ADVANCE, n_steps))
        self.check_health()

    def follow(self, paths: Mapping[Hold, HoldPath], n_steps: int) -> None:
        """Takes n_steps steps, at the end of each of which holds are at a row of their paths.

        Raises:
            InputError: a hold, a row or a tangent that `move` would refuse; nothing has changed.
            StepError: a step that no fallback finished; the steps before count.
        """
        path = self.constraints.make_path(paths, n_steps)
        starts = self.constraints.rows.before[path.rows][None]
        d = len(self.axes[:3])
        ways = np.diff(np.concatenate([starts, path.places]), axis=0).reshape(n_steps, -1, d)
        jump = float(np.linalg.norm(ways, axis=2).max(initial=0.0))
        others = self.constraints.measure_jump() if self.constraints.is_moved else 0.0
        self.watch.check_jump(max(jump, others))
        self.constraints.is_moved, self._path = False, path
        before = int(self.counts[STEPS])
        verdict = self.run(stepping.FOLLOW, n_steps)
        done = int(self.counts[STEPS]) - before
        self.constraints.follow(paths, min(done, n_steps - 1))
        self.check(verdict)
        self.check_health()

    def check_health(self) -> None:
        """Looks at how the steps so far went; see `HealthWatch`."""
        contacts = self.loads.contacts
        # How deep a law of one's own is to sink is one's own affair.
        sunk = contacts.deepest if contacts.law.stiffness is None else 0.0
        steps, retries = int(self.counts[STEPS]), int(self.counts[RETRIES])
        crossings, measure_turn = contacts.crossings, contacts.measure_turn
        self.watch.check_steps(steps, retries, sunk, crossings, measure_turn)

    def run(
        self,
        what: int,
        n_steps: int,
        masses: point_masses.PointMasses = _NO_MASSES,
        first: np.ndarray = _NO_ROWS,
    ) -> int:
        """Runs the compiled entry, `stepping.advance`; returns its verdict."""
        if self.loads.fluid.is_field and what != stepping.ACCEPT:
            for _ in range(n_steps - 1):
                verdict = self.run(what, 1, masses, first)
                if verdict != records.DONE:
                    return verdict
            n_steps = min(n_steps, 1)
            self.loads.fluid.update(self.state.x)
        rows, loads = self.constraints.rows, self.loads.loads
        parts = (rows, loads, masses, first, self._path)
        if any(a is not b for a, b in zip(parts, self._packed_of, strict=True)):
            self._pack(parts)
        return int(self._enter(self._packed.address, what, self._code, n_steps))

    def _pack(self, parts: tuple[Any, ...]) -> None:
        """Puts all that a step reads to where compiled code finds it."""
        rows, loads, masses, first, path = parts
        session = stepping.Session(
            *(self.axes, self.hose, rows, loads, self.limits, self.timestep, self.state),
            *(self.trial, self.counts, 1.0, masses, first, path, self.make_work()),
        )
        self._packed, self._packed_of = packing.Packed(session), parts
        self._code = integrators.SCHEMES[self.scheme]
        kernel = stepping.advance_verlet if self.scheme == "verlet" else stepping.advance
        self._enter = _open(kernel, self._packed)

    def check(self, verdict: int) -> None:
        """Raises `StepError` unless a step was done."""
        if verdict != records.DONE:
            raise StepError(
                f"the step at t = {self.time:.6g} s failed: {records.VERDICTS[verdict]}; "
                f"try a time step below {self.timestep:g} s or check holds and loads"
            )

    # -- statics ---------------------------------------------------------------------------------

    def solve_static(self, load_steps: int) -> None:
        """Moves the state to equilibrium by Newton's iteration, capped by the tangents' turn.

        The loads grow in `load_steps` equal steps, in two, four, ... times as many if that fails.
        A current's drag grows after them, in as many steps.

        Raises:
            StepError: no equilibrium was found; the state before is kept.
        """
        rows = self.constraints.rows
        twist = rows.twist.accepted, rows.twist.spin
        changing = (*twist, rows.before, rows.after, rows.multipliers, *self.state)
        before = [part.copy() for part in changing]
        self._settle(load_steps)
        if not self.loads.fluid.moves:
            return
        still = [part.copy() for part in changing]
        while load_steps <= MOST_LOAD_STEPS:
            try:
                self._meet_current(load_steps)
                return
            except (StepError, np.linalg.LinAlgError):
                _copy(still, changing)
                load_steps *= 2
            finally:
                self.loads.hold_drag(np.zeros_like(self.state.x))
        _copy(before, changing)
        raise StepError("no static equilibrium in the current was found")

    def _meet_current(self, load_steps: int) -> None:
        """Settles under loads and drag; raises `StepError` where the shape does not come to rest.

        For a dead drag f the hose settles at x(f). Wanted is f = drag(x(f)): Newton's iteration on
        f, whose matrix K - drag' is not symmetric.
        """
        length = self.hose.tables.span_length * len(self.hose.tables.first)
        fluid, held = self.loads.fluid, np.zeros_like(self.state.x)
        size, slopes = len(held), self.loads.contacts.contact.slopes[:, None]
        for share in np.linspace(0.0, 1.0, load_steps + 1)[1:]:
            for _ in range(_MOST_BALANCES):
                self.loads.hold_drag(held)
                self._settle(1)
                drag, slope = fluid.compute_drag(self.state.x)
                small = self.linearize(np.inf)
                rows, none = small.constraints, np.zeros((len(small.constraints),) * 2)
                # What no force resists, a turn about the hose's own axis, does not move.
                stiffness = small.stiffness + np.diag(_ROUNDING * np.diag(small.stiffness))
                matrix = np.block([[stiffness - share * slope, rows.T], [rows, none]])
                residual = np.concatenate([share * drag - held, np.zeros(len(rows))])
                move = np.linalg.solve(matrix, residual)[:size]
                if np.abs(move).max() <= _BALANCED * length:
                    break
                turn = np.abs(slopes * np.diff(move.reshape(-1, len(self.axes))[:, :3], axis=0))
                part = 1.0 / max(1.0, turn.max() / _STATIC_TURN)
                held = held + part * (share * (drag + slope @ move) - held)
            else:
                raise StepError("drag and shape do not come to rest")

    def _settle(self, load_steps: int) -> None:
        """`solve_static` for dead loads."""
        rows, work = self.constraints.rows, self.make_work()
        verdict, found = records.NOT_CONVERGED, self.state.x
        strands = self.loads.contacts.contact.strands
        changing = (rows.twist.accepted, rows.twist.spin, rows.before, rows.after, strands)
        before = [part.copy() for part in changing]
        while verdict != records.DONE and load_steps <= MOST_LOAD_STEPS:
            _copy(before, changing)
            integrators.start_step(self.axes, rows, np.inf)
            found = self.state.x.copy()
            for hose, scale in self._list_stages(load_steps):
                verdict, found = self._iterate(hose, scale, found, work)
                if verdict != records.DONE:
                    break
            load_steps *= 2
        if verdict != records.DONE:
            _copy(before, changing)
            raise StepError(f"no static equilibrium was found: {records.VERDICTS[verdict]}")
        for part in self.state:
            part[:] = 0.0
        self.state.x[:] = found
        # Like the end of a step: twist, frames and constraints are what was found.
        rows.multipliers[:] = work.multipliers[: len(rows.multipliers)]
        rows.before[:] = rows.after
        if len(self.axes) == 3:
            accept_twist(self.axes, rows.twist, self.state.x)
        elif len(self.axes) == 4:
            self._accept_frames(self.state, work)
        contacts = self.loads.contacts
        if contacts.law.self_contact:
            accept_self_contact(self.axes, contacts.contact, self.state, np.inf)
        self.check_health()

    def _list_stages(self, load_steps: int) -> list[tuple[records.Hose, float]]:
        """Hoses and shares of their loads through which a static solve goes, its own last.

        A chain (EI = 0) that is not drawn taut resists no load across it. It goes by way of hoses
        with less and less bending stiffness.
        """
        hose = self.hose
        scales = [float(scale) for scale in np.linspace(0.0, 1.0, load_steps + 1)[1:]]
        if np.any(hose.elasticity.bending_stiffness > 0.0):
            return [(hose, scale) for scale in scales]
        length = hose.tables.span_length * len(hose.tables.first)
        load = float(np.abs(self.loads.loads.force).sum())
        load = load or 1e-6 * float(hose.elasticity.axial_stiffness.min())
        aids = [self._stiffen(aid * load * length**2) for aid in _AIDS]
        return [(aids[0], scale) for scale in scales] + [(one, 1.0) for one in [*aids[1:], hose]]

    def _stiffen(self, bending_stiffness: float) -> records.Hose:
        """Returns this hose with a bending stiffness of its own (N m^2)."""
        elasticity = self.hose.elasticity
        stiffness = np.full_like(elasticity.bending_stiffness, bending_stiffness)
        stiff = elasticity._replace(bending_stiffness=stiffness, second_stiffness=stiffness)
        return self.hose._replace(elasticity=stiff)

    def check_stability(self) -> bool:
        """Returns whether the present state, an equilibrium, is stable; changes nothing."""
        twist = self.constraints.rows.twist
        torque = twist.torque.copy()
        work = self.build_tangent()
        self.constraints.ready_springs()
        length = self.hose.tables.span_length * len(self.hose.tables.first)
        mass = float(np.mean(self.hose.mass[:, 0]))
        density = float(2.0 * self.hose.mass.sum() - self.hose.mass[:, 0].sum()) / length
        bending = float(self.hose.elasticity.bending_stiffness.max()) / (density * length**4)
        stiffest = float(np.abs(work.band[: len(self.state.x), 0]).max()) / mass
        least_rate = max(_ROUNDING * stiffest, _SLOW * bending)
        rows = self.constraints.rows
        found = newton.is_positive(self.axes, self.hose, rows, least_rate, work)
        twist.torque[:] = torque
        return bool(found)

    def _iterate(
        self, hose: records.Hose, scale: float, x: Array, work: records.Work
    ) -> tuple[int, Array]:
        """Newton's iteration at one load; a hose with theta resets its frames now and then."""
        work.start[:] = work.x_now[:] = work.X[:] = work.x[:] = x
        work.V[:] = 0.0
        work.multipliers[:] = 0.0
        state = integrators.make_state(len(x))
        has_theta = len(self.axes) == 4
        length = self.hose.tables.span_length * len(self.hose.tables.first)
        most = _RESET_ITERATIONS if has_theta else _STATIC_ITERATIONS
        limits = records.Limits(
            _STATIC_TOLERANCE * length, length, most, _STATIC_TURN, False, 1.0, np.inf
        )
        rows, verdict = self.constraints.rows, records.NOT_CONVERGED
        session = stepping.Session(
            *(self.axes, hose, rows, self.loads.loads, limits, np.inf, self.state, self.trial),
            *(self.counts, scale, _NO_MASSES, _NO_ROWS, _NO_PATH, work),
        )
        packed = packing.Packed(session)
        enter = _open(stepping.advance, packed)
        for _ in range(_STATIC_ITERATIONS // _RESET_ITERATIONS):
            verdict = enter(packed.address, stepping.SETTLE, 0, 0)
            state.x[:] = work.x
            if not has_theta or verdict not in (records.DONE, records.NOT_CONVERGED):
                break
            theta = state.x[3::4].copy()
            self._accept_frames(state, work)
            work.x[:] = state.x
            if verdict == records.DONE and np.array_equal(theta, state.x[3::4]):
                break
        return verdict, state.x

    def _accept_frames(self, state: integrators.State, work: records.Work) -> None:
        rows = self.constraints.rows
        frames.accept_frames(self.axes, self.hose, rows, state, work.span)

    # -- small motions ---------------------------------------------------------------------------

    def make_work(self) -> records.Work:
        """Returns work arrays for the constraints of now."""
        n_points = len(self.state.x) // len(self.axes)
        n_soft = self.loads.contacts.n_soft
        return records.make_work(n_points, len(self.axes), self.constraints.n_rows, n_soft)

    def build_tangent(self, step: float = _ENDLESS) -> records.Work:
        """Returns work arrays with dU + C v less moments and contact in the gradient.

        Its derivative is in the band. Forces, gravity, inertia, constraints and drag are left out;
        so are the derivative of damping and friction and the rank-one terms of the twist. In an
        infinite step nothing rubs.
        """
        work, rows, loads = self.make_work(), self.constraints.rows, self.loads.loads
        x = self.state.x
        work.rate[: len(x)] = self.state.v
        integrators.start_step(self.axes, rows, np.inf)
        energy.assemble(
            *(self.axes, self.hose, rows.twist, 0.0, x, work.rate, np.inf, True),
            *(work.span, work.gradient, work.band),
        )
        newton.add_moments(self.axes, loads, True, x, work)
        # Within a step without end nothing changes its velocity, but what slides still rubs.
        motion = Motion(work.rate, x, x, step, 0.0, 0.0)
        add_contact(self.axes, loads.contact, x, motion, True, work.gradient, work.band)
        if self.loads.contacts.law.self_contact:
            work.start[:] = x
            add_self_contact(self.axes, loads.contact, x, _ENDLESS, True, work)
        return work

    def add_fluid(self, acceleration: Array, work: records.Work) -> None:
        """Adds drag and added mass at accelerations (n d,), m/s^2, to the gradient in `work`."""
        fluid, (x, v) = self.loads.fluid, self.state[:2]
        if len(fluid.morison.current) > 0:
            fluid.update(x)
            still = v - acceleration
            add_fluid(self.axes, fluid.morison, 1.0, still, x, v, work.gradient, work.band)

    def linearize(self, step: float = _ENDLESS) -> Linearization:
        """Returns dense mass, stiffness (of `build_tangent`, with the twist) and constraints."""
        work, rows = self.build_tangent(step), self.constraints.rows
        size, width = len(self.state.x), 4 * len(self.axes)
        stiffness = mechanics.make_dense(work.band, size, width)
        for row, compliance in zip(rows.twist.rows, rows.twist.compliance, strict=True):
            stiffness += np.outer(row[:size], row[:size]) / compliance
        count = int(work.soft.used[0])
        for row, compliance in zip(work.soft.rows[:count], work.soft.compliance, strict=False):
            stiffness += np.outer(row[:size], row[:size]) / compliance
        work.band[:] = 0.0
        newton.add_mass(self.axes, self.hose, 1.0, work.band)
        mass = mechanics.make_dense(work.band, size, width)
        mass += self.loads.fluid.compute_added_mass(self.state.x)
        dense, stiffnesses = (
            mechanics.make_dense_rows(rows, size, width),
            self.constraints.list_stiffnesses(),
        )
        soft = np.isfinite(stiffnesses)
        stiffness += dense[soft].T @ (stiffnesses[soft, None] * dense[soft])
        return Linearization(mass, stiffness, dense[~soft])


def _open(kernel: Any, packed: packing.Packed) -> Any:
    """Compiles an entry to the dynamics for a record, or finds it compiled."""
    return kernel.compile((packed.kind, *[types.int64] * 3))


def _copy(source: list[Array], target: tuple[Array, ...]) -> None:
    for part, wanted in zip(target, source, strict=True):
        part[:] = wanted
