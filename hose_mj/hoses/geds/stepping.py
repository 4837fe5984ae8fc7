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
from hose_mj.jit import kernel

ADVANCE, TRY, ACCEPT, SETTLE = range(4)
"""What `advance` is to do: steps, one step into `trial`, to make that one count, or one solve of
statics in the work arrays."""


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
    work: Work


@kernel
def advance(address, what, scheme, n_steps):
    """Advances a session by n_steps steps of an implicit scheme; returns a verdict.

    That of the last step tried: a step that fails leaves the state at the step before it. `NEAR`
    where a mass may meet something in the next step. See `ADVANCE` for what it is to do.
    """
    session = unpack(address)
    axes, hose, constraints, loads = session.axes, session.hose, session.constraints, session.loads
    limits, dt, own, trial = session.limits, session.timestep, session.state, session.trial
    counts, masses, first, work = session.counts, session.masses, session.first, session.work
    if what == SETTLE:
        verdict, iterations, fallbacks = newton(address, np.inf, 1.0, limits)
        counts[ITERATIONS] += iterations
        counts[FALLBACKS] += fallbacks
        return verdict
    if what == TRY:
        copy_state(own, trial)
    state = trial if what == TRY else own
    for _ in range(n_steps):
        if what == ACCEPT:
            copy_state(trial, state)
        else:
            if len(first) > 0:
                if not is_clear(masses, dt):
                    return NEAR
                aim(axes, constraints, masses, first, dt)
            verdict = take_step(address, axes, constraints, limits, scheme, dt, state, work, counts)
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
    for _ in range(n_steps):
        verdict = take_verlet_step(axes, hose, constraints, loads, dt, state, work, counts)
        if verdict != DONE:
            return verdict
        end_step(axes, hose, constraints, loads.contact, state, work.span)
    return DONE
