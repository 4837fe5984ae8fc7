"""Time stepping: backward Euler, BDF2, SDIRK2, implicit midpoint over one stage solver, and Verlet.

BDF2 is the default: second order, and it damps what the time step cannot resolve. The others are
there for validation: SDIRK2 (no memory), the midpoint rule (conserves angular momentum, but gains
energy in stiff axial modes over long runs) and Verlet (explicit, independent of Newton).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.band import factorize
from hose_mj.hoses.geds.compiled import compiled
from hose_mj.hoses.geds.solver import (
    DEPENDENT_HOLDS,
    DONE,
    NOT_FINITE,
    NOT_POSITIVE,
    Limits,
    _build,
    add_mass,
    newton,
    solve_with_holds,
)
from hose_mj.hoses.model import Array

SCHEMES = {"backward-euler": 0, "bdf2": 1, "sdirk2": 2, "midpoint": 3, "verlet": 4}
_BACKWARD_EULER, _BDF2, _SDIRK2, _MIDPOINT, _VERLET = range(5)
_GAMMA = 1.0 - np.sqrt(0.5)


class State(NamedTuple):
    """What a hose remembers, flat arrays (n d,): all of it makes a snapshot.

    Attributes:
        x, v: control points (m) and their velocities (m/s).
        x_old, v_old: the same one step earlier (BDF2).
        a: acceleration at the end of the last step, for the predictor.
        started: (1,), 1.0 once x_old and v_old hold a step.
    """

    x: Array
    v: Array
    x_old: Array
    v_old: Array
    a: Array
    started: Array


class Count(NamedTuple):
    """Counters, (1,) each: steps done, Newton iterations, fallbacks."""

    steps: np.ndarray
    iterations: np.ndarray
    fallbacks: np.ndarray


def make_state(size: int) -> State:
    """Returns a state of `size` unknowns, all zero."""
    return State(*(np.zeros(size) for _ in range(5)), np.zeros(1))


@compiled
def _stage(axes, hose, stage, holds, fraction, loads, limits, x, work, count):  # type: ignore[no-untyped-def]
    """One implicit stage with its fallback; x is the guess on entry, the solution on return."""
    verdict, iterations, fallbacks = newton(
        axes, hose, stage, holds, fraction, loads, 1.0, limits, x, work
    )
    count.iterations[0] += iterations
    count.fallbacks[0] += fallbacks
    if verdict == DONE or verdict == DEPENDENT_HOLDS:
        return verdict
    careful = Limits(limits.tolerance, 10 * limits.max_iterations, 0.5, limits.hold_weight)
    for k in range(len(x)):
        x[k] = stage[1][k]
    verdict, iterations, fallbacks = newton(
        axes, hose, stage, holds, fraction, loads, 1.0, careful, x, work
    )
    count.iterations[0] += iterations
    count.fallbacks[0] += fallbacks + 1
    return verdict


class Scratch(NamedTuple):
    """A step in the making, flat (n d,): nothing reaches `State` before the step is done."""

    x: Array
    X: Array
    V: Array


@compiled
def _predict(dt, state, x):  # type: ignore[no-untyped-def]
    """Guess of x at the end of the step."""
    for k in range(len(x)):
        x[k] = state.x[k] + dt * (state.v[k] + 0.5 * dt * state.a[k])


@compiled
def _commit(h, state, s):  # type: ignore[no-untyped-def]
    """Moves a finished implicit step of stage length h into the state."""
    for k in range(len(s.x)):
        v = (s.x[k] - s.X[k]) / h
        state.x_old[k] = state.x[k]
        state.v_old[k] = state.v[k]
        state.a[k] = (v - s.V[k]) / h
        state.x[k] = s.x[k]
        state.v[k] = v
    state.started[0] = 1.0


@compiled
def _step_backward_euler(axes, hose, holds, loads, limits, dt, state, s, work, count):  # type: ignore[no-untyped-def]
    s.X[:] = state.x
    s.V[:] = state.v
    _predict(dt, state, s.x)
    verdict = _stage(axes, hose, (dt, s.X, s.V), holds, 1.0, loads, limits, s.x, work, count)
    if verdict == DONE:
        _commit(dt, state, s)
    return verdict


@compiled
def _step_bdf2(axes, hose, holds, loads, limits, dt, state, s, work, count):  # type: ignore[no-untyped-def]
    if state.started[0] == 0.0:
        return _step_backward_euler(axes, hose, holds, loads, limits, dt, state, s, work, count)
    for k in range(len(s.x)):
        s.X[k] = (4.0 * state.x[k] - state.x_old[k]) / 3.0
        s.V[k] = (4.0 * state.v[k] - state.v_old[k]) / 3.0
    h = 2.0 * dt / 3.0
    _predict(dt, state, s.x)
    verdict = _stage(axes, hose, (h, s.X, s.V), holds, 1.0, loads, limits, s.x, work, count)
    if verdict == DONE:
        _commit(h, state, s)
        return verdict
    # The memory of a step is no help where the motion breaks: one step without it.
    count.fallbacks[0] += 1
    return _step_backward_euler(axes, hose, holds, loads, limits, dt, state, s, work, count)


@compiled
def _step_sdirk2(axes, hose, holds, loads, limits, dt, state, s, work, count):  # type: ignore[no-untyped-def]
    h = _GAMMA * dt
    s.X[:] = state.x
    s.V[:] = state.v
    _predict(h, state, s.x)
    verdict = _stage(axes, hose, (h, s.X, s.V), holds, _GAMMA, loads, limits, s.x, work, count)
    if verdict != DONE:
        return verdict
    rest = (1.0 - _GAMMA) * dt
    for k in range(len(s.x)):
        v = (s.x[k] - s.X[k]) / h
        s.X[k] = state.x[k] + rest * v
        s.V[k] = state.v[k] + rest * (v - state.v[k]) / h
        s.x[k] += rest * v
    verdict = _stage(axes, hose, (h, s.X, s.V), holds, 1.0, loads, limits, s.x, work, count)
    if verdict == DONE:
        _commit(h, state, s)
    return verdict


@compiled
def _step_midpoint(axes, hose, holds, loads, limits, dt, state, s, work, count):  # type: ignore[no-untyped-def]
    h = 0.5 * dt
    s.X[:] = state.x
    s.V[:] = state.v
    _predict(h, state, s.x)
    verdict = _stage(axes, hose, (h, s.X, s.V), holds, 0.5, loads, limits, s.x, work, count)
    if verdict != DONE:
        return verdict
    for k in range(len(s.x)):
        v = (s.x[k] - s.X[k]) / h
        state.a[k] = (v - s.V[k]) / h
        state.x_old[k] = state.x[k]
        state.v_old[k] = state.v[k]
        state.x[k] = 2.0 * s.x[k] - s.X[k]
        state.v[k] = 2.0 * v - s.V[k]
    state.started[0] = 1.0
    return verdict


@compiled
def _accelerate(axes, hose, holds, loads, x, work):  # type: ignore[no-untyped-def]
    """Writes M^-1 (f - dU + G^T lambda) with G M^-1 (...) = work.shift into work.gradient."""
    # A stage of infinite length has no inertia: what it builds is the force.
    _build(axes, hose, (np.inf, x, x), loads, 1.0, True, x, work)
    work.band[:, :] = 0.0
    add_mass(axes, hose.mass, 1.0, work.band)
    if not factorize(axes, len(x), work.band):
        return NOT_POSITIVE
    if not solve_with_holds(axes, holds, len(x), work):
        return DEPENDENT_HOLDS
    return DONE


@compiled
def _step_verlet(axes, hose, holds, loads, limits, dt, state, s, work, count):  # type: ignore[no-untyped-def]
    """Velocity Verlet with holds on positions and velocities (RATTLE); no damping, no drag."""
    width = 4 * len(axes)
    for k in range(len(s.x)):
        s.x[k] = state.x[k] + dt * state.v[k]
    for row in range(len(holds.start)):
        gap = holds.after[row]
        for k in range(width):
            gap -= holds.rows[row, k] * s.x[holds.start[row] + k]
        work.shift[row] = 2.0 * gap / (dt * dt)
    verdict = _accelerate(axes, hose, holds, loads, state.x, work)
    if verdict != DONE:
        return verdict
    for k in range(len(s.x)):
        s.V[k] = state.v[k] + 0.5 * dt * work.gradient[k]
        s.x[k] = state.x[k] + dt * s.V[k]
    for row in range(len(holds.start)):
        speed = (holds.after[row] - holds.before[row]) / dt
        for k in range(width):
            speed -= holds.rows[row, k] * s.V[holds.start[row] + k]
        work.shift[row] = 2.0 * speed / dt
    verdict = _accelerate(axes, hose, holds, loads, s.x, work)
    if verdict != DONE:
        return verdict
    for k in range(len(s.x)):
        if not np.isfinite(s.x[k] + work.gradient[k]):
            return NOT_FINITE
    for k in range(len(s.x)):
        state.x_old[k] = state.x[k]
        state.v_old[k] = state.v[k]
        state.x[k] = s.x[k]
        state.v[k] = s.V[k] + 0.5 * dt * work.gradient[k]
        state.a[k] = work.gradient[k]
    state.started[0] = 1.0
    return DONE


@compiled
def advance(axes, hose, holds, loads, limits, scheme, dt, n_steps, state, work, count):  # type: ignore[no-untyped-def]
    """Advances a state by n_steps steps of dt; returns the verdict of the last step tried.

    A step that fails leaves the state at the step before it; count.steps says how many were done.
    Eleven arguments: it is the one entry to the dynamics.
    """
    size = len(state.x)
    s = Scratch(np.empty(size), np.empty(size), np.empty(size))
    for _ in range(n_steps):
        if scheme == _BDF2:
            verdict = _step_bdf2(axes, hose, holds, loads, limits, dt, state, s, work, count)
        elif scheme == _BACKWARD_EULER:
            verdict = _step_backward_euler(
                axes, hose, holds, loads, limits, dt, state, s, work, count
            )
        elif scheme == _SDIRK2:
            verdict = _step_sdirk2(axes, hose, holds, loads, limits, dt, state, s, work, count)
        elif scheme == _MIDPOINT:
            verdict = _step_midpoint(axes, hose, holds, loads, limits, dt, state, s, work, count)
        else:
            verdict = _step_verlet(axes, hose, holds, loads, limits, dt, state, s, work, count)
        if verdict != DONE:
            return verdict
        count.steps[0] += 1
        for row in range(len(holds.start)):
            holds.multipliers[row] = work.multipliers[row]
            holds.before[row] = holds.after[row]
    return DONE
