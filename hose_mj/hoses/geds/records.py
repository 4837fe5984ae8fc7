"""Records that the solvers read and write, and the verdicts with which they end.

A solver raises nothing: it returns a verdict, and the boundary (hose.py) turns it into an error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds.basis import Tables
from hose_mj.hoses.geds.contact_law import Contact
from hose_mj.hoses.geds.morison import Morison
from hose_mj.hoses.geds.span import Elasticity, Span, make_span
from hose_mj.hoses.geds.twist import Twist
from hose_mj.hoses.protocol import Array

DONE, NOT_CONVERGED, NOT_FINITE, NOT_POSITIVE, DEPENDENT_CONSTRAINTS = range(5)
VERDICTS = (
    "done",
    "Newton's iteration did not converge",
    "numbers left the finite range",
    "no positive definite stiffness was found",
    "two holds ask for the same thing, or more than the spline can follow there",
)


class Hose(NamedTuple):
    """Constants of one hose.

    Attributes:
        tables: quadrature.
        elasticity: material.
        mass: per coordinate, band (n, 4).
        gyration: rotational inertia about the tangent over mass (m^2), for theta.
        drag_rate: drag per mass c (1/s).
        density: mass per rest length (kg/m).
    """

    tables: Tables
    elasticity: Elasticity
    mass: Array
    gyration: float
    drag_rate: float
    density: float


class Response(NamedTuple):
    """Linear answer, within a step, of the bodies that hold a hose to its forces.

    With F the mean force of the constraints on the hose over a step, they demand
    after - compliance F at its end. A stage knows F as base + share lambda, where lambda
    are its multipliers.

    Attributes:
        compliance: (m, m) over all rows, m/N, not always symmetric; (0, 0) for rigid bodies.
        base: (m,), N, written.
        share: (1,), written.
        gathered: sum of the multipliers of the stages, or parts of a step, before, (m,), written.
        force: F of the last step, (m,), N, written.
    """

    compliance: Array
    base: Array
    share: Array
    gathered: Array
    force: Array


def make_response(n_rows: int) -> Response:
    """Returns the response of m = n_rows rows, all compliances zero."""
    base, gathered, force = np.zeros((3, n_rows))
    return Response(np.zeros((n_rows, n_rows)), base, np.ones(1), gathered, force)


class Springs(NamedTuple):
    """Holds that give way by a spring and a damper, p of them, among the m rows of G.

    Attributes:
        rows: first row of each, and how many rows of slopes it has, (p, 2).
        numbers: stiffness k (N/m), damping c (N s/m), largest force (N) and stiffness against turns
            (N m/rad), (p, 4); an infinite stiffness does not give way.
        softness: by what a force changes the place of each, across the direction of its force and
            along it (m/N), and a moment its slope (1/(N m)), in one iteration, (p, 3), written.
        direction: unit vector of a force at its limit, (p, 3), zero below it, written.
        scale: of its forces over their multipliers, likewise, (p, 3), written.
        weight: most that G^T G may weigh in the matrix, and what it does, (m,), written.
    """

    rows: np.ndarray
    numbers: Array
    softness: Array
    direction: Array
    scale: Array
    weight: Array


def make_springs(rows: np.ndarray, numbers: Array, n_rows: int) -> Springs:
    """Returns springs with these rows (p, 2) and numbers (p, 4) among `n_rows` rows."""
    softness, direction, scale = np.zeros((3, len(rows), 3))
    return Springs(rows, numbers, softness, direction, scale, np.full(n_rows, np.inf))


NO_SPRINGS = make_springs(np.zeros((0, 2), dtype=np.int64), np.zeros((0, 4)), 0)


class Constraints(NamedTuple):
    """m rows of G x = g: clamps, attachments and the joint of a closed loop.

    Attributes:
        start: index of the first of the 4 d unknowns that a row reads, (m,).
        rows: their coefficients, (m, 4 d). In a closed loop (m, 8 d): the last 2 d rows, which join
            its ends (loops.py), also read the last 4 d unknowns.
        before: g at the beginning of a step, (m,).
        after: g at its end, (m,).
        multipliers: lambda at the end of the last step, (m,), written.
        twist: clamps and the twist between them.
        response: of the bodies that hold the hose.
        springs: holds that give way by themselves.
    """

    start: np.ndarray
    rows: Array
    before: Array
    after: Array
    multipliers: Array
    twist: Twist
    response: Response
    springs: Springs = NO_SPRINGS


class Loads(NamedTuple):
    """Dead loads, contact and fluid.

    Attributes:
        force: generalised force on the control points, gravity included, flat (n d,).
        moment_start: index of the first of the 4 d unknowns at each point moment, (k,).
        moment_basis: N and dN/ds there, (k, 2, 4).
        moment: (k, 3) N m; a planar hose reads the first entry.
        contact: obstacles; see contact.py.
        fluid: drag and added mass; see morison.py.
    """

    force: Array
    moment_start: np.ndarray
    moment_basis: Array
    moment: Array
    contact: Contact
    fluid: Morison


class Limits(NamedTuple):
    """When to stop.

    Attributes:
        tolerance: largest move of a control point in the last iteration (m).
        turn_length: what a change of theta is multiplied by to compare with that (m).
        max_iterations: Newton iterations at most.
        rotation_cap: largest turn of a tangent in one iteration (rad).
        line_search: True to shorten steps that run past the lowest point along them.
        constraint_weight: weight of G^T G in the matrix, relative to its mean diagonal; above 0
            where the hose alone has rigid motions (statics). The matrix may be indefinite then, as
            long as the twist's rank-one terms and the constraints make up for it.
        force_tolerance: what a step may leave of the forces, of their scale.
    """

    tolerance: float
    turn_length: float
    max_iterations: int
    rotation_cap: float
    line_search: bool
    constraint_weight: float
    force_tolerance: float


class Soft(NamedTuple):
    """Rows R that add R^T R / D to the matrix: what no band has room for; D may be below zero.

    Attributes:
        rows: R, (P, n d + 4 d), written.
        compliance: D, (P,), m/N, written.
        used: how many there are now, and how many of these have D < 0, (2,), written.
    """

    rows: Array
    compliance: Array
    used: np.ndarray


class Work(NamedTuple):
    """Work arrays of one hose and the multipliers of its constraints.

    x, X and V are a stage, x_now and v_now a step in the making, flat (n d,): nothing reaches the
    state before the step is done; start is where it began. Where rows are counted, `schur`,
    `multipliers` and `shift` have as many as there are, and `lower` one more: holds may ask for
    more rows than there are unknowns.
    """

    span: Span
    gradient: Array
    rate: Array
    band: Array
    signs: Array
    lower: Array
    schur: Array
    multipliers: Array
    shift: Array
    residual: Array
    step: Array
    x: Array
    X: Array
    V: Array
    x_now: Array
    v_now: Array
    start: Array
    soft: Soft


def make_work(n_control_points: int, n_dof: int, n_rows: int, n_soft: int = 0) -> Work:
    """Returns work arrays for n control points of n_dof unknowns each and m rows.

    The rows are those of the constraints and one for each segment that has twist; n_soft are those
    of `Soft` at most.
    """
    size = n_control_points * n_dof
    padded = size + 4 * n_dof
    n_rows += n_soft
    return Work(
        make_span(),
        np.zeros(padded),
        np.zeros(padded),
        np.zeros((padded, 8 * n_dof)),
        np.ones(size),
        np.zeros((n_rows + 1, padded)),
        np.zeros((n_rows, n_rows)),
        np.zeros(n_rows),
        np.zeros(n_rows),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        Soft(np.zeros((n_soft, padded)), np.zeros(n_soft), np.zeros(2, dtype=np.int64)),
    )
