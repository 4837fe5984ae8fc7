"""One Newton solver for every implicit stage and for statics, with Lagrange multipliers.

A stage of length h asks for the x with

    M [(x - X - h V) / h^2 + c (x - X) / h] + dU(x) + C (x - X) / h - f - G^T lambda = 0,  G x = g,

and then v = (x - X) / h. Backward Euler: h = dt, X = x_n, V = v_n. BDF2: h = 2 dt / 3,
X = (4 x_n - x_(n-1)) / 3, V likewise. Statics: h infinite. G are the rows of the
constraints; the multipliers lambda are the forces with which they act on the hose (kkt.py).
"""

from __future__ import annotations

import numpy as np

from hose_mj.hoses.geds.band import factorize, factorize_indefinite
from hose_mj.hoses.geds.contact import add_contact, measure_contact_left
from hose_mj.hoses.geds.contact_law import SELF_SCALE, STAGE, TIMESTEP, TOUCHED, Motion
from hose_mj.hoses.geds.energy import assemble
from hose_mj.hoses.geds.frames import shift_clamps
from hose_mj.hoses.geds.kkt import add_constraint_weight, multiply_row, solve_with_constraints
from hose_mj.hoses.geds.morison import add_fluid
from hose_mj.hoses.geds.packing import unpack
from hose_mj.hoses.geds.records import DONE, NOT_CONVERGED, NOT_FINITE, NOT_POSITIVE
from hose_mj.hoses.geds.self_contact import (
    add_self_contact,
    drop_softening,
    limit_move,
    measure_self_left,
)
from hose_mj.hoses.geds.span import LEAST_A
from hose_mj.hoses.geds.twist import predict_twist
from hose_mj.jit import apart, choose_by_unknowns, compiled, inlined, merged

_MOST_SHORTENINGS = 12
"""Of one step: at the least factor of each that is 1e-12 of it, where rounding begins."""
_STEEP = 0.5
"""A step is shortened where the energy rises at its end by more than this part of how it fell at
its start; a lesser rise Newton's next step mends."""
_LEAST_FACTOR, _MOST_FACTOR = 0.1, 0.7
"""Of one shortening: the secant's root, kept from creeping and from giving up the step at once."""

_STUCK = 10.0
"""A residual that is within so many times the tolerance after the last iteration, where points go
on between sticking and sliding, ends a stage all the same, as a fallback."""
_YIELDING = 1e3
"""How much softer a spring at its largest force is along that force than across it: its true
stiffness there is zero, which a matrix of compliances cannot say."""
_ACROSS = 1e-3
"""Of EA over a span: about what a hose under tension resists across itself, where no inertia
does."""
_ROUNDING = 1e-9
"""Of EA: forces below it are not told from rounding, which is 1e-16 EA over a span's share of L."""


@inlined
def multiply_mass(axes, hose, factor, x, out):
    """Adds factor M x to out; x and out flat, the first n d entries count."""
    d = len(axes)
    mass = hose.mass
    n = mass.shape[0]
    for j in range(n):
        for c in range(d):
            scale = factor * (hose.gyration if c == 3 else 1.0)
            out[j * d + c] += scale * mass[j, 0] * x[j * d + c]
        for k in range(1, min(4, n - j)):
            weight = factor * mass[j, k]
            for c in range(d):
                scale = weight * (hose.gyration if c == 3 else 1.0)
                out[(j + k) * d + c] += scale * x[j * d + c]
                out[j * d + c] += scale * x[(j + k) * d + c]


@inlined
def add_mass(axes, hose, factor, band):
    """Adds factor M to a band."""
    d = len(axes)
    for j in range(hose.mass.shape[0]):
        for c in range(d):
            scale = factor * (hose.gyration if c == 3 else 1.0)
            for k in range(4):
                band[j * d + c, k * d] += scale * hose.mass[j, k]


