"""The one entry to the dynamics: steps of a hose, tried ones, and steps with masses at its ends.

One, because whatever has an entry of its own compiles the whole integrator once more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.contact import compute_forces
from hose_mj.hoses.geds.integrators import (
    FALLBACKS,
    ITERATIONS,
    State,
    copy_state,
    end_step,
    take_step,
    take_verlet_step,
)
from hose_mj.hoses.geds.newton import newton
from hose_mj.hoses.geds.packing import unpack
from hose_mj.hoses.geds.point_masses import NEAR, PointMasses, aim, is_clear, move, move_shapes
from hose_mj.hoses.geds.records import DONE, Constraints, Hose, Limits, Loads, Work
from hose_mj.hoses.protocol import Array
from hose_mj.jit import bitwise, kernel

ADVANCE, TRY, ACCEPT, FOLLOW, SETTLE = range(5)
"""What `advance` is to do: steps, one step into `trial`, to make that one count, steps along a
path, or one solve of statics in the work arrays."""


class Path(NamedTuple):
    """Where holds are to be at the end of each of n steps.

    Attributes:
        rows: of the constraints whose g changes, (k,).
        places: their g, (n, k).
        slopes: rows of the constraints that turn, (l,).
        coefficients: of these, (n, l, 4 d).
        yields: 1.0 for those with a spring, whose g is always 0, (l,).
    """

    rows: np.ndarray
    places: Array
    slopes: np.ndarray
    coefficients: Array
    yields: Array


class Session(NamedTuple):
    """All that the steps of a hose read and write.

    Attributes:
        axes: (0.0,) * d.
        hose: constants.
        constraints, loads, limits: see records.py.
        timestep: dt (s).
        state: what steps change.
        trial: the state after a step that was tried.
        counts: see `integrators.STEPS`, (4,).
        load_scale: what loads are multiplied by: 1 but in statics.
        masses: at its attachments; none but where bodies are stepped with it.
        first: first rows of the masses' constraints, (k,).
        path: that `FOLLOW` goes.
        work: work arrays.
    """

    axes: tuple[float, ...]
    hose: Hose
    constraints: Constraints
    loads: Loads
    limits: Limits
    timestep: float
    state: State
    trial: State
    counts: Array
    load_scale: float
    masses: PointMasses
    first: np.ndarray
    path: Path
    work: Work


@bitwise
def _measure_slope(constraints, row, width, x):
    """What a row makes of x, added up in order: `ConstraintSet.move` does the same."""
    value = 0.0
    for k in range(width):
        value += constraints.rows[row, k] * x[constraints.start[row] + k]
    return value


@kernel
def _aim_holds(axes, constraints, path, k, x):
    """Sets where holds are to be at the end of step k of a path."""
    for j in range(len(path.rows)):
        constraints.after[path.rows[j]] = path.places[k, j]
    for j in range(len(path.slopes)):
        row, width = path.slopes[j], path.coefficients.shape[2]
        for i in range(width):
            constraints.rows[row, i] = path.coefficients[k, j, i]
        turned = 0.0 if path.yields[j] > 0.0 else _measure_slope(constraints, row, width, x)
        constraints.before[row] = turned


@kernel
def advance(address, what, scheme, n_steps):
    """Advances a session by n_steps steps of an implicit scheme; returns a verdict.

    That of the last step tried: a step that fails leaves the state at the step before it. `NEAR`
    where a mass may meet something in the next step. See `ADVANCE` for what it is to do.
    """
    session = unpack(address)
    axes, hose, constraints, loads = session.axes, session.hose, session.constraints, session.loads
    limits, dt, own, trial = session.limits, session.timestep, session.state, session.trial
    counts, masses, first = session.counts, session.masses, session.first
    path, work = session.path, session.work
    if what == SETTLE:
        verdict, iterations, fallbacks = newton(address, np.inf, 1.0, limits)
        counts[ITERATIONS] += iterations
        counts[FALLBACKS] += fallbacks
        return verdict
    if what == TRY:
        copy_state(own, trial)
    state = trial if what == TRY else own
    for k in range(n_steps):
        if what == FOLLOW:
            _aim_holds(axes, constraints, path, k, state.x)
        if what == ACCEPT:
            copy_state(trial, state)
        else:
            if len(first) > 0:
                if not is_clear(masses, dt):
                    return NEAR
                aim(axes, constraints, masses, first, dt)
            verdict = take_step(
                address, axes, constraints, loads, limits, scheme, dt, state, work, counts
            )
            if verdict != DONE or what == TRY:
                return verdict
        end_step(axes, hose, constraints, loads.contact, state, work.span)
        if len(first) > 0:
            move(axes, constraints, masses, first, dt)
            _push_masses(axes, loads.contact, state, masses)
    return DONE


@kernel
def _push_masses(axes, contact, state, masses):
    """What the hose did to the shapes of masses in a step pushes them in the next."""
    if len(masses.owner) == 0:
        return
    compute_forces(axes, contact, state.x, state.v, contact.forces, contact.reactions)
    masses.push[:, :] = 0.0
    for g in range(len(masses.owner)):
        i = masses.owner[g]
        if i >= 0:
            for c in range(3):
                masses.push[i, c] += contact.reactions[g, c]
    move_shapes(contact.geoms, masses)


@kernel
def advance_verlet(address, what, scheme, n_steps):
    """`advance` for Verlet, which has no iteration and tries nothing."""
    session = unpack(address)
    axes, hose, constraints, loads = session[:4]
    dt, state, counts, work = session.timestep, session.state, session.counts, session.work
    for k in range(n_steps):
        if what == FOLLOW:
            _aim_holds(axes, constraints, session.path, k, state.x)
        verdict = take_verlet_step(axes, hose, constraints, loads, dt, state, work, counts)
        if verdict != DONE:
            return verdict
        end_step(axes, hose, constraints, loads.contact, state, work.span)
    return DONE
