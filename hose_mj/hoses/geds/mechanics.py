"""What stands between `GedsHose` and the kernels: constants, dense matrices, tension, twist.

A hose may vary along its length. A Gauss point stands for a cell of its span as long as its weight,
and has the mean of that cell: a short coupling between two Gauss points is not lost, and the mass
is right to the last gram.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hose_mj.errors import InputError, check_choice
from hose_mj.hoses.geds import basis, integrators, newton, records
from hose_mj.hoses.geds.frenet import SMALLEST_BEND
from hose_mj.hoses.geds.span import Elasticity
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.geds.twist import Twist, find_owners
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec
from hose_mj.jit import compile_notice


def check_twist(form: str | None, spec: HoseSpec, plane: str | None) -> bool:
    """Returns True for a hose with theta; raises `InputError` for a form that cannot do it."""
    if form is not None and (
        not isinstance(form, str) or form not in ("scalar", "theta", "frenet")
    ):
        raise InputError("twist", form, "None, scalar, theta, frenet")
    stiffened = any(fitting.bending_stiffness is not None for fitting in spec.fittings)
    if spec.bending_stiffness == 0.0 and (stiffened or not spec.is_isotropic):
        valid = "above 0 for a hose with a rest curvature, a second stiffness or a fitting's"
        raise InputError("bending_stiffness", 0.0, valid)
    if plane is not None:
        if form is not None:
            raise InputError("twist", form, "None for a hose in a plane")
        return False
    if form in ("scalar", "frenet") and not spec.is_isotropic:
        valid = "theta for a hose that is curved at rest or bends unequally"
        raise InputError("twist", form, valid)
    if form in ("theta", "frenet") and spec.torsional_stiffness == 0.0:
        raise InputError("torsional_stiffness", 0.0, f"a number above 0 with {form}")
    return form in ("theta", "frenet") or not spec.is_isotropic


def check_scheme(scheme: str, spec: HoseSpec, has_theta: bool, has_fluid: bool) -> None:
    """Raises `InputError` for an unknown scheme, or one that cannot do what the hose needs."""
    check_choice("scheme", scheme, integrators.SCHEMES)
    if scheme == "verlet" and has_theta:
        raise InputError("scheme", scheme, "an implicit scheme for a hose with theta")
    if scheme == "verlet" and (spec.damping_time > 0.0 or spec.drag > 0.0 or has_fluid):
        valid = "an implicit scheme for a hose with damping, with drag or in a fluid"
        raise InputError("scheme", scheme, valid)


def make_constants(spec: HoseSpec, knots: Array, frenet: bool = False) -> records.Hose:
    """Returns what the kernels need to know of a hose with these knots (n + 4,).

    `frenet`: whether its theta is measured from the Frenet normal (frenet.py).
    """
    with compile_notice("GEDS kernels"):
        tables = basis.make_tables(knots)
    n_spans = len(tables.first)
    spans = make_cells(np.ones(1), n_spans, spec.length)[:, 0]
    cells = make_cells(tables.weights, n_spans, spec.length)
    bending = average_stiffness(spec, "bending_stiffness", cells)
    second = spec.second_bending_stiffness or spec.bending_stiffness
    elasticity = Elasticity(
        average_stiffness(spec, "axial_stiffness", spans),
        bending,
        bending * (second / spec.bending_stiffness if spec.bending_stiffness > 0.0 else 1.0),
        average_stiffness(spec, "torsional_stiffness", cells),
        np.full(n_spans, spec.rest_strain, dtype=np.float64),
        np.full((n_spans, 3), spec.rest_curvature, dtype=np.float64),
        np.full((n_spans, 3), spec.rest_torsion, dtype=np.float64),
        float(spec.damping_time),
        frenet,
    )
    quarters = make_cells(basis.MASS_WEIGHTS, n_spans, spec.length)
    mass = basis.make_mass(knots, average_density(spec, quarters))
    # Of a solid round section about its axis.
    gyration = 0.5 * spec.outer_radius**2
    drag_rate = float(spec.drag / spec.linear_density)
    return records.Hose(tables, elasticity, mass, gyration, drag_rate, float(spec.linear_density))


def make_cells(weights: Array, n_spans: int, length: float) -> Array:
    """Returns where the cells of Gauss points with these weights (k,) begin and end, (S, k, 2)."""
    edges = np.concatenate([[0.0], np.cumsum(weights)])
    inside = np.stack([edges[:-1], edges[1:]], axis=1)
    return np.asarray((np.arange(n_spans)[:, None, None] + inside) * length / n_spans)


def average_stiffness(spec: HoseSpec, name: str, cells: Array) -> Array:
    """Returns the stiffness of cells (..., 2) whose pieces are springs in series.

    It is the inverse of the mean softness; 0 everywhere if the hose itself has none.
    """
    if getattr(spec, name) == 0.0:
        return np.zeros(cells.shape[:-1])
    return 1.0 / _average(spec, name, cells, lambda value: 1.0 / value)


def average_density(spec: HoseSpec, cells: Array) -> Array:
    """Returns the mean mass per length of cells (..., 2), kg/m."""
    return _average(spec, "linear_density", cells, lambda value: value)


def list_mass_points(spec: HoseSpec, n_spans: int) -> tuple[Array, Array]:
    """Returns arc lengths (k,), m, and masses (k,), kg, of the Gauss points of the mass matrix."""
    nodes = np.polynomial.legendre.leggauss(len(basis.MASS_WEIGHTS))[0]
    length = spec.length / n_spans
    places = (np.arange(n_spans)[:, None] + 0.5 + 0.5 * nodes) * length
    density = average_density(spec, make_cells(basis.MASS_WEIGHTS, n_spans, spec.length))
    return places.ravel(), (density * basis.MASS_WEIGHTS * length).ravel()


def _average(spec: HoseSpec, name: str, cells: Array, convert: Callable[[float], float]) -> Array:
    """Mean of what is made of a property over cells (..., 2)."""
    own = convert(float(getattr(spec, name)))
    mean = np.full(cells.shape[:-1], own)
    for fitting in spec.fittings:
        value = getattr(fitting, name)
        if value is not None:
            common = np.minimum(cells[..., 1], fitting.end) - np.maximum(
                cells[..., 0], fitting.start
            )
            share = np.maximum(common, 0.0) / (cells[..., 1] - cells[..., 0])
            mean += share * (convert(float(value)) - own)
    return mean


def multiply_mass(axes: tuple[float, ...], hose: records.Hose, flat: Array) -> Array:
    """Returns M times a flat vector."""
    out = np.zeros(len(flat))
    newton.multiply_mass(axes, hose, 1.0, flat, out)
    return out


def make_dense(band: Array, size: int, width: int) -> Array:
    """Returns the symmetric matrix (size, size) of a lower band stored by columns."""
    dense = np.zeros((size, size))
    for k in range(width):
        rows = np.arange(k, size)
        dense[rows, rows - k] = band[: size - k, k]
        dense[rows - k, rows] = band[: size - k, k]
    return dense


def make_dense_rows(constraints: records.Constraints, size: int, width: int) -> Array:
    """Returns the constraints' rows, which read `width` unknowns each, as a matrix (m, size)."""
    dense = np.zeros((len(constraints.start), size))
    for row, start in enumerate(constraints.start):
        dense[row, start : start + width] = constraints.rows[row, :width]
    if constraints.rows.shape[1] > width:
        dense[:, size - width :] += constraints.rows[:, width:]
    return dense