@inlined
def add_moments(axes, loads, exact, x, work):
    """Subtracts the generalised force of the point moments, M x a / A on a = r', from the gradient.

    Its derivative goes into the band: all of it in the plane, its symmetric part in space. What
    lies along the tangent acts on theta where there is one.
    """
    d = len(axes)
    n_places = len(axes[:3])
    a = work.span.a[0]
    turn = work.span.b[0]
    for k in range(len(loads.moment_start)):
        start = loads.moment_start[k]
        A = 0.0
        for c in range(n_places):
            a[c] = 0.0
            for i in range(4):
                a[c] += loads.moment_basis[k, 1, i] * x[start + i * d + c]
            A += a[c] * a[c]
        A = max(A, LEAST_A)
        if d == 2:
            turn[0] = -loads.moment[k, 0] * a[1] / A
            turn[1] = loads.moment[k, 0] * a[0] / A
        else:
            for c in range(3):
                m1 = loads.moment[k, (c + 1) % 3]
                m2 = loads.moment[k, (c + 2) % 3]
                turn[c] = (m1 * a[(c + 2) % 3] - m2 * a[(c + 1) % 3]) / A
        if d == 4:
            along = 0.0
            for c in range(3):
                along += loads.moment[k, c] * a[c] / np.sqrt(A)
            for i in range(4):
                work.gradient[start + 4 * i + 3] -= loads.moment_basis[k, 0, i] * along
        for i in range(4):
            for c1 in range(n_places):
                work.gradient[start + i * d + c1] -= loads.moment_basis[k, 1, i] * turn[c1]
                if not exact:
                    continue
                for j in range(i + 1):
                    weight = loads.moment_basis[k, 1, i] * loads.moment_basis[k, 1, j] / A
                    for c2 in range(n_places if j < i else c1 + 1):
                        bend = turn[c1] * a[c2] + a[c1] * turn[c2]
                        work.band[start + j * d + c2, (i - j) * d + c1 - c2] += weight * bend


@merged
def _make_motion(contact, fraction, h, work):
    """How the hose gets to the end of a stage, at a fraction of the step.

    Merged, because it returns arrays: what is compiled without counts of references may not.
    """
    dt = contact.law[TIMESTEP]
    return Motion(work.rate, work.start, work.x_now, h, fraction * dt, (1.0 - fraction) * dt)


@merged
def build(axes, hose, stage, twist, progress, loads, scale, exact, x, work):
    """Fills work.gradient with the residual without constraints, work.band with its derivative.

    The twist's rank-one terms are not in the band: `solve_with_constraints` adds them.
    """
    h, X, V = stage
    size = len(x)
    for k in range(size):
        work.gradient[k] = -scale * loads.force[k]
        for m in range(4 * len(axes)):
            work.band[k, m] = 0.0
    inertia = 1.0 / (h * h) + hose.drag_rate / h
    if inertia > 0.0:
        for k in range(size):
            work.rate[k] = (x[k] - X[k]) * inertia - V[k] / h
        multiply_mass(axes, hose, 1.0, work.rate, work.gradient)
        add_mass(axes, hose, inertia, work.band)
    for k in range(size):
        work.rate[k] = (x[k] - X[k]) / h
    assemble(
        axes,
        hose,
        twist,
        progress,
        x,
        work.rate,
        h,
        exact,
        work.span,
        work.gradient,
        work.band,
    )
    if len(loads.moment_start) > 0:
        add_moments(axes, loads, exact, x, work)
    if len(loads.fluid.current) > 0 and h < np.inf:
        add_fluid(axes, loads.fluid, h, V, x, work.rate, work.gradient, work.band)
    contact = loads.contact
    if contact.law[SELF_SCALE] > 0.0:
        add_self_contact(axes, contact, x, h, exact, work)
    contact.found[TOUCHED] = 0.0
    if contact.geoms.shape[0] + contact.given.shape[0] > 0:
        motion = _make_motion(contact, progress, h, work)
        add_contact(axes, contact, x, motion, exact, work.gradient, work.band)


@inlined
def _largest_turn(axes, tables, x, shift):
    """Largest angle (small-angle estimate) by which a shift of x turns a tangent."""
    d = len(axes)
    largest = 0.0
    for e in range(tables.first.shape[0]):
        for g in range(3):
            A = 0.0
            square = 0.0
            along = 0.0
            for c in range(len(axes[:3])):
                a = 0.0
                move = 0.0
                for i in range(4):
                    a += tables.first[e, g, i] * x[(e + i) * d + c]
                    move += tables.first[e, g, i] * shift[(e + i) * d + c]
                A += a * a
                square += move * move
                along += a * move
            A = max(A, LEAST_A)
            largest = max(largest, np.sqrt(max(square - along * along / A, 0.0) / A))
    return largest


