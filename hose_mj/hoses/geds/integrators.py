"""Time stepping: backward Euler, BDF2, SDIRK2, implicit midpoint over one stage solver, and Verlet.

BDF2 is the default: second order, and it damps what the time step cannot resolve. The others are
there for validation: SDIRK2 (no memory), the midpoint rule (conserves angular momentum, but gains
energy in stiff axial modes over long runs) and Verlet (explicit, independent of Newton).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.band import factorize
from hose_mj.hoses.geds.contact import accept_contact
from hose_mj.hoses.geds.contact_law import IMPACTS, SELF_SCALE, TIMESTEP
from hose_mj.hoses.geds.frames import accept_frames, restore_frames
from hose_mj.hoses.geds.kkt import multiply_row, solve_with_constraints
from hose_mj.hoses.geds.newton import add_mass, build, newton
from hose_mj.hoses.geds.records import (
    DEPENDENT_CONSTRAINTS,
    DONE,
    NOT_FINITE,
    Limits,
)
from hose_mj.hoses.geds.self_contact import accept_self_contact
from hose_mj.hoses.geds.twist import accept_twist, start_twist
from hose_mj.hoses.protocol import Array
from hose_mj.jit import choose_by_unknowns, inlined, kernel, merged

SCHEMES = {"backward-euler": 0, "bdf2": 1, "sdirk2": 2, "midpoint": 3, "verlet": 4}
_BACKWARD_EULER, _BDF2, _SDIRK2, _MIDPOINT = range(4)
_GAMMA = 1.0 - np.sqrt(0.5)
_NO_CHANGE = 1e200
"""Softness that keeps the twist's rank-one terms out of the mass matrix."""


class State(NamedTuple):
    """What a hose remembers, flat arrays (n d,): all of it makes a snapshot.

    Attributes:
        x, v: control points (m) and their velocities (m/s).
        x_old, v_old: the same one step earlier (BDF2).
        a: acceleration at the end of the last step, for the predictor.
        started: (1,), 1.0 once x_old and v_old hold a step.
        work: done by dead loads, gravity and holds so far, (1,), J.
    """

    x: Array
    v: Array
    x_old: Array
    v_old: Array
    a: Array
    started: Array
    work: Array


STEPS, ITERATIONS, FALLBACKS, RETRIES = range(4)
"""Places in the counters, (4,): steps done, Newton iterations, solver fallbacks, and how often a
step had to be tried another way."""


def make_state(size: int) -> State:
    """Returns a state of `size` unknowns, all zero."""
    x, v, x_old, v_old, a = (np.zeros(size) for _ in range(5))
    return State(x, v, x_old, v_old, a, np.zeros(1), np.zeros(1))


ATTEMPTS = 6
"""The scheme as asked; backward Euler; the same with a line search in 1, 8, 64, 512 parts."""


@inlined
def _set_up_stage(scheme, stage, dt, state, work):
    """Writes X, V and the guess x of a stage; returns its length h and where in the step it ends.

    work.x_now and work.v_now hold the state at the beginning of the step (or part of a step).
    """
    size = len(state.x)
    if scheme == _BDF2:
        for k in range(size):
            work.X[k] = (4.0 * work.x_now[k] - state.x_old[k]) / 3.0
            work.V[k] = (4.0 * work.v_now[k] - state.v_old[k]) / 3.0
            work.x[k] = work.x_now[k] + dt * (work.v_now[k] + 0.5 * dt * state.a[k])
        return 2.0 * dt / 3.0, 1.0
    if scheme == _SDIRK2 and stage == 1:
        h = _GAMMA * dt
        rest = dt - h
        for k in range(size):
            v = (work.x[k] - work.X[k]) / h
            work.X[k] = work.x_now[k] + rest * v
            work.V[k] = work.v_now[k] + rest * (v - work.v_now[k]) / h
            work.x[k] += rest * v
        return h, 1.0
    fraction = 1.0
    if scheme == _SDIRK2:
        fraction = _GAMMA
    elif scheme == _MIDPOINT:
        fraction = 0.5
    h = fraction * dt
    for k in range(size):
        work.X[k] = work.x_now[k]
        work.V[k] = work.v_now[k]
        work.x[k] = work.x_now[k] + h * (work.v_now[k] + 0.5 * h * state.a[k])
    return h, fraction


@inlined
def _set_up_response(constraints, scheme, stage, part, parts):
    """Writes what a stage knows of the mean force over the step: base + share lambda.

    BDF2's share carries on a third of the force before, so that its impulses are those that change
    the hose's momentum. Where a step is taken in parts, each takes its force for that of the rest.
    """
    response = constraints.response
    share = 1.0
    if scheme == _BDF2:
        share = 2.0 / 3.0
    elif scheme == _SDIRK2 and stage == 1:
        share = _GAMMA
    else:
        share = (parts - part) / parts
    response.share[0] = share
    for row in range(len(response.compliance)):
        if scheme == _BDF2:
            base = response.force[row] / 3.0
        elif scheme == _SDIRK2:
            base = (1.0 - _GAMMA) * response.gathered[row]
        else:
            base = response.gathered[row] / parts
        response.base[row] = base