def interpolate_tension(forces: Array, length: float, s: Array) -> Array:
    """Returns the axial force (k,) N at arc lengths s (k,) from that of the strain modes (S, 2), N.

    Linear between the means at the spans' middles; the end spans know their own slope, sqrt(3) xi
    times the linear mode, xi = -1 .. 1.
    """
    mean, linear = forces.T
    middles = (np.arange(len(mean)) + 0.5) * length / len(mean)
    nodes = np.concatenate([[0.0], middles, [length]])
    first = mean[0] - np.sqrt(3.0) * linear[0]
    last = mean[-1] + np.sqrt(3.0) * linear[-1]
    return np.asarray(np.interp(s, nodes, np.concatenate([[first], mean, [last]])))


def get_torsional_stiffness(hose: records.Hose, s: Array) -> Array:
    """Returns GJ (k,) of the cells that arc lengths s (k,) are in."""
    stiffness = hose.elasticity.torsional_stiffness
    edges = make_cells(
        hose.tables.weights, len(stiffness), hose.tables.span_length * len(stiffness)
    )
    at = np.searchsorted(edges.reshape(-1, 2)[:-1, 1], s, side="right")
    return np.asarray(stiffness.ravel()[at])


def compute_torsion(spline: Spline, hose: records.Hose, s: Array, x: Array) -> Array:
    """Returns the Frenet torsion (k,), rad/m, at arc lengths s (k,); see frenet.py."""
    length = hose.tables.span_length
    first, second = (spline.evaluate(s, x, derivative) for derivative in (1, 2))
    # r'' is linear in a span: two places in it give the next derivative.
    low = np.minimum(s // length, len(hose.tables.first) - 1) * length
    near, far = (spline.evaluate(low + part * length, x, 2) for part in (0.25, 0.75))
    across = np.cross(first, second)
    squares = np.sum(across**2, axis=1)
    volume = np.sum(across * (far - near), axis=1) / (0.5 * length)
    return np.asarray(volume / np.maximum(squares, (SMALLEST_BEND / length) ** 2))


def compute_twist(spline: Spline, hose: records.Hose, twist: Twist, s: Array, x: Array) -> Array:
    """Returns the twist beyond its rest (k,), rad/m, at arc lengths s (k,)."""
    if hose.elasticity.frenet:
        rest = hose.elasticity.rest_torsion[0, 0]
        torsion = compute_torsion(spline, hose, s, x)
        return np.asarray(spline.evaluate_theta(s, x, 1) + torsion - rest)
    if spline.has_theta:
        length = spline.length / len(hose.tables.first)
        nodes = np.cumsum(np.tile(hose.tables.gaps, len(hose.tables.first))) * length
        nodes -= nodes[0] - 0.5 * hose.tables.gaps[0] * length
        gathered = np.interp(s, nodes, twist.frames[: len(nodes), 9])
        rest = np.interp(s, nodes, hose.elasticity.rest_torsion.ravel())
        return np.asarray(spline.evaluate_theta(s, x, 1) + gathered - rest)
    rate = np.zeros(len(s))
    places = twist.places * hose.tables.span_length
    torques = (twist.angle / twist.compliance)[find_owners(twist)]
    for (first, last), torque in zip(twist.ends, torques, strict=True):
        inside = (s >= places[first]) & (s <= places[last])
        rate[inside] = torque / get_torsional_stiffness(hose, s[inside])
    return rate