@apart
def newton(address, h, fraction, limits):
    """Newton's iteration on work.x in place; returns (verdict, iterations, fallbacks).

    Of steps and of statics, compiled once for both.

    A pivot that is not positive is answered with the Gauss-Newton matrix, counted as a fallback.

    Args:
        address: of the `stepping.Session`; its work arrays hold X, V and a guess x, and the
            multipliers on return.
        h: length of the stage (s); infinite in statics.
        fraction: where in the step the constraints' demand is taken, 0 to 1.
        limits: when to stop.
    """
    session = unpack(address)
    axes, hose, constraints = session.axes, session.hose, session.constraints
    loads, scale, work = session.loads, session.load_scale, session.work
    x, stage, twist = work.x, (h, work.X, work.V), constraints.twist
    fallbacks, shortened, iteration = 0, 0, 1
    exact = fallbacks == 0  # no constant: for one numba would compile all that takes it twice
    factor = slope = 0.0
    softness = 1.0 / (1.0 + hose.elasticity.damping_time / h)
    loads.contact.found[STAGE] += 1.0
    while True:
        build(axes, hose, stage, twist, fraction, loads, scale, exact, x, work)
        # Constraints not yet met come first: the line search starts from a point that meets them.
        if limits.line_search and exact and iteration > 2 and shortened < _MOST_SHORTENINGS:
            shorter = _shorten(constraints.springs, factor, slope, work)
            if shorter != factor:
                _move(twist, shorter - factor, x, work)
                factor = shorter
                shortened += 1
                continue
        _prepare_constraints(axes, hose, constraints, stage, fraction, loads, limits, x, work)
        verdict = _solve(axes, constraints, fraction, softness, exact, limits, len(x), work)
        if verdict == NOT_POSITIVE and exact:
            exact = False
            fallbacks += 1
            continue
        if verdict != DONE:
            return verdict, iteration, fallbacks
        largest, slope = _measure_step(axes, limits, len(x), work)
        if not np.isfinite(largest):
            return NOT_FINITE, iteration, fallbacks
        factor = _find_factor(axes, hose, loads.contact, limits, x, work)
        _move(twist, factor, x, work)
        if factor == 1.0 and largest <= limits.tolerance:
            left = _measure_left(axes, hose, stage, constraints, fraction, loads, x, work)
            if left <= limits.force_tolerance:
                return DONE, iteration, fallbacks
            if iteration == limits.max_iterations and left <= _STUCK * limits.force_tolerance:
                return DONE, iteration, fallbacks + 1
        if iteration == limits.max_iterations:
            return NOT_CONVERGED, iteration, fallbacks
        iteration += 1
        exact, shortened = True, 0


@inlined
def _find_factor(axes, hose, contact, limits, x, work):
    """What part of a step is taken: all of it, unless it turns or moves something too far."""
    factor = 1.0
    if limits.rotation_cap < np.inf:
        turn = _largest_turn(axes, hose.tables, x, work.step)
        if turn > limits.rotation_cap:
            factor = limits.rotation_cap / turn
    if contact.law[SELF_SCALE] > 0.0:
        factor = min(factor, limit_move(axes, contact, work.step))
    return factor


@inlined
def _measure_scale(hose, stage, constraints, loads, x, work):
    """The force (N) that a residual is compared with: loads, inertia, holds.

    What is left of EA keeps rounding out where there is none of these.
    """
    h, X, V = stage
    force, inertia = 0.0, 0.0
    for k in range(len(x)):
        force += abs(loads.force[k])
        inertia += abs((x[k] - X[k]) / h - V[k]) / h
    force += inertia * hose.density * hose.tables.span_length
    for row in range(len(constraints.start)):
        # One for a row of a place, none for one of a slope.
        share = 0.0
        for k in range(constraints.rows.shape[1]):
            share += constraints.rows[row, k]
        force += abs(share * work.multipliers[row])
    return force + _ROUNDING * hose.elasticity.axial_stiffness[0]