@merged
def _try_step(address, constraints, limits, scheme, dt, parts, state, work, counts):
    """Takes one step in equal parts; the result is in work.x_now, work.v_now and work.X, work.V.

    Returns the verdict and the length of the last stage.
    """
    size = len(state.x)
    for k in range(size):
        work.start[k] = state.x[k]
        work.x_now[k] = state.x[k]
        work.v_now[k] = state.v[k]
    n_stages = 2 if scheme == _SDIRK2 else 1
    h = dt
    response = constraints.response
    for row in range(len(response.compliance)):
        response.gathered[row] = 0.0
    # Springs begin from what they did before.
    for row in range(len(constraints.start)):
        work.multipliers[row] = constraints.multipliers[row]
    for part in range(parts):
        for stage in range(n_stages):
            h, end = _set_up_stage(scheme, stage, dt / parts, state, work)
            fraction = (part + end) / parts
            _set_up_response(constraints, scheme, stage, part, parts)
            verdict, iterations, fallbacks = newton(address, h, fraction, limits)
            counts[ITERATIONS] += iterations
            counts[FALLBACKS] += fallbacks
            if verdict != DONE:
                return verdict, h
            for row in range(len(response.compliance)):
                response.gathered[row] += work.multipliers[row]
        for k in range(size):
            v = (work.x[k] - work.X[k]) / h
            if scheme == _MIDPOINT:
                work.x_now[k] = 2.0 * work.x[k] - work.X[k]
                work.v_now[k] = 2.0 * v - work.V[k]
            else:
                work.x_now[k] = work.x[k]
                work.v_now[k] = v
    return DONE, h


@inlined
def _accept_scalar(axes, hose, constraints, state, p):
    accept_twist(axes, constraints.twist, state.x)


@inlined
def _restore_scalar(axes, twist):
    start_twist(twist)


@inlined
def _restore_frames(axes, twist):
    restore_frames(twist)


_accept_twist = choose_by_unknowns({3: _accept_scalar, 4: accept_frames})
_restore = choose_by_unknowns({3: _restore_scalar, 4: _restore_frames})


@inlined
def start_step(axes, constraints, dt):
    """Returns twist and frames to the last accepted state; sets the clamps' rates of spin."""
    twist = constraints.twist
    for clamp in range(len(twist.starts)):
        twist.spin[clamp, 1] = twist.spin[clamp, 0] / dt
    _restore(axes, twist)


@merged
def _step_implicit(address, axes, constraints, limits, scheme, dt, state, work, counts):
    """One step; where its Newton fails, backward Euler, in the end in ever finer parts."""
    # A line search takes more, shorter steps: three times as many may be needed.
    most = 3 * limits.max_iterations
    move, turn, left = limits.tolerance, limits.turn_length, limits.force_tolerance
    careful = Limits(move, turn, most, np.inf, True, 0.0, left)
    # What nothing else ends is taken in small parts by moves alone.
    last = Limits(move, turn, most, np.inf, True, 0.0, np.inf)
    verdict = NOT_FINITE
    for attempt in range(ATTEMPTS):
        first = attempt == 0
        if first and scheme == _BDF2 and state.started[0] == 0.0:
            use = _BACKWARD_EULER
        else:
            use = scheme if first else _BACKWARD_EULER
        # Whole in attempts 0 to 2, then in 8, 64 and 512 parts; see ATTEMPTS.
        parts = 1 if attempt < 3 else 8 ** (attempt - 2)
        start_step(axes, constraints, dt)
        verdict, h = _try_step(
            address,
            constraints,
            limits if attempt < 2 else (careful if attempt < 4 else last),
            use,
            dt,
            parts,
            state,
            work,
            counts,
        )
        if verdict == DEPENDENT_CONSTRAINTS:
            return verdict
        if verdict == DONE:
            for k in range(len(state.x)):
                state.x_old[k] = state.x[k]
                state.v_old[k] = state.v[k]
                state.a[k] = ((work.x[k] - work.X[k]) / h - work.V[k]) / h
                state.x[k] = work.x_now[k]
                state.v[k] = work.v_now[k]
            state.started[0] = 1.0 if first else 0.0
            return verdict
        counts[FALLBACKS] += 1
        counts[RETRIES] += 1
    return verdict


