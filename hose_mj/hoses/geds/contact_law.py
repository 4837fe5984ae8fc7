"""The law of contact: how hard a hose and a surface press on each other, and how friction holds.

With gap g = distance - radius and n the outward normal, the normal force per length is

    N = k S (1 + (S / D)^2) - tau N' u.n, at least 0,

S the ramp of `ContactLaw`, whose slope is continuous, and D the depth from which it hardens. The
modulus k = EA / (pi r^2) is the hose's own: at strain e a hose round a post of radius R sinks by
pi e r^2 / (R + r), whatever it weighs, and it hardens before it could be cut.

Friction is elastic, with a return mapping (Simo and Laursen 1992): z is how far a contact point has
moved along the surface since it stuck, less what it slid. It is held by -kt z up to mu N; beyond,
it slides, and z stays at the limit. Below the limit nothing creeps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.protocol import Array
from hose_mj.jit import kernel

(
    STIFFNESS,
    WIDTH,
    HARDENING,
    DAMPING,
    STICK,
    RADIUS,
    MARGIN,
    TIMESTEP,
    SELF_SCALE,
    SELF_WIDTH,
    SELF_FRICTION,
    ROUND,
    OBSTACLES,
) = range(13)
"""Places in `Contact.law`; ROUND is the way round a closed loop (m), infinite in an open hose,
OBSTACLES how many of the shapes are no part of another hose."""
N_NUMBERS = 13
GIVEN = 11
"""Columns of a distance handed in: distance, normal (3), friction, surface velocity (3) and the
place (3) of the contact point that it was measured at."""
SLOTS = 3
"""Surfaces that a contact point sticks to at once: the three sides of a corner. A fourth one does
not rub."""
TOUCHED, IMPACTS, DEEPEST, STAGE, CROSSINGS, PAIRS, SIGHT = range(7)
"""Places in `Contact.found`: pairs of the last build, points that newly touched at speed in the
last step, the greatest depth so far, in radii, the number of the stage, how many points were beyond
the middle of another part of the hose so far, how many were near one at the last build, and how far
apart parts are seen (m)."""


class Contact(NamedTuple):
    """What one hose may touch; coordinates of the hose come first, minus its plane's offset.

    Attributes:
        points: the four basis functions at each contact point, its share of arc length (m) and its
            factor on friction, (Q, 6), span after span.
        first: number of the first contact point of each span, and how many there are, (S + 1,).
        slopes: what a difference of control points is multiplied by for a control point of r',
            (n - 1,), 1/m.
        geoms: one row a shape, see shapes.py, (G, ROW).
        given: distances handed in, one row a contact point, (Q, 11); (0, 11) for none.
        law: numbers of the contact law, (13,); no self-contact where its scale is 0.
        arcs: rest arc lengths of the contact points, (Q,), m.
        memory: what friction remembers at each point of up to three surfaces, (Q, 3, 4): 1 + the
            geom's number + 1, 0 for none, and z (3,), m; written when a step is accepted.
        slides: where points slid to at the build before, (Q, 3, 5): geom as in `memory`, number of
            the stage, direction (3,), zero where it was taken to stick.
        pairs: points that touch or nearly touch at the last build, and the linear model of their
            force there, (Q + 64, 15): point, geom, force (3), stiffness (6), place (3), span.
        block: stiffness of one span's contact, for each pair of its control points, (10, 6).
        found: see `TOUCHED`, (7,).
        changes: derivatives of the basis functions at the contact points, (Q, 4), 1/m.
        room: work space of self-contact, (Q + S, 6).
        mates: what is near to each other of the hose itself, see self_contact.py.
        strands: what was near to each point a step ago, (Q, 2, 8), see self_contact.py.
        forces: of `contact.compute_forces`, (Q, 3), written.
        reactions: of the same, (G, 6), written.
    """

    points: Array
    first: np.ndarray
    slopes: Array
    geoms: Array
    given: Array
    law: Array
    arcs: Array
    memory: Array
    slides: Array
    pairs: Array
    block: Array
    found: Array
    changes: Array
    room: Array
    mates: Array
    strands: Array
    forces: Array
    reactions: Array


class Motion(NamedTuple):
    """How a hose gets to where its contact is asked for.

    Attributes:
        rate: velocity of the control points, flat (n d,).
        start: control points at the beginning of the step, flat.
        before: the same of the part of the step that is being taken, for sweeps.
        step: length of the stage (s), for damping; infinite in statics, where nothing rubs.
        elapsed: since the beginning of the step (s).
        ahead: how far ahead in time the shapes stand, which are where the whole step ends (s).
    """

    rate: Array
    start: Array
    before: Array
    step: float
    elapsed: float
    ahead: float


@kernel
def make_push(width, gap):
    """The ramp S of a gap (m) and its slope by the depth."""
    depth = max(-gap, 0.0)
    if depth < 2.0 * width:
        return depth * depth / (4.0 * width), depth / (2.0 * width)
    return depth - width, 1.0


@kernel
def press(law, scale, gap, away):
    """Normal force per length N and its slope by the depth at rest (N/m^2).

    Args:
        law: numbers of the contact law.
        scale: factor on its stiffness.
        gap: distance of the surfaces (m).
        away: speed at which the hose leaves the surface (m/s).
    """
    push, slope = make_push(law[WIDTH], gap)
    harder = push / law[HARDENING]
    stiffness = scale * law[STIFFNESS]
    slope *= stiffness * (1.0 + 3.0 * harder * harder)
    N = stiffness * push * (1.0 + harder * harder) - law[DAMPING] * slope * away
    return max(N, 0.0), slope


@kernel
def rub(stick, limit, z):
    """Friction of a point that has moved by z (3,) along a surface since it stuck, less its slides.

    Args:
        stick: kt, N/m^2.
        limit: mu N, N/m.
        z: tangential, m.

    Returns:
        force per length (3,), what of z is left (3,), direction of the slide (3,), zero where it
        sticks, and the stiffness across that direction (N/m^2).
    """
    far = np.sqrt(z[0] * z[0] + z[1] * z[1] + z[2] * z[2])
    if stick * far <= limit:
        return (-stick * z[0], -stick * z[1], -stick * z[2]), z, (0.0, 0.0, 0.0), stick
    e = (z[0] / far, z[1] / far, z[2] / far)
    left = limit / stick
    force = (-limit * e[0], -limit * e[1], -limit * e[2])
    return force, (left * e[0], left * e[1], left * e[2]), e, limit / far