@inlined
def _measure_strain_left(axes, hose, step):
    """The largest axial force (N) that a step leaves: EA times its strain of second order."""
    d, tables = len(axes), hose.tables
    largest = 0.0
    for e in range(tables.first.shape[0]):
        square = 0.0
        for g in range(3):
            f0, f1 = tables.first[e, g, 0], tables.first[e, g, 1]
            f2, f3 = tables.first[e, g, 2], tables.first[e, g, 3]
            for c in range(len(axes[:3])):
                k = e * d + c
                turn = f0 * step[k] + f1 * step[k + d] + f2 * step[k + 2 * d] + f3 * step[k + 3 * d]
                square += tables.weights[g] * turn * turn
        largest = max(largest, 0.5 * hose.elasticity.axial_stiffness[e] * square)
    return largest


@inlined
def _measure_left(axes, hose, stage, constraints, fraction, loads, x, work):
    """What the step in work.step to x leaves of the forces, as part of their scale."""
    left = _measure_strain_left(axes, hose, work.step)
    contact = loads.contact
    h, X, _ = stage
    for k in range(len(x)):
        work.rate[k] = (x[k] - X[k]) / h
    if contact.law[SELF_SCALE] > 0.0:
        left += measure_self_left(axes, contact, x, h, work)
    if contact.found[TOUCHED] > 0.0:
        motion = _make_motion(contact, fraction, h, work)
        left += measure_contact_left(axes, contact, x, motion)
    return left / _measure_scale(hose, stage, constraints, loads, x, work)


@inlined
def _shorten(springs, factor, slope, work):
    """Returns a shorter factor for work.step where it runs past the lowest point, else factor.

    The gradient knows nothing of springs: with any the whole step is taken.
    """
    if len(springs.rows) > 0:
        return factor
    turned = 0.0
    for k in range(len(work.step)):
        turned += work.gradient[k] * work.step[k]
    if turned > _STEEP * abs(slope):
        return factor * min(max(slope / (slope - turned), _LEAST_FACTOR), _MOST_FACTOR)
    return factor


@inlined
def _move(twist, factor, x, work):
    """Moves x by factor times work.step and foresees the twist there."""
    for k in range(len(x)):
        x[k] += factor * work.step[k]
    predict_twist(twist, factor, work.step)


@inlined
def _solve(axes, constraints, fraction, softness, exact, limits, size, work):
    """Factorizes and solves one iteration's system; work.residual keeps the residual."""
    n_negative = 0
    if limits.constraint_weight > 0.0 and exact:
        n_negative = factorize_indefinite(axes, size, work.band, work.signs)
    elif not factorize(axes, size, work.band):
        n_negative = -1
    if n_negative < 0:
        return NOT_POSITIVE
    for k in range(size):
        work.residual[k] = work.gradient[k]
    compliance_factor = fraction * constraints.response.share[0]
    while True:
        verdict = solve_with_constraints(
            axes, constraints, compliance_factor, softness, n_negative, size, work
        )
        if verdict != NOT_POSITIVE or work.soft.used[1] == 0:
            return verdict
        # Along what nothing holds, as a knot without friction, contact softens too much.
        drop_softening(work.soft)


@inlined
def _measure_step(axes, limits, size, work):
    """Takes the step from work.gradient; returns its largest entry (m) and the work of residual."""
    largest = 0.0
    slope = 0.0
    for k in range(size):
        work.step[k] = work.gradient[k]
        slope += work.residual[k] * work.step[k]
        size_of = limits.turn_length if len(axes) == 4 and k % 4 == 3 else 1.0
        largest = max(largest, abs(work.step[k]) * size_of)
    return largest, slope


@inlined
def _shift(axes, twist, fraction, shift):
    shift_clamps(twist, fraction, shift)


_shift_clamps = choose_by_unknowns({4: _shift})