@merged
def _step_verlet(axes, hose, constraints, loads, dt, state, work):
    """Velocity Verlet with constrained positions and velocities (RATTLE); no damping, no drag."""
    width = 4 * len(axes)
    size = len(state.x)
    start_step(axes, constraints, dt)
    for k in range(size):
        work.X[k] = state.x[k]
        work.V[k] = state.v[k]
    for half in range(2):
        # First half: lambda such that x_(n+1) meets G x = g. Second: such that v_(n+1) does.
        for row in range(len(constraints.start)):
            speed = multiply_row(axes, constraints, row, work.V, size)
            if half == 0:
                gap = constraints.after[row] - multiply_row(axes, constraints, row, work.X, size)
                work.shift[row] = 2.0 * (gap - dt * speed) / (dt * dt)
            else:
                wanted = (constraints.after[row] - constraints.before[row]) / dt
                work.shift[row] = 2.0 * (wanted - speed) / dt
        # A stage of infinite length has no inertia: what it builds is the force.
        infinite = (np.inf, work.X, work.V)
        build(axes, hose, infinite, constraints.twist, 1.0, loads, 1.0, True, work.X, work)
        for k in range(size):
            for m in range(width):
                work.band[k, m] = 0.0
        add_mass(axes, hose, 1.0, work.band)
        factorize(axes, size, work.band)
        verdict = solve_with_constraints(axes, constraints, 0.0, _NO_CHANGE, 0, size, work)
        if verdict != DONE:
            return verdict
        for k in range(size):
            work.V[k] += 0.5 * dt * work.gradient[k]
            if half == 0:
                work.X[k] += dt * work.V[k]
            if not np.isfinite(work.X[k] + work.V[k]):
                return NOT_FINITE
    for k in range(size):
        state.x_old[k] = state.x[k]
        state.v_old[k] = state.v[k]
        state.a[k] = work.gradient[k]
        state.x[k] = work.X[k]
        state.v[k] = work.V[k]
    state.started[0] = 1.0
    return DONE


@inlined
def _keep_multipliers(axes, constraints, loads, state, work, counts):
    """Counts a step that is done and its work, and keeps its multipliers and mean forces.

    Holds count with the mean of their forces at both ends of the step.
    """
    counts[STEPS] += 1
    done, size = 0.0, len(state.x)
    for k in range(size):
        done += loads.force[k] * (state.x[k] - state.x_old[k])
    for row in range(len(constraints.start)):
        way = multiply_row(axes, constraints, row, state.x, size)
        way -= multiply_row(axes, constraints, row, state.x_old, size)
        done += 0.5 * (constraints.multipliers[row] + work.multipliers[row]) * way
    state.work[0] += done
    for row in range(len(constraints.start)):
        constraints.multipliers[row] = work.multipliers[row]
    response = constraints.response
    for row in range(len(response.compliance)):
        force = response.base[row] + response.share[0] * work.multipliers[row]
        response.force[row] = force


@merged
def take_step(address, axes, constraints, loads, limits, scheme, dt, state, work, counts):
    """Takes one step of an implicit scheme, but for what `end_step` does; returns a verdict.

    The records are those of the session at the address, but for the state.
    """
    verdict = _step_implicit(address, axes, constraints, limits, scheme, dt, state, work, counts)
    if verdict == DONE:
        _keep_multipliers(axes, constraints, loads, state, work, counts)
    return verdict


@merged
def take_verlet_step(axes, hose, constraints, loads, dt, state, work, counts):
    """`take_step` for Verlet, apart from it: compiled only for those who use it."""
    verdict = _step_verlet(axes, hose, constraints, loads, dt, state, work)
    if verdict == DONE:
        _keep_multipliers(axes, constraints, loads, state, work, counts)
    return verdict


@merged
def end_step(axes, hose, constraints, contact, state, p):
    """Accepts a step: constraints stand where they came to, twist and frames are what was found."""
    contact.found[IMPACTS] = 0.0
    if contact.geoms.shape[0] + contact.given.shape[0] > 0:
        accept_contact(axes, contact, state)
    if contact.law[SELF_SCALE] > 0.0:
        accept_self_contact(axes, contact, state, contact.law[TIMESTEP])
    if contact.found[IMPACTS] > 0.0:
        state.started[0] = 0.0
    response = constraints.response
    for row in range(len(constraints.start)):
        constraints.before[row] = constraints.after[row]
        for other in range(len(response.compliance)):
            constraints.before[row] -= response.compliance[row, other] * response.force[other]
    _accept_twist(axes, hose, constraints, state, p)


@kernel
def copy_state(source, target):
    """Copies all of a state into another one."""
    for k in range(len(source.x)):
        target.x[k], target.v[k], target.a[k] = source.x[k], source.v[k], source.a[k]
        target.x_old[k], target.v_old[k] = source.x_old[k], source.v_old[k]
    target.started[0], target.work[0] = source.started[0], source.work[0]
