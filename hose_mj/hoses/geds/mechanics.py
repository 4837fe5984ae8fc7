"""What stands between `GedsHose` and the kernels: constants, equilibrium, tangents, tension."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.geds import basis, energy, schemes, solver
from hose_mj.hoses.geds.compiled import compile_notice
from hose_mj.hoses.geds.contact import add_contact
from hose_mj.hoses.model import Array, Linearization
from hose_mj.hoses.spec import HoseSpec

MOST_LOAD_STEPS = 64
_ENDLESS = float(np.finfo(np.float64).max)
_STATIC_TOLERANCE = 1e-10
_STATIC_ITERATIONS = 400
_STATIC_TURN = 0.5
"""Largest turn of a tangent in one static iteration (rad): beats an energy line search near
inextensibility."""


_called: set[tuple[Callable[..., Any], int]] = set()


def run_kernel(kernel: Callable[..., Any], axes: tuple[float, ...], *arguments: Any) -> Any:
    """Calls a kernel; a first call that takes over a second says on stderr that it compiles."""
    version = (kernel, len(axes))
    if version in _called:
        return kernel(axes, *arguments)
    with compile_notice("GEDS kernels"):
        result = kernel(axes, *arguments)
    _called.add(version)
    return result


def check_scheme(scheme: str, spec: HoseSpec) -> None:
    """Raises `InputError` for an unknown scheme, or one that cannot do what the hose needs."""
    if scheme not in schemes.SCHEMES:
        raise InputError("scheme", scheme, "one of " + ", ".join(schemes.SCHEMES))
    if scheme == "verlet" and (spec.damping_time > 0.0 or spec.drag > 0.0):
        raise InputError("scheme", scheme, "an implicit scheme for a hose with damping or drag")


def make_constants(spec: HoseSpec, knots: Array) -> solver.Hose:
    """Returns what the kernels need to know of a uniform hose with these knots (n + 4,)."""
    with compile_notice("GEDS kernels"):
        tables = basis.make_tables(knots)
    n_spans = len(tables.first)
    elasticity = energy.Elasticity(
        np.full(n_spans, spec.axial_stiffness, dtype=np.float64),
        np.full((n_spans, 3), spec.bending_stiffness, dtype=np.float64),
        np.full(n_spans, spec.rest_strain, dtype=np.float64),
        np.full((n_spans, 3), spec.rest_curvature, dtype=np.float64),
        float(spec.damping_time),
    )
    mass = basis.make_mass(knots, spec.linear_density)
    return solver.Hose(tables, elasticity, mass, float(spec.drag / spec.linear_density))


def multiply_mass(axes: tuple[float, ...], hose: solver.Hose, flat: Array) -> Array:
    """Returns M times a flat vector (n d,)."""
    out = np.zeros(len(flat))
    run_kernel(solver.multiply_mass, axes, hose.mass, 1.0, flat, out)
    return out


class Equilibrium(NamedTuple):
    """Answer of `find_equilibrium`: a verdict of solver.py, control points (n d,), counters."""

    verdict: int
    x: Array
    iterations: int
    fallbacks: int


def find_equilibrium(
    axes: tuple[float, ...],
    hose: solver.Hose,
    holds: solver.Holds,
    loads: solver.Loads,
    x: Array,
    work: solver.Work,
    load_steps: int,
) -> Equilibrium:
    """Newton's iteration for statics, capped by the turn of the tangents.

    The loads grow in `load_steps` equal steps, in two, four, ... times as many if that fails. The
    holds' multipliers are left in work.multipliers.
    """
    limits = solver.Limits(
        _STATIC_TOLERANCE * hose.tables.span_length * len(hose.tables.first),
        _STATIC_ITERATIONS,
        _STATIC_TURN,
        False,
        1.0,
    )
    stage = (np.inf, x.copy(), np.zeros_like(x))
    verdict, all_iterations, all_fallbacks = solver.NOT_CONVERGED, 0, 0
    shape = x.copy()
    while verdict != solver.DONE and load_steps <= MOST_LOAD_STEPS:
        shape = x.copy()
        for scale in np.linspace(0.0, 1.0, load_steps + 1)[1:]:
            verdict, iterations, fallbacks = run_kernel(
                *(solver.newton, axes, hose, stage, holds, 1.0, loads, scale, limits, shape, work)
            )
            all_iterations += iterations
            all_fallbacks += fallbacks
            if verdict != solver.DONE:
                break
        load_steps *= 2
    return Equilibrium(verdict, shape, all_iterations, all_fallbacks)


def build_tangent(
    axes: tuple[float, ...],
    hose: solver.Hose,
    loads: solver.Loads,
    x: Array,
    v: Array,
    work: solver.Work,
) -> None:
    """Writes dU + C v less moments and contact to work.gradient, its derivative to work.band.

    Forces, gravity, inertia and holds are left out; so is the derivative of damping and friction.
    """
    work.gradient[:] = 0.0
    work.band[:] = 0.0
    work.rate[: len(x)] = v
    tables, elasticity = hose.tables, hose.elasticity
    run_kernel(
        *(energy.assemble, axes, tables, elasticity, x, work.rate, np.inf, True),
        *(work.span, work.gradient, work.band),
    )
    run_kernel(solver.add_moments, axes, loads, True, x, work)
    # Within a step without end nothing changes its velocity, but what slides still rubs.
    run_kernel(
        *(add_contact, axes, loads.contact, x, work.rate, work.rate, _ENDLESS, True),
        *(work.gradient, work.band),
    )


def make_dense(band: Array, size: int, width: int) -> Array:
    """Returns the symmetric matrix (size, size) of a lower band stored by columns."""
    dense = np.zeros((size, size))
    for k in range(width):
        rows = np.arange(k, size)
        dense[rows, rows - k] = band[: size - k, k]
        dense[rows - k, rows] = band[: size - k, k]
    return dense


def make_dense_rows(holds: solver.Holds, size: int) -> Array:
    """Returns the rows of the holds as a matrix (m, size)."""
    dense = np.zeros((len(holds.start), size))
    width = holds.rows.shape[1]
    for row, start in enumerate(holds.start):
        dense[row, start : start + width] = holds.rows[row]
    return dense


def compute_linearization(
    axes: tuple[float, ...],
    hose: solver.Hose,
    holds: solver.Holds,
    work: solver.Work,
    size: int,
) -> Linearization:
    """Returns dense mass, stiffness (from `build_tangent`) and hold rows; overwrites work.band."""
    width = 4 * len(axes)
    stiffness = make_dense(work.band, size, width)
    work.band[:] = 0.0
    run_kernel(solver.add_mass, axes, hose.mass, 1.0, work.band)
    mass = make_dense(work.band, size, width)
    return Linearization(mass, stiffness, make_dense_rows(holds, size))


def interpolate_tension(strains: Array, axial_stiffness: float, length: float, s: Array) -> Array:
    """Returns the axial force (k,) N at arc lengths s (k,) from the spans' strain modes (S, 2).

    Linear between the means at the spans' middles; the end spans know their own slope, sqrt(3) xi
    times the linear mode, xi = -1 .. 1.
    """
    mean, linear = strains.T * axial_stiffness
    middles = (np.arange(len(mean)) + 0.5) * length / len(mean)
    nodes = np.concatenate([[0.0], middles, [length]])
    first = mean[0] - np.sqrt(3.0) * linear[0]
    last = mean[-1] + np.sqrt(3.0) * linear[-1]
    return np.asarray(np.interp(s, nodes, np.concatenate([[first], mean, [last]])))
