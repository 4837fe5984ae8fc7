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

from hose_mj.hoses.geds.records import VERDICTS
from hose_mj.hoses.geds.shapes import POSITION, ROW, VELOCITY, measure
from hose_mj.hoses.protocol import Array
from hose_mj.jit import kernel

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


def make_none() -> PointMasses:
    """Returns no masses at all."""
    rows = np.zeros((0, 3))
    walls, owner = np.zeros((0, ROW)), np.zeros(0, dtype=np.int64)
    return PointMasses(
        *(rows, rows, rows, rows, rows, np.zeros(0), 3, np.zeros(0), walls, owner, rows, rows)
    )


@kernel
def is_clear(masses, dt):
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
def aim(axes, constraints, masses, first, dt):
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
def move(axes, constraints, masses, first, dt):
    """Moves the masses to where the step has found them."""
    for i in range(len(first)):
        for c in range(len(axes[:3])):
            row = first[i] + c
            gave = constraints.response.compliance[row, row] * constraints.response.force[row]
            place = constraints.after[row] - gave
            masses.velocity[i, c] = (place - masses.position[i, c]) / dt
            masses.position[i, c] = place


@kernel
def move_shapes(geoms, masses):
    """Moves the obstacles that belong to masses."""
    for g in range(len(masses.owner)):
        i = masses.owner[g]
        if i >= 0:
            for c in range(3):
                geoms[g, POSITION + c] = masses.position[i, c] + masses.arm[g, c]
                geoms[g, VELOCITY + c] = masses.velocity[i, c]
