"""Point masses at the attachments of a hose, stepped with it in compiled code.

Over a step of dt a mass m with drag c, under a force u of the user's and the mean force F that it
does to the hose, goes by

    v' = v + dt (u - c v - F) / (m + c dt),    p' = p + dt v',

which is what MuJoCo's implicit integrators make of a body on slides. So p' is p + dt v' at F = 0
less F dt^2 / (m + c dt), the compliance of its hold. Shapes that move with the masses touch the
hose; what it does to them in a step pushes the masses in the next.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.contact import compute_forces
from hose_mj.hoses.geds.integrators import end_step, take_step
from hose_mj.hoses.geds.records import DONE, VERDICTS, make_work
from hose_mj.hoses.geds.shapes import POSITION, VELOCITY, measure
from hose_mj.hoses.protocol import Array
from hose_mj.jit import compiled, kernel

NEAR = len(VERDICTS)
"""Verdict: a mass may meet something in the next step."""


class PointMasses(NamedTuple):
    """k masses; the coordinates of the hose come first, without its plane's offset.

    Attributes:
        position: (k, 3), m, changed.
        velocity: (k, 3), m/s, changed.
        mass: (k, 3), kg; infinite where it cannot move that way.
        drag: (k, 3), N s/m.
        force: the user's, (k, 3), N.
        radius: masses farther apart than the sum of theirs do not meet, (k,), m.
        across: in so many of the dimensions that is measured, 2 or 3.
        reach: no part of it is farther off than this, (k,), m.
        walls: shapes that stop masses, rows as in shapes.py, (W, ROW).
        owner: mass that each obstacle of the hose moves with, -1 for none, (G,).
        arm: from the mass to the obstacle's position, (G, 3), m.
        push: what the hose's contact did to the masses in the last step, (k, 3), N, changed.
    """

    position: Array
    velocity: Array
    mass: Array
    drag: Array
    force: Array
    radius: Array
    across: int
    reach: Array
    walls: Array
    owner: np.ndarray
    arm: Array
    push: Array


@kernel
def _is_clear(masses, dt):
    """Whether no mass can meet another or a wall within the next step."""
    for i in range(len(masses.reach)):
        speed = 0.0
        for c in range(3):
            speed += masses.velocity[i, c] ** 2
        way = 2.0 * dt * np.sqrt(speed)
        for j in range(i):
            other = 0.0
            apart = 0.0
            for c in range(masses.across):
                other += masses.velocity[j, c] ** 2
                apart += (masses.position[i, c] - masses.position[j, c]) ** 2
            room = masses.radius[i] + masses.radius[j] + way + 2.0 * dt * np.sqrt(other)
            if apart < room * room:
                return False
        at = (masses.position[i, 0], masses.position[i, 1], masses.position[i, 2])
        for w in range(masses.walls.shape[0]):
            if measure(masses.walls, w, at)[0] < masses.reach[i] + way:
                return False
    return True


@kernel
def _aim(axes, constraints, masses, first, dt):
    """Writes where the masses would be without the hose, and their compliance."""
    for i in range(len(first)):
        for c in range(len(axes[:3])):
            row = first[i] + c
            resistance = masses.mass[i, c] + dt * masses.drag[i, c]
            force = masses.force[i, c] + masses.push[i, c]
            force -= masses.drag[i, c] * masses.velocity[i, c]
            speed = masses.velocity[i, c] + dt * force / resistance
            constraints.after[row] = masses.position[i, c] + dt * speed
            constraints.response.compliance[row, row] = dt * dt / resistance


@kernel
def _move(axes, constraints, masses, first, dt):
    """Moves the masses to where the step has found them."""
    for i in range(len(first)):
        for c in range(len(axes[:3])):
            row = first[i] + c
            gave = constraints.response.compliance[row, row] * constraints.response.force[row]
            place = constraints.after[row] - gave
            masses.velocity[i, c] = (place - masses.position[i, c]) / dt
            masses.position[i, c] = place


@kernel
def _move_shapes(geoms, masses):
    """Moves the obstacles that belong to masses."""
    for g in range(len(masses.owner)):
        i = masses.owner[g]
        if i >= 0:
            for c in range(3):
                geoms[g, POSITION + c] = masses.position[i, c] + masses.arm[g, c]
                geoms[g, VELOCITY + c] = masses.velocity[i, c]


@compiled
def advance_with_masses(axes, hose, constraints, loads, limits, run, state, counts, masses, first):
    """Advances hose and masses by up to n_steps steps; returns a verdict, `NEAR` among them.

    As `schemes.advance`, with `run` the scheme, dt and n_steps, and `first` the first rows of the
    masses' constraints, (k,).
    """
    scheme, dt, n_steps = run
    n_rows = len(constraints.start) + len(constraints.twist.angle)
    work = make_work(hose.mass.shape[0], len(axes), n_rows)
    contact = loads.contact
    forces = np.zeros((contact.points.shape[0], 3))
    reactions = np.zeros((contact.geoms.shape[0], 6))
    for _ in range(n_steps):
        if not _is_clear(masses, dt):
            return NEAR
        _aim(axes, constraints, masses, first, dt)
        verdict = take_step(axes, hose, constraints, loads, limits, scheme, dt, state, work, counts)
        if verdict != DONE:
            return verdict
        end_step(axes, hose, constraints, contact, state, work.span)
        _move(axes, constraints, masses, first, dt)
        if len(masses.owner) > 0:
            compute_forces(axes, contact, state.x, state.v, forces, reactions)
            masses.push[:, :] = 0.0
            for g in range(len(masses.owner)):
                i = masses.owner[g]
                if i >= 0:
                    for c in range(3):
                        masses.push[i, c] += reactions[g, c]
            _move_shapes(contact.geoms, masses)
    return DONE
