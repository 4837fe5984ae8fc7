"""The literal twist strain of GEDS: theta' plus the Frenet torsion of the centre line (thesis A.9).

Theetten, Grisoni, Andriot, Barsky (2008) measure theta from the Frenet normal of the centre line:

    tau = theta' + N / D,    N = det(r', r'', r'''),    D = |r' x r''|^2.

Only for reproduction: the second term has no value where the hose is straight or inflects, and
r''' of a cubic jumps at the knots (docs/frenet.md). Needs no director, so bending is that of
energy.py. With c = r''', constant in a span and made of r'' at its outer Gauss points,

    d tau = (dN - (N / D) dD) / D,
    d2 tau = (d2N - (N / D) d2D - d tau dD^T - dD d tau^T) / D

where N_a = b x c, N_b = c x a, N_c = a x b; D_a = 2 (B a - C b), D_b = 2 (A b - C a).
"""

from __future__ import annotations

from hose_mj.jit import kernel

SMALLEST_BEND = 1e-8
"""Turn of the tangent in a span (rad) below which D stays what it is there: 1 / D is then finite.

Rounding alone bends a straight hose by some 1e-14."""


@kernel
def compute_frenet_twist(tables, g, p):
    """Returns tau and 1 / D at Gauss point g of the span whose r' and r'' are in p.

    Writes the derivatives of N / D by a, b and c to p.strains[:, 0] and those of D to
    p.strains[:, 1].
    """
    a0, a1, a2 = p.a[g, 0], p.a[g, 1], p.a[g, 2]
    b0, b1, b2 = p.b[g, 0], p.b[g, 1], p.b[g, 2]
    scale = 1.0 / ((tables.gaps[1] + tables.gaps[2]) * tables.span_length)
    c0 = scale * (p.b[2, 0] - p.b[0, 0])
    c1 = scale * (p.b[2, 1] - p.b[0, 1])
    c2 = scale * (p.b[2, 2] - p.b[0, 2])
    w0, w1, w2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    square = w0 * w0 + w1 * w1 + w2 * w2
    smallest = (SMALLEST_BEND / tables.span_length) ** 2
    keep = 2.0 if square > smallest else 0.0
    inverse = 1.0 / max(square, smallest)
    torsion = (w0 * c0 + w1 * c1 + w2 * c2) * inverse
    s = p.strains
    # D_a = 2 b x (a x b), D_b = 2 (a x b) x a.
    s[0, 1, 0], s[1, 1, 0] = keep * (b1 * w2 - b2 * w1), keep * (w1 * a2 - w2 * a1)
    s[0, 1, 1], s[1, 1, 1] = keep * (b2 * w0 - b0 * w2), keep * (w2 * a0 - w0 * a2)
    s[0, 1, 2], s[1, 1, 2] = keep * (b0 * w1 - b1 * w0), keep * (w0 * a1 - w1 * a0)
    s[0, 0, 0], s[1, 0, 0], s[2, 0, 0] = b1 * c2 - b2 * c1, c1 * a2 - c2 * a1, w0
    s[0, 0, 1], s[1, 0, 1], s[2, 0, 1] = b2 * c0 - b0 * c2, c2 * a0 - c0 * a2, w1
    s[0, 0, 2], s[1, 0, 2], s[2, 0, 2] = b0 * c1 - b1 * c0, c0 * a1 - c1 * a0, w2
    for c in range(3):
        s[2, 1, c] = 0.0
        for k in range(3):
            s[k, 0, c] = (s[k, 0, c] - torsion * s[k, 1, c]) * inverse
    return p.a[g, 3] + torsion, inverse


@kernel
def compute_frenet_energy(tables, elasticity, e, p):
    """Returns the twisting energy of span e (J), whose r' and r'' are in p."""
    energy = 0.0
    for g in range(3):
        twist = compute_frenet_twist(tables, g, p)[0] - elasticity.rest_torsion[e, g]
        half = 0.5 * tables.weights[g] * tables.span_length
        energy += half * elasticity.torsional_stiffness[e, g] * twist**2
    return energy


@kernel
def _find_slope(tables, e, g, k, i):
    """Derivative of a (k = 0), b (1) or c (2) at Gauss point g by control point i of span e."""
    if k == 0:
        return tables.first[e, g, i]
    if k == 1:
        return tables.second[e, g, i]
    width = (tables.gaps[1] + tables.gaps[2]) * tables.span_length
    return (tables.second[e, 2, i] - tables.second[e, 0, i]) / width


