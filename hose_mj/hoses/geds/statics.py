"""Static equilibrium of a spline hose: Newton's iteration, capped by the turn of the tangents."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hose_mj.hoses.geds import frames, twist
from hose_mj.hoses.geds import integrators as schemes
from hose_mj.hoses.geds import newton as solver
from hose_mj.hoses.protocol import Array
from hose_mj.jit import run_kernel

MOST_LOAD_STEPS = 64
_STATIC_TOLERANCE = 1e-10
_STATIC_ITERATIONS = 400
_STATIC_TURN = 0.5
"""Largest turn of a tangent in one static iteration (rad): beats an energy line search near
inextensibility."""
_LAYING_ITERATIONS = 8
"""A hose with theta lays its frames anew after so many iterations; with frames that have gathered
much of the hose's own turns the iteration crawls."""


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
    length = hose.tables.span_length * len(hose.tables.first)
    limits = solver.Limits(
        _STATIC_TOLERANCE * length,
        length,
        _STATIC_ITERATIONS,
        _STATIC_TURN,
        False,
        1.0,
    )
    found = Equilibrium(solver.NOT_CONVERGED, x, 0, 0)
    changing = (holds.twist.kept, holds.twist.spin, holds.before, holds.after)
    before = [part.copy() for part in changing]
    iterations, fallbacks = 0, 0
    while found.verdict != solver.DONE and load_steps <= MOST_LOAD_STEPS:
        for part, kept in zip(changing, before, strict=True):
            part[:] = kept
        run_kernel(schemes.start_step, axes, holds, np.inf)
        found = Equilibrium(solver.NOT_CONVERGED, x.copy(), 0, 0)
        for scale in np.linspace(0.0, 1.0, load_steps + 1)[1:]:
            found = _iterate(axes, hose, holds, loads, scale, limits, found.x, work)
            iterations += found.iterations
            fallbacks += found.fallbacks
            if found.verdict != solver.DONE:
                break
        load_steps *= 2
    if found.verdict != solver.DONE:
        for part, kept in zip(changing, before, strict=True):
            part[:] = kept
    return Equilibrium(found.verdict, found.x, iterations, fallbacks)


def _iterate(
    axes: tuple[float, ...],
    hose: solver.Hose,
    holds: solver.Holds,
    loads: solver.Loads,
    scale: float,
    limits: solver.Limits,
    x: Array,
    work: solver.Work,
) -> Equilibrium:
    """Newton's iteration at one load; a hose with theta lays its frames anew every now and then."""
    stage = (np.inf, x.copy(), np.zeros_like(x))
    state = schemes.make_state(len(x))
    state.x[:] = x
    if len(axes) == 4:
        limits = limits._replace(max_iterations=_LAYING_ITERATIONS)
    verdict, iterations, fallbacks = solver.NOT_CONVERGED, 0, 0
    for _ in range(_STATIC_ITERATIONS // _LAYING_ITERATIONS):
        verdict, more, fell = run_kernel(
            *(solver.newton, axes, hose, stage, holds, 1.0, loads, scale, limits, state.x, work)
        )
        iterations += more
        fallbacks += fell
        if len(axes) != 4 or verdict not in (solver.DONE, solver.NOT_CONVERGED):
            break
        theta = state.x[3::4].copy()
        run_kernel(frames.accept_frames, axes, hose, holds, state, work.span)
        if verdict == solver.DONE and np.array_equal(theta, state.x[3::4]):
            break
    return Equilibrium(verdict, state.x, iterations, fallbacks)


def accept(
    axes: tuple[float, ...],
    hose: solver.Hose,
    holds: solver.Holds,
    state: schemes.State,
    work: solver.Work,
) -> None:
    """Ends a static solve like a step: holds have moved, twist and frames are what was found."""
    holds.multipliers[:] = work.multipliers[: len(holds.multipliers)]
    holds.before[:] = holds.after
    if len(axes) == 3:
        run_kernel(twist.accept_twist, axes, holds.twist, state.x)
    elif len(axes) == 4:
        run_kernel(frames.accept_frames, axes, hose, holds, state, work.span)