@inlined
def _prepare_springs(axes, hose, constraints, stage, dt, x, work):
    """Writes the softness of springs, and into work.shift what they are to give way by.

    A spring does K y to the hose at the place after the step dx to come, K = k + c / h and
    K y = k gap + c gap', as long as that is below its largest force F: G dx + lambda / K = y.
    Beyond, lambda = F t / |t| with t = lambda + r (y - G dx - lambda / K), as for Coulomb's law
    (Alart and Curnier 1991); any r has the same solution, and one like the hose's own stiffness
    finds it however stiff the spring is.
    """
    h, X, _ = stage
    d, size, springs, span = len(axes[:3]), len(x), constraints.springs, hose.tables.span_length
    own = hose.density * span / (h * h) + _ACROSS * hose.elasticity.axial_stiffness[0] / span
    for row in range(len(springs.weight)):
        springs.weight[row] = np.inf
    for p in range(len(springs.rows)):
        first, stiffness = springs.rows[p, 0], springs.numbers[p, 0]
        for k in range(3):
            springs.softness[p, k] = springs.direction[p, k] = 0.0
            springs.scale[p, k] = 1.0
        springs.softness[p, 2] = 1.0 / springs.numbers[p, 3]
        for row in range(first + d, first + d + springs.rows[p, 1]):
            springs.weight[row] = 0.5 * springs.numbers[p, 3]
        if stiffness == np.inf:
            continue
        # Nothing moves in a stage without end.
        damping = springs.numbers[p, 1] if h < np.inf else 0.0
        whole = stiffness + damping / h
        r = min(whole, own)
        square = 0.0
        for c in range(d):
            row = first + c
            rate = (constraints.after[row] - constraints.before[row]) / dt
            rate -= multiply_row(axes, constraints, row, x, size) / h
            rate += multiply_row(axes, constraints, row, X, size) / h
            work.shift[row] = (stiffness * work.shift[row] + damping * rate) / whole
            pull = work.multipliers[row] * (1.0 - r / whole) + r * work.shift[row]
            springs.direction[p, c] = pull
            square += pull * pull
        over = np.sqrt(square) / springs.numbers[p, 2]
        across = (max(over, 1.0) - 1.0 + r / whole) / r
        along = across * _YIELDING if over > 1.0 else across
        springs.softness[p, 0], springs.softness[p, 1] = across, along
        gap = 0.0
        for c in range(d):
            springs.weight[first + c] = 0.5 / along
            springs.direction[p, c] *= 1.0 / np.sqrt(square) if over > 1.0 else 0.0
            gap += springs.direction[p, c] * work.shift[first + c]
        for c in range(d):
            aim = along * springs.numbers[p, 2] - gap if over > 1.0 else 0.0
            work.shift[first + c] += aim * springs.direction[p, c]


@inlined
def _prepare_constraints(axes, hose, constraints, stage, fraction, loads, limits, x, work):
    """Writes g - G x into work.shift and adds the constraints' weight to the matrix."""
    for row in range(len(constraints.start)):
        before = constraints.before[row]
        wanted = before + fraction * (constraints.after[row] - before)
        response = constraints.response
        for other in range(len(response.compliance)):
            wanted -= fraction * response.compliance[row, other] * response.base[other]
        work.shift[row] = wanted - multiply_row(axes, constraints, row, x, len(x))
    _shift_clamps(axes, constraints.twist, fraction, work.shift)
    _prepare_springs(axes, hose, constraints, stage, loads.contact.law[TIMESTEP], x, work)
    if limits.constraint_weight > 0.0:
        add_constraint_weight(axes, constraints, limits.constraint_weight, len(x), work)


@compiled
def is_positive(axes, hose, constraints, least_rate, work):
    """Whether stiffness plus `least_rate` times mass is positive definite on what rows leave free.

    A motion that grows must grow faster than a rate: rounding alone, or a motion that nothing
    resists (a hanging hose about the vertical, a hose without holds), is not called unstable.

    Args:
        axes: (0.0,) * n_dof.
        hose: constants.
        constraints: holds and twist, at the present shape.
        least_rate: (1/s^2).
        work: with the exact stiffness in its band; written.
    """
    size = len(work.signs)
    add_mass(axes, hose, least_rate, work.band)
    for k in range(len(work.gradient)):
        work.gradient[k] = 0.0
    for row in range(len(work.shift)):
        work.shift[row] = 0.0
    add_constraint_weight(axes, constraints, 1.0, size, work)
    n_negative = factorize_indefinite(axes, size, work.band, work.signs)
    if n_negative < 0:
        return False
    verdict = solve_with_constraints(axes, constraints, 0.0, 1.0, n_negative, size, work)
    return verdict != NOT_POSITIVE