@kernel
def _compute_change(tables, e, g, i, c, p):
    """Derivative of tau at Gauss point g by unknown c of control point i of span e."""
    if c == 3:
        return tables.first[e, g, i]
    change = 0.0
    for k in range(3):
        change += p.strains[k, 0, c] * _find_slope(tables, e, g, k, i)
    return change


@kernel
def add_frenet(tables, elasticity, e, rate, step, exact, p, gradient, band):
    """Adds force and stiffness of the twist in span e, Kelvin-Voigt terms included.

    Args:
        tables: quadrature tables.
        elasticity: material constants.
        e: span; its r' and r'' are in p.
        rate: velocity of the unknowns, flat; read only where there is damping.
        step: the stage's time step (s), infinite in statics.
        exact: 1.0 for the Hessian, 0.0 for its Gauss-Newton part.
        p: work arrays.
        gradient: (n d + 4 d,), added to.
        band: lower band, added to.
    """
    start = 4 * e
    for g in range(3):
        twist, inverse = compute_frenet_twist(tables, g, p)
        stiffness = tables.weights[g] * tables.span_length * elasticity.torsional_stiffness[e, g]
        torque = stiffness * (twist - elasticity.rest_torsion[e, g])
        stress = torque
        if elasticity.damping_time != 0.0:
            for row in range(16):
                change = _compute_change(tables, e, g, row // 4, row % 4, p)
                stress += elasticity.damping_time * stiffness * change * rate[start + row]
        viscous = stiffness * (1.0 + elasticity.damping_time / step)
        for row in range(16):
            change = _compute_change(tables, e, g, row // 4, row % 4, p)
            gradient[start + row] += stress * change
            for column in range(row + 1):
                other = _compute_change(tables, e, g, column // 4, column % 4, p)
                band[start + column, row - column] += viscous * change * other
        if exact != 0.0:
            _add_second_derivatives(tables, e, g, torque * inverse, twist - p.a[g, 3], p, band)


@kernel
def _add_second_derivatives(tables, e, g, stress, torsion, p, band):
    """Adds what the torque over D, `stress`, times D d2 tau (see above) makes."""
    for row in range(16):
        for column in range(row + 1):
            c1, c2 = row % 4, column % 4
            if c1 == 3 or c2 == 3:
                continue
            total = 0.0
            for k in range(3):
                for m in range(3):
                    slopes = _find_slope(tables, e, g, k, row // 4) * _find_slope(
                        tables, e, g, m, column // 4
                    )
                    total += slopes * _compute_second(tables, g, k, c1, m, c2, torsion, p)
            band[4 * e + column, row - column] += stress * total


@kernel
def _compute_second(tables, g, k, c1, m, c2, torsion, p):
    """D times the second derivative of tau by coordinates c1 of a, b or c (k) and c2 (of m)."""
    s = p.strains
    second = -(s[k, 0, c1] * s[m, 1, c2] + s[k, 1, c1] * s[m, 0, c2])
    if k != m and c1 != c2:
        # N = det(a, b, c): the third of a, b and c, in the third coordinate, with its sign.
        c3 = 3 - c1 - c2
        if k + m == 1:
            width = (tables.gaps[1] + tables.gaps[2]) * tables.span_length
            third = (p.b[2, c3] - p.b[0, c3]) / width
        else:
            third = p.b[g, c3] if k + m == 2 else p.a[g, c3]
        is_even = ((m - k) % 3 == 1) == ((c2 - c1) % 3 == 1)
        second += third if is_even else -third
    if k == 2 or m == 2 or _is_floored(p):
        return second
    unit = 1.0 if c1 == c2 else 0.0
    A, B, C = 0.0, 0.0, 0.0
    for c in range(3):
        A += p.a[g, c] * p.a[g, c]
        B += p.b[g, c] * p.b[g, c]
        C += p.a[g, c] * p.b[g, c]
    if k == m:
        other1 = p.b[g, c1] if k == 0 else p.a[g, c1]
        other2 = p.b[g, c2] if k == 0 else p.a[g, c2]
        return second - 2.0 * torsion * ((B if k == 0 else A) * unit - other1 * other2)
    # By a coordinate i of a and j of b: 2 (2 a_i b_j - b_i a_j - C unit).
    i, j = (c1, c2) if k == 0 else (c2, c1)
    mixed = 2.0 * p.a[g, i] * p.b[g, j] - p.b[g, i] * p.a[g, j] - C * unit
    return second - 2.0 * torsion * mixed


@kernel
def _is_floored(p):
    """Whether D is held at its smallest value: then it has no derivative."""
    largest = 0.0
    for c in range(3):
        largest = max(largest, abs(p.strains[1, 1, c]))
    return largest == 0.0
